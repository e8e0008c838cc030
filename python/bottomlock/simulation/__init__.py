"""From a scenario to what the kernel takes: build, measurement schedule, beam loss, sensor streams."""
