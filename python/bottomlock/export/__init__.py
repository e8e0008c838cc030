"""Tracks of a replay or a live log in the formats of other programs, one file a format."""
