"""The A-KIT sections with an exact truth: the filter's claims hold there, forward and smoothed."""

from __future__ import annotations

from pathlib import Path

import polars as pl
import pytest

from tools.akit_twin import twin_runs
from tools.recorded_runs import WORLDS, section_case

pytestmark = [pytest.mark.recordings, pytest.mark.long]

DRAWS = 5
"""Of each of two sections; medians over so many have a spread of 6 %."""


@pytest.fixture(scope="module")
def runs(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> pl.DataFrame:
    if not (recordings / "akit_snapir").is_dir():
        pytest.skip(f"no recording {recordings / 'akit_snapir'}")
    (world,) = (one for one in WORLDS if one.twin)
    scratch = tmp_path_factory.mktemp("twin")
    return pl.concat(
        [twin_runs(section_case(recordings, scratch, world, section, DRAWS)) for section in (1, 7)]
    )


@pytest.mark.parametrize("which", ["forward", "smoothed"])
def test_claims_hold_on_an_exact_truth(runs: pl.DataFrame, which: str) -> None:
    """Attitude too, which a truth against the axes of the origin in place of the vehicle's would miss: 1.6."""
    of_tc = runs.filter(pl.col("method") == "tc", pl.col("what_if") == "recorded", pl.col("pass") == which)
    for name in ("velocity", "attitude"):
        assert 0.8 < of_tc[f"{name}_normalised_rms_over_time"].median() < 1.1, name  # type: ignore[operator]
        assert of_tc[f"{name}_covered_2sigma"].mean() > 0.93, name  # type: ignore[operator]
