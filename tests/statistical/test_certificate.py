"""A small honesty certificate on every commit: the honest arms are consistent, the others shown for what they are.

Two trajectories, four beams and two, ten arms, 60 runs. All means together are judged at a false-alarm rate of 1 %
(Bonferroni, `bottomlock.statistics.chi_squared`): right code fails in one of a hundred seeds at the most, by the honest
arms. The
overconfident ones exceed their bands by factors, not by a margin. Seed, number of runs and verdicts were written down
before the first run; nothing was widened afterwards.
"""

from __future__ import annotations

from pathlib import Path

import polars as pl
import pytest

from bottomlock.config.scenario import load_scenario
from bottomlock.studies.consistency import FALSE_ALARM, certify
from bottomlock.studies.consistency_table import CERTIFICATE
from bottomlock.studies.expected_verdicts import departures, read_expectations
from bottomlock.tables.schema import check

pytestmark = [pytest.mark.statistical, pytest.mark.slow]

# The day the paper appeared, as in `ensembles`.
SEED = 20170222
RUNS = 60
ARMS = ("lc", "tc", "info", "vb_exact", "nsv", "elc", "vb", "vhv", "sway_current", "consistent")
EXPECTED = Path(__file__).with_name("expected_verdicts.toml")


@pytest.fixture(scope="module")
def certificate(tmp_path_factory: pytest.TempPathFactory) -> pl.DataFrame:
    out = tmp_path_factory.mktemp("certificate")
    scenarios = [
        load_scenario(name).with_overrides(runs=RUNS, seed=SEED, arms=ARMS)
        for name in ("straight", "figure_eight")
    ]
    return certify(scenarios, [(1, 2, 3, 4), (1, 2)], out, threads=1)


def test_verdicts_are_as_expected(certificate: pl.DataFrame) -> None:
    """Every expectation of the file, which is the one that `bottomlock certify --assert` takes."""
    assert FALSE_ALARM == 0.01
    assert departures(certificate, read_expectations(EXPECTED)) == []


def test_the_table_is_whole(certificate: pl.DataFrame) -> None:
    """Three quantities for each arm and mask; `lc` stands once, since it does not look at which beams are lost."""
    check(certificate, CERTIFICATE, place="certificate")
    assert certificate.height == 2 * 3 * (len(ARMS) + len(ARMS) - 1)
    assert certificate.filter(pl.col("arm") == "lc")["beams"].unique().to_list() == ["1,2,3,4"]


def test_the_identities_hold_in_the_table(certificate: pl.DataFrame) -> None:
    """TC, the information form and the exact virtual beam are one filter: the same NEES of two beams to 1 %."""
    nees = certificate.filter(pl.col("beams") == "1,2", pl.col("quantity") == "nees_velocity_attitude")
    for _, rows in nees.group_by("trajectory"):
        means = {row["arm"]: row["mean"] for row in rows.iter_rows(named=True)}
        assert means["info"] == pytest.approx(means["tc"], rel=0.01)
        assert means["vb_exact"] == pytest.approx(means["tc"], rel=0.01)
