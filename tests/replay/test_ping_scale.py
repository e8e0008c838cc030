"""The noise of a single ping under heavy tails: by hand, and as one covariance on pings that did not make it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm, t

from bottomlock.kernel import BeamGeometry
from bottomlock.replay.beam_noise import BeamNoise
from bottomlock.replay.ping_scale import ping_noise
from bottomlock.replay.screen_beams import Screened
from tools.fix_coverage import SEEDS, covered, second_half

JANUS = BeamGeometry.janus(np.deg2rad(25.0))
SD = np.full(4, 0.02)


def of_log(pings: int, factor: float, degrees: float) -> BeamNoise:
    halfwidths = t.isf(norm.sf([1.0, 2.0, 3.0]), degrees)
    return BeamNoise(
        np.full(pings, factor), np.tile(halfwidths / halfwidths[0], (pings, 1)), np.full(pings, degrees), ()
    )


def test_a_closure_by_hand() -> None:
    """A difference z = c (1, −1, 1, −1) is all closure: q = 4c²/(sσ)².

    A scatter of zero is taken as 0.4 of a ping's own: B D Bᵀ is then 0.4 s²σ² on the three directions of a velocity and
    nothing on the closure, so that ρ = 1 + 3/1.4.
    """
    degrees, s, c = 2.0, 1.5, 0.09
    noise = of_log(2, s * t.isf(norm.sf(1.0), degrees), degrees)
    velocity = np.array([1.0, 0.2, -0.1])
    beams = np.stack([JANUS.beam_velocities(velocity[None])[0]] * 2)
    beams[1] += c * np.array([1.0, -1.0, 1.0, -1.0])
    screened = Screened(
        np.ones((2, 4), dtype=bool), noise.factor, np.zeros(2, dtype=np.int64), np.tile(velocity, (2, 1)),
        np.zeros((3, 3)),
    )  # fmt: skip
    factor, halfwidths = ping_noise(JANUS, beams, SD, noise, screened)
    known = degrees + 1.0 + 3.0 / 1.4
    quantiles = t.isf(norm.sf([1.0, 2.0, 3.0]), known)
    for k, q in enumerate((0.0, 4.0 * c**2 / (s * 0.02) ** 2)):
        # Rounded to steps of 1 %.
        assert factor[k] == pytest.approx(s * np.sqrt((degrees + q) / known) * quantiles[0], rel=0.0051)
        np.testing.assert_allclose(halfwidths[k], quantiles / quantiles[0], rtol=1e-9)


def test_a_ping_alone_and_gaussian_noise_keep_the_noise_of_the_log() -> None:
    whole, untested = np.ones((3, 4), dtype=bool), np.zeros(3, dtype=np.int64)
    alone = Screened(whole, np.full(3, 1.3), untested, np.full((3, 3), np.nan), np.eye(3))
    beams = np.random.default_rng(1).normal(size=(3, 4))
    heavy = of_log(3, 1.3, 2.0)
    factor, halfwidths = ping_noise(JANUS, beams, SD, heavy, alone)
    assert factor.tolist() == [1.3] * 3
    np.testing.assert_array_equal(halfwidths, heavy.halfwidths)
    predicted = Screened(alone.valid, alone.factor, alone.outcome, np.zeros((3, 3)), np.eye(3))
    assert ping_noise(JANUS, beams, SD, of_log(3, 1.3, 1000.0), predicted)[0].tolist() == [1.3] * 3


@pytest.mark.parametrize("kind", ["1.5", "2", "3", "contaminated"])
def test_one_covariance_covers_heavy_tails(kind: str) -> None:
    """Mean of four logs; expected are 66 to 71 %, 94 to 97 % and 99 % or more (docs/robust.md has what is measured).

    A log of 1,200 full pings measures the scale within 4 %, which moves the coverage of 1 sigma of four by 1 %.
    Contaminated noise is no Student's t, and 1 sigma covers 65 %; of 1.5 degrees 2 sigma cover 97.5 %.
    """
    halves = [second_half(kind, seed) for seed in SEEDS[:4]]
    one, two, three = np.mean([covered(half.error_mps, half.of_ping_mps) for half in halves], axis=0)
    assert (63.5 if kind == "contaminated" else 65.0) < one < 71.0
    assert 94.0 < two < 98.0
    assert three > 99.0
    # The covariance is bounded: no ping that is not itself far off has metres a second.
    assert all(np.median(half.of_ping_mps[:, 0]) < 0.15 for half in halves)
