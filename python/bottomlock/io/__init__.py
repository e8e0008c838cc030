"""Readers of recorded data: each format a module with `NAME`, `sniff` and `read`, listed in `formats`."""
