"""Scenario files: sections, validation, and what the package ships (scenarios, vehicles, geometries)."""
