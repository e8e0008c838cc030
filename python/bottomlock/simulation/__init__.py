"""From a scenario to what the kernel takes: true motion, build, measurement schedule, beam loss, sensor streams."""
