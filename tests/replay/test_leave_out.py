"""Beams left out of pings: by hand, by a literal Kalman filter, and consistent where the noise is as claimed."""

import numpy as np
import polars as pl
import pytest

from bottomlock.files.replay_tables import SCORES
from bottomlock.kernel import BeamGeometry
from bottomlock.replay.leave_out import leave_out, over_sets, random_walk, reference_pings

JANUS = BeamGeometry.janus(np.deg2rad(25.0))
SD = np.full(4, 0.02)


def walking(pings: int = 3000, seed: int = 5) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, velocities and beams of a velocity that walks as the prior states, with the noise that is claimed."""
    rng = np.random.default_rng(seed)
    time_ns = np.arange(pings, dtype=np.int64) * 350_000_000
    velocity = np.cumsum(rng.standard_normal((pings, 3)) * 0.1 * np.sqrt(0.35), axis=0)
    beams = JANUS.beam_velocities(velocity) + rng.standard_normal((pings, 4)) * 0.02
    return time_ns, velocity, beams


def test_one_ping_by_hand() -> None:
    """One beam 40 mm/s off: with it left out least squares of three misses it by those 40 mm/s, at 2 σ claimed."""
    beams = JANUS.beam_velocities([[1.0, 0.0, 0.0]])
    beams[0, 2] += 0.04
    scores = leave_out(
        JANUS, np.zeros(1, dtype=np.int64), beams, np.ones((1, 4), dtype=bool), SD, beams=1, closure_gate=None
    )
    row = scores.filter(
        (pl.col("left_out") == "3") & (pl.col("method") == "lc") & (pl.col("component") == "beam")
    )
    assert row["error_median_mps"][0] == pytest.approx(0.04)
    # The beams of a Janus predict the fourth with the noise of three, each with weight one: √(3 + 1) σ.
    assert row["sd_median_mps"][0] == pytest.approx(0.04)
    assert scores.schema == pl.Schema(SCORES)


def test_prior_is_that_of_a_literal_kalman_filter() -> None:
    time_ns, _, beams = walking(60)
    valid = np.ones((60, 4), dtype=bool)
    valid[20:30, 2:] = False
    priors = random_walk(JANUS, time_ns, beams, valid, SD)
    v, P = np.zeros(3), np.eye(3)
    for k in range(60):
        if k:
            P = P + 0.1**2 * 0.35 * np.eye(3)
        np.testing.assert_allclose(priors.velocity_p_mps[k], v, atol=1e-9)
        np.testing.assert_allclose(priors.cov_m2ps2[k], P, atol=1e-9)
        for beam in np.flatnonzero(valid[k]):
            h = np.asarray(JANUS.directions_p)[beam]
            gain = P @ h / (h @ P @ h + 0.02**2)
            v = v + gain * (beams[k, beam] - h @ v)
            P = P - np.outer(gain, h @ P)


@pytest.mark.first_cases(1)
@pytest.mark.parametrize("beams", [1, 2])
def test_consistent_methods_are_found_consistent(beams: int) -> None:
    """Where noise and walk are as assumed, error over claimed is 1 for least squares, PLCF and the information form.

    3,000 pings, paired with one another through the prior: 5 % is five of the ratio's sigmas or more.
    """
    time_ns, _, readings = walking()
    scores = leave_out(
        JANUS, time_ns, readings, np.ones((3000, 4), dtype=bool), SD, beams=beams, closure_gate=None
    )
    told = scores.filter(
        pl.col("method").is_in(["lc", "plcf", "info"]) & pl.col("normalised_rms_over_pings").is_not_null()
    )
    assert told.height >= 20
    np.testing.assert_allclose(told["normalised_rms_over_pings"], 1.0, atol=0.05)


def test_unsolvable_is_said_and_not_scored() -> None:
    """Least squares of two beams solves nothing; NSV not the pairs that share a side."""
    time_ns, _, readings = walking(50)
    summary = over_sets(leave_out(JANUS, time_ns, readings, np.ones((50, 4), dtype=bool), SD, beams=2))
    solved = {(row["method"], row["component"]): row["sets_solved"] for row in summary.iter_rows(named=True)}
    assert solved["lc", "surge"] == 0
    assert solved["nsv", "sway"] == 4
    assert solved["info", "sway"] == 6


def test_outliers_are_no_reference() -> None:
    _, _, readings = walking(500)
    readings[7, 1] += 1.0
    valid = np.ones((500, 4), dtype=bool)
    valid[9, 0] = False
    kept = reference_pings(JANUS, readings, valid, 3.0)
    assert not kept[[7, 9]].any()
    assert kept.mean() > 0.98
