"""Campaigns of seconds, and what it means that two of them are the same."""

from pathlib import Path

from bottomlock.config.scenario import Scenario, load_scenario

TABLES = ("runs.parquet", "ensemble.parquet", "consistency.parquet")

STEPS_OF_TWO_RUNS = 2 * 1501 * 3
"""As `chunk.CHUNK_STEPS`: two runs of `short` a chunk."""


def short(runs: int = 5, name: str = "straight") -> Scenario:
    """Ten seconds of a packaged scenario with three methods."""
    scenario = load_scenario(name).with_overrides(runs=runs, methods=["ins", "lc", "tc"])
    return scenario.with_trajectory(duration_s=10.0)


def same_bits(one: Path, two: Path) -> None:
    """Tables and chunks are the same files, byte for byte."""
    for path in [one / name for name in TABLES] + sorted(one.glob("chunks/*/*")):
        other = two / path.relative_to(one)
        assert path.read_bytes() == other.read_bytes(), path.name
    assert len(list(one.glob("chunks/*/*"))) == len(list(two.glob("chunks/*/*")))
