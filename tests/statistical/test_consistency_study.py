"""A small consistency study on every commit: the consistent methods pass, the others are overconfident.

Two trajectories, four beams and two, ten methods, 30 runs or 60. All means together are judged at a false-alarm rate of
1 % (Bonferroni, `bottomlock.statistics.chi_squared`): right code fails in one of a hundred seeds at the most, by the
consistent methods. The overconfident ones exceed their bands by factors, not by a margin, so that 30 runs show each of
them. The seed and 60 runs were written down before the first run; 30 runs, and two of the verdicts, came later
(`expected_verdicts.toml` names these).
"""

from __future__ import annotations

from pathlib import Path

import polars as pl
import pytest

from bottomlock.config.scenario import load_scenario
from bottomlock.studies.consistency import FALSE_ALARM, run_consistency
from bottomlock.studies.expected_verdicts import departures, read_expectations
from bottomlock.tables.check import check
from bottomlock.tables.studies import CONSISTENCY_STUDY

pytestmark = [pytest.mark.statistical, pytest.mark.slow]

# The day the paper appeared, as in `ensembles`.
SEED = 20170222
METHODS = ("lc", "tc", "info", "vb_exact", "nsv", "elc", "vb", "vhv", "sway_current", "consistent")
EXPECTED = Path(__file__).with_name("expected_verdicts.toml")


@pytest.fixture(scope="module", params=[30, pytest.param(60, marks=pytest.mark.long)])
def study_table(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> pl.DataFrame:
    out = tmp_path_factory.mktemp("consistency")
    scenarios = [
        load_scenario(name).with_overrides(runs=request.param, seed=SEED, methods=METHODS)
        for name in ("straight", "figure_eight")
    ]
    return run_consistency(scenarios, [(1, 2, 3, 4), (1, 2)], out, threads=1)


def test_verdicts_are_as_expected(study_table: pl.DataFrame) -> None:
    """Every expectation of the file, which is the one that `bottomlock consistency --assert` takes."""
    assert FALSE_ALARM == 0.01
    assert departures(study_table, read_expectations(EXPECTED)) == []


def test_the_table_is_whole(study_table: pl.DataFrame) -> None:
    """Three quantities for each method and mask; `lc` stands once, since it does not look at which beams are lost."""
    check(study_table, CONSISTENCY_STUDY, place="consistency")
    assert study_table.height == 2 * 3 * (len(METHODS) + len(METHODS) - 1)
    assert study_table.filter(pl.col("method") == "lc")["beams"].unique().to_list() == ["1,2,3,4"]


def test_the_identities_hold_in_the_table(study_table: pl.DataFrame) -> None:
    """TC, the information form and the exact virtual beam are one filter: the same NEES of two beams to 1 %."""
    nees = study_table.filter(pl.col("beams") == "1,2", pl.col("quantity") == "nees_velocity_attitude")
    for _, rows in nees.group_by("trajectory"):
        means = {row["method"]: row["mean"] for row in rows.iter_rows(named=True)}
        assert means["info"] == pytest.approx(means["tc"], rel=0.01)
        assert means["vb_exact"] == pytest.approx(means["tc"], rel=0.01)
