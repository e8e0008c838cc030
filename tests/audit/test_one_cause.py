"""One cause is named where one is at fault, both where the log leaves two, and none in a log without lock."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from bottomlock import BeamGeometry
from bottomlock.audit.logs import BeamLog
from bottomlock.audit.robust import BLOCKS, LEAST_BLOCKS, blocks_of, sigmas_for
from bottomlock.audit.run import audit_file, audit_log
from bottomlock.statistics.correlation import correlation_rows
from tests.audit.synthetic import Array, channels, janus, kinds, make_log, motion

STATED = BeamGeometry.janus(np.deg2rad(22.0))


@pytest.mark.first_cases(1)
@pytest.mark.parametrize("stated", [STATED, None])
@pytest.mark.parametrize("beam", [0, 2])
def test_a_channel_scaled_after_the_instrument_solved(stated: BeamGeometry | None, beam: int) -> None:
    """W⁺ of such a log differs from the beams in all four; only one of them is at fault."""
    factor = np.ones(4)
    factor[beam] = 1.02
    log = make_log(21)
    audit = audit_log(replace(log, velocity_mps=log.velocity_mps * factor), stated=stated)
    assert kinds(audit.findings) == {("beam_scale", (beam + 1,))}
    assert audit.findings[0].size == pytest.approx(2.0, abs=0.1)
    assert audit.assessment.explained[0].where == "recorded"
    # The beams as they are in the record close without a part that follows the velocity.
    assert audit.assessment.slope is not None
    assert audit.assessment.slope.p_value > 1e-3


def test_a_channel_turned_after_the_instrument_solved() -> None:
    log = make_log(22)
    assert log.instrument_mps is not None
    turned = janus(25.0)[1] - janus(22.0)[1]
    y = log.velocity_mps.copy()
    y[:, 1] += log.instrument_mps @ turned
    audit = audit_log(replace(log, velocity_mps=y), stated=STATED)
    assert kinds(audit.findings) == {("mistilted_beam", (2,))}
    assert audit.findings[0].size == pytest.approx(3.0, abs=0.1)


def test_two_beams_at_fault_are_not_one() -> None:
    """No single cause fits: the beams are listed, and that the matrix is not unique is said."""
    log = make_log(23)
    audit = audit_log(replace(log, velocity_mps=log.velocity_mps * [1.04, 0.97, 1.0, 1.0]), stated=STATED)
    assert "beam_scale" not in {one.kind for one in audit.findings}
    assert audit.assessment.explained[0].kind == "free"
    assert audit.findings


def steady(seed: int, pings: int, varies: float) -> BeamLog:
    """Beams alone on a course at 0.8, 0.1, 0.05 m/s."""
    rng = np.random.default_rng(seed)
    velocity = np.array([0.8, 0.1, 0.05]) + varies * (motion(rng, pings) - [0.6, 0.0, 0.0])
    return make_log(seed, velocity=velocity, pings=pings, instrument=False, sd_mps=0.02)


def test_neighbours_exchanged_on_a_steady_course_or_a_bias() -> None:
    """At one velocity the two cannot be told apart: both are named, and no geometry is written."""
    (found,) = audit_log(channels(steady(24, 400, 0.0), [1, 0, 2, 3]), stated=STATED).findings
    assert found.kind == "order_or_bias"
    assert "exchanged" in found.text
    assert "bias" in found.text
    assert "probability" in found.text


def test_neighbours_exchanged_are_told_by_motion() -> None:
    """Decimetres a second of change decide against a bias."""
    (found,) = audit_log(channels(steady(25, 400, 1.0), [1, 0, 2, 3]), stated=STATED).findings
    assert found.kind == "swapped_beams"
    assert "odds 1 in" in found.evidence


def test_a_bias_is_no_exchange() -> None:
    """A closure that stays where it is while the vehicle moves."""
    log = steady(26, 600, 1.0)
    (found,) = audit_log(
        replace(log, velocity_mps=log.velocity_mps + np.array([0.15, 0.0, 0.0, 0.0])), stated=STATED
    ).findings
    assert found.kind == "closure_bias"
    assert found.size == pytest.approx(150.0, abs=5.0)


@pytest.mark.parametrize("seed", range(31, 35))
def test_no_geometry_and_one_noisy_beam_is_still_a_janus(seed: int) -> None:
    """One beam three times noisier than the rest moves the combination of least spread off ±1."""
    rng = np.random.default_rng(seed)
    log = make_log(seed, instrument=False, sd_mps=0.03)
    noisy = log.velocity_mps + 0.08 * rng.normal(size=(log.pings, 4)) * [1.0, 0.0, 0.0, 0.0]
    (found,) = audit_log(replace(log, velocity_mps=noisy)).findings
    assert (found.kind, found.severity) == ("beams_alone", "note")
    assert "close as a Janus in which beams 1 and 3" in found.text


def test_no_geometry_and_no_janus() -> None:
    rows = janus()
    rows[1] *= 1.15
    log = make_log(36, physical=rows, instrument=False, pings=3000)
    (found,) = audit_log(log).findings
    assert found.severity == "warning"
    assert "follows the velocity" in found.text


def unlocked(y: Array, valid: bool, own_valid: bool | None) -> BeamLog:
    flags = None if own_valid is None else np.full(len(y), own_valid)
    own = None if own_valid is None else np.zeros((len(y), 3))
    return BeamLog("air", np.arange(len(y)) * 10**8, y, np.full(y.shape, valid), None, own, flags)


@pytest.mark.parametrize(
    "log",
    [
        unlocked(np.random.default_rng(1).normal(size=(300, 4)), valid=True, own_valid=False),
        unlocked(np.full((300, 4), np.nan), valid=False, own_valid=None),
        unlocked(np.zeros((300, 4)), valid=True, own_valid=None),
        unlocked(np.full((300, 4), -10.117), valid=False, own_valid=False),
    ],
    ids=["noise-in-air", "empty", "zeros", "one-number"],
)
def test_a_log_that_never_had_lock(log: BeamLog) -> None:
    for stated in (STATED, None):
        (found,) = audit_log(log, stated=stated).findings
        assert found.kind == "never_locked"


def test_a_table_of_empty_beams_is_audited(tmp_path: Path) -> None:
    """The table that `convert` writes of a log without a valid beam."""
    columns: dict[str, object] = {"time_ns": np.arange(50) * 10**8}
    for k in range(4):
        columns |= {f"beam{k + 1}_mps": [None] * 50, f"beam{k + 1}_valid": [False] * 50}
    pl.DataFrame(columns).write_parquet(tmp_path / "air.parquet")
    (found,) = audit_file(tmp_path / "air.parquet").findings
    assert found.kind == "never_locked"


def test_few_blocks_claim_nothing() -> None:
    """Blocks hold two correlation times; from fewer than eight of them nothing is significant."""
    noise = np.repeat(np.random.default_rng(2).normal(size=400), 20)
    lasting = correlation_rows(noise)
    assert lasting == pytest.approx(20.0, rel=0.4)
    blocks = int(blocks_of(len(noise), lasting)[-1]) + 1
    assert blocks == BLOCKS
    assert int(blocks_of(200, lasting)[-1]) + 1 < LEAST_BLOCKS
    assert sigmas_for(LEAST_BLOCKS - 1) == np.inf
    assert sigmas_for(10_000) == pytest.approx(4.417 / np.sqrt(0.75), abs=0.01)


@pytest.mark.parametrize("seed", range(41, 45))
def test_correlated_noise_is_no_bias(seed: int) -> None:
    """A closure that wanders over forty pings has a mean; it is no bias."""
    rng = np.random.default_rng(seed)
    log = make_log(seed, instrument=False, pings=1000, decimals=None)
    wander = np.zeros(1000)
    for k in range(1, 1000):
        wander[k] = 0.95 * wander[k - 1] + 0.31 * rng.normal()
    noisy = log.velocity_mps + 0.03 * wander[:, None] * [1.0, 0.0, 0.0, 0.0]
    assert "closure_bias" not in {
        one.kind for one in audit_log(replace(log, velocity_mps=noisy), stated=STATED).findings
    }
