"""Studies over many campaigns: cases, masks, recovery, consistency, the sweep, the whole of the 2017 paper."""
