"""Rivals of our methods, each from its paper: `estimate(mission)` of a module answers a mission (README.md)."""
