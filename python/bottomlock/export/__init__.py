"""Tracks of a replay, a campaign's run or a live log in the formats of other programs, one file a format."""
