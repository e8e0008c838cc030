"""Live use: sources, framing, clocks, states, the engine that navigates, sinks, raw log and health page."""
