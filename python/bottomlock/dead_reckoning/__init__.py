"""Dead reckoning, of recordings, missions and simulated runs alike: its track, what it may claim, its attitude."""
