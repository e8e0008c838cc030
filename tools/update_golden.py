"""Rewrite tests/golden/runs.csv: two runs of every method on the paper's three trajectories, as `make golden` does.

Nothing else writes that file. A number that moves goes into CHANGELOG.md under "Numbers", with the reason.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import polars as pl

from bottomlock import load_scenario, run_campaign

GOLDEN = Path(__file__).resolve().parent.parent / "tests" / "golden" / "runs.csv"
SCENARIOS = ("figure_eight", "lawn_mower", "straight")
RUNS = 2


def golden_runs() -> pl.DataFrame:
    """The runs table of the three scenarios with the seed and the methods that it ships with."""
    scenarios = [load_scenario(name).with_overrides(runs=RUNS) for name in SCENARIOS]
    with tempfile.TemporaryDirectory() as folder:
        return run_campaign(scenarios, Path(folder) / "campaign").runs


def write(runs: pl.DataFrame, path: Path) -> None:
    """Ten significant digits: more than platforms agree on, and no more."""
    digits = [
        pl.col(name).map_elements(lambda value: f"{value:.9e}", return_dtype=pl.String)
        for name, kind in runs.schema.items()
        if kind.is_float()
    ]
    runs.with_columns(digits).write_csv(path)


def main() -> None:
    """Write the file and say what to do next."""
    write(golden_runs(), GOLDEN)
    print(f"update_golden: wrote {GOLDEN.name}; if `git diff` shows moved numbers, CHANGELOG.md says why")


if __name__ == "__main__":
    main()
