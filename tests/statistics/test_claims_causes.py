"""Claims that are tested in two ways: a drift by its cause, an improvement by both formulas."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bottomlock.statistics.claim_verdicts import NOT_REPRODUCED, NOT_TESTABLE, REPRODUCED, _verdict
from bottomlock.statistics.rms import Array
from tests.report.synthetic_campaign import write_campaign
from tests.statistics.judged_claims import PAPER, in_dive, one, sized


@pytest.mark.parametrize(
    ("plcf", "other"), [(1.4 / 1.26, "26.0 %"), (1.4 * 0.74, "35.1 %"), (1.4 * 0.9, None)]
)
def test_an_improvement_is_told_by_both_formulas_where_the_verdict_depends_on_it(
    tmp_path: Path, plcf: float, other: str | None
) -> None:
    """26 % as an excess is 20.6 % as a reduction, and 26 % as a reduction 35.1 % as an excess; 10 % is neither."""
    size = sized({}, {("figure_eight", "plcf"): plcf})
    note = one(write_campaign(tmp_path / "c", size, scatter=0.5), "t2-attitude-plcf-improvement")["note"]
    assert ("depends on the formula" in note) == (other is not None)
    assert other is None or other in note


@pytest.mark.first_cases(1)
@pytest.mark.parametrize(
    ("level", "runs", "verdict", "words"),
    [
        (
            0.1,
            40,
            REPRODUCED,
            "with the dive from 0.113 to 0.500 m/s, without the dive from 0.100 to 0.100 m/s",
        ),
        (in_dive, 40, NOT_REPRODUCED, "without the dive from 0.113 to 0.500 m/s"),
        (lambda time_s: 0.8 * in_dive(np.maximum(time_s, 7.0)), 40, REPRODUCED, "with the dive"),
        (0.1, 39, NOT_TESTABLE, "the runs of lawn_mower in without_dive are others than here"),
        (
            None,
            40,
            NOT_TESTABLE,
            "no runs without the dive (without_dive); `bottomlock reproduce` makes them",
        ),
    ],
)
def test_a_cause_is_tested_by_the_same_runs_without_it(
    tmp_path: Path, level: Callable[[Array], Array] | float | None, runs: int, verdict: str, words: str
) -> None:
    """What drifts as much without the dive does not drift because of it, though it drifts in the dive."""
    folder = write_campaign(tmp_path / "c", sized({("lawn_mower", "plcf"): in_dive}))
    if level is not None:
        size = sized({("lawn_mower", "plcf"): level})
        write_campaign(
            folder / "without_dive", size, runs=runs, trajectories=["lawn_mower"], methods=["vb", "plcf"]
        )
    row = one(folder, "t3-velocity-plcf-drifts-because-of-the-dive")
    assert row["verdict"] == verdict
    assert words in row["note"]
    assert one(folder, "t3-velocity-plcf-drifts-in-the-dive")["verdict"] == REPRODUCED


@pytest.mark.parametrize(
    ("low", "high", "verdict"),
    [(1.26, 1.6, REPRODUCED), (1.1, 1.24, NOT_REPRODUCED), (1.2, 1.3, NOT_TESTABLE)],
)
def test_a_cause_has_a_tolerance(low: float, high: float, verdict: str) -> None:
    """A quarter more growth with the dive than without it."""
    (claim,) = [one for one in PAPER.claim if one.id == "t3-velocity-vb-drifts-because-of-the-dive"]
    assert _verdict(claim, low, high) == verdict
