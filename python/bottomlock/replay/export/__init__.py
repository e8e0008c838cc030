"""Tracks of a finished replay in the formats of other programs, one file a format."""
