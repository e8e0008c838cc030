"""Noise of a recording from the recording itself, without truth: likelihood over several horizons (docs/tune.md)."""
