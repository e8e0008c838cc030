"""The noise of a single ping under heavy tails: by hand, and as one covariance on pings that did not make it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm, t

from bottomlock.kernel import BeamGeometry
from bottomlock.replay.beam_noise import BeamNoise, measure_noise
from bottomlock.replay.ping_scale import ping_noise
from bottomlock.replay.robust_fix import solve_scaled
from bottomlock.replay.screen_beams import Screened, screen_beams

JANUS = BeamGeometry.janus(np.deg2rad(25.0))
SD = np.full(4, 0.02)
PINGS = 1500


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


def drawn(kind: str, rng: np.random.Generator, pings: int) -> np.ndarray:
    """(pings, 4) noise of unit scale: Student's t, or 3 % at twelve times the rest."""
    if kind == "contaminated":
        return rng.normal(size=(pings, 4)) * np.where(rng.random((pings, 4)) < 0.03, 12.0, 1.0)
    return rng.standard_t(float(kind), (pings, 4))


def covered(kind: str, seed: int) -> list[float]:
    """Share of the velocity errors of the second half within 1, 2 and 3 sigma, the noise measured on the first.

    A fifth of the pings has three beams.
    """
    rng = np.random.default_rng(seed)
    velocity = np.array([1.0, 0.0, 0.1]) + np.cumsum(rng.normal(size=(2 * PINGS, 3)) * 0.01, axis=0)
    beams = JANUS.beam_velocities(velocity) + np.clip(0.03 * drawn(kind, rng, 2 * PINGS), -5.0, 5.0)
    valid = np.ones((2 * PINGS, 4), dtype=bool)
    lost = np.flatnonzero(rng.random(2 * PINGS) < 0.2)
    valid[lost, rng.integers(0, 4, len(lost))] = False
    (group,) = measure_noise(JANUS, beams[:PINGS], valid[:PINGS], SD).groups
    noise = of_log(PINGS, group.factor, group.degrees)
    time_ns = np.arange(PINGS) * 350_000_000
    beams, valid, velocity = beams[PINGS:], valid[PINGS:], velocity[PINGS:]
    screened = screen_beams(JANUS, time_ns, beams, valid, SD, noise)
    factor, _ = ping_noise(JANUS, beams, SD, noise, screened)
    fixes = solve_scaled(JANUS, beams, screened.valid, factor, method="lc", beam_sd_mps=SD)
    ratio = np.abs(fixes.velocity_p_mps - velocity) / np.sqrt(np.diagonal(fixes.cov_m2ps2, axis1=1, axis2=2))
    ratio = ratio[np.isfinite(ratio).all(axis=1)]
    # The covariance is bounded: no ping that is not itself far off has metres a second.
    sd = np.sqrt(fixes.cov_m2ps2[:, 0, 0])
    assert np.nanmedian(sd) < 0.15
    return [float((ratio <= k).mean()) for k in (1.0, 2.0, 3.0)]


@pytest.mark.parametrize("kind", ["1.5", "2", "3", "contaminated"])
def test_one_covariance_covers_heavy_tails(kind: str) -> None:
    """Mean of four logs; expected are 66 to 71 %, 94 to 97 % and 99 % or more (docs/robust.md has what is measured).

    A log of 1,200 full pings measures the scale within 4 %, which moves the coverage of 1 sigma of four by 1 %.
    Contaminated noise is no Student's t, and 1 sigma covers 65 %; of 1.5 degrees 2 sigma cover 97.5 %.
    """
    one, two, three = np.mean([covered(kind, seed) for seed in range(401, 405)], axis=0)
    assert (0.635 if kind == "contaminated" else 0.65) < one < 0.71
    assert 0.94 < two < 0.98
    assert three > 0.99
