"""PartialDVL-Bench: missions, tasks, scores and submissions; docs/bench.md is the protocol."""
