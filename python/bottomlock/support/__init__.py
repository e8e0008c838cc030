"""What Python leaves out: modules that load late, extras, the nearest name, work in another process."""
