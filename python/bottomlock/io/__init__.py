"""Readers of recorded data."""
