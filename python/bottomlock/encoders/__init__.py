"""Makers' bytes for a DVL's pings: what the readers in `bottomlock.io` read."""
