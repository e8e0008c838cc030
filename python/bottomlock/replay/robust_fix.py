"""Velocity fixes of recorded pings with the noise that the log shows, without the outliers that it identifies.

Outliers are found by the closure and identified by the pings around. A ping with more beams than unknowns is tested:
(Nᵀy)ᵀ(NᵀR N)⁻¹(Nᵀy) is chi-squared with as many degrees of freedom as there are redundant beams, N the left null
space of the valid beams. Four beams alone cannot identify the outlier, so the velocity of the pings around it
predicts the beams. With z = y − B v and S = B D Bᵀ + R, leaving beam i out reduces zᵀS⁻¹z by w_i² =
(S⁻¹z)_i²/(S⁻¹)_ii (Baarda 1968). The largest is rejected where it stands out from the second, and the rest is tested
again. Otherwise no beam is rejected and the noise of all beams is scaled by the closure. The scale of both tests is
the measured noise of good pings, that of the least noisy group.

These are the tests of the filter (`crates/bottomlock/src/aiding/outliers.rs`) with pings in place of the INS.
"""

import dataclasses
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.stats import chi2

from bottomlock.kernel import STATUS, BeamGeometry, FixMethod, VelocityFixes, solve_velocity
from bottomlock.recordings.closure import closure_rows
from bottomlock.recordings.robust import sd_about_zero
from bottomlock.recordings.streams import Flags, Floats, Times
from bottomlock.replay.beam_noise import BeamNoise, measure_noise

GATE = 0.9973
"""Probability with which a good ping passes, if the noise is Gaussian at its measured scale."""
STANDS_OUT = 2.0 * np.log(20.0)
"""Least w² of the outlier above that of any other beam: odds of 20 to 1."""
AROUND = 2
"""Number of pings before and after that predict a ping's velocity."""
AROUND_S = 5.0
"""Longest time from a ping to one that predicts it."""
FEWEST_PASSED = 20
"""Fewest passed pings from which the scatter of the prediction is taken."""

OUTLIER_TESTS = ("untested", "passed", "beam_rejected", "down_weighted")
"""Outcome of a ping's test for outliers: without redundant beams, passed, the outlier identified and rejected, or a
closure beyond its gate of which no beam could be identified as the cause."""
UNTESTED, PASSED, REJECTED, DOWN_WEIGHTED = range(len(OUTLIER_TESTS))


@dataclass(frozen=True, eq=False)
class Screened:
    """Pings after the test.

    Attributes:
        valid: (n, B) validity without rejected beams.
        factor: (n,) noise over the claimed noise; above that of the log in down-weighted pings.
        outcome: (n,) index into `OUTLIER_TESTS`.
    """

    valid: Flags
    factor: Floats
    outcome: Times


def screen_beams(
    geometry: BeamGeometry,
    time_ns: Times,
    velocity_mps: Floats,
    valid: Flags,
    sd_mps: Floats,
    noise: BeamNoise,
) -> Screened:
    """Tests every ping with redundant beams; `sd_mps` (B,) is the claimed noise."""
    B = np.asarray(geometry.directions_p)
    kept, factor = valid.copy(), noise.factor.copy()
    sd = sd_mps * noise.factor.min(initial=np.inf)
    statistic, degrees = closure_statistic(B, velocity_mps, kept, sd)
    passes = statistic <= chi2.ppf(GATE, np.maximum(degrees, 1))
    outcome = np.where(degrees == 0, UNTESTED, np.where(passes, PASSED, DOWN_WEIGHTED)).astype(np.int64)
    expected, D = _from_pings_around(geometry, time_ns, velocity_mps, valid, outcome, sd_mps)
    for k in np.flatnonzero(outcome == DOWN_WEIGHTED):
        rows = valid[k].copy()
        while True:
            q, left = _closure(B[rows], velocity_mps[k, rows], sd[rows])
            if left == 0 or q <= chi2.ppf(GATE, left):
                kept[k], outcome[k] = rows, REJECTED
                break
            beams = np.flatnonzero(rows)
            z = velocity_mps[k, beams] - B[beams] @ expected[k]
            worst = outlier_of(B[beams], z, D, sd[beams])
            if worst is None:
                factor[k] = max(factor[k], noise.factor.min() * float(np.sqrt(statistic[k] / degrees[k])))
                break
            rows[beams[worst]] = False
    return Screened(kept, factor, outcome)


def outlier_of(B: Floats, z: Floats, D: Floats, sd_mps: Floats) -> int | None:
    """Index of the beam with the largest w², or None where it does not stand out or nothing was predicted.

    Args:
        B: (m, 3) directions.
        z: (m,) readings minus prediction; NaN without a prediction.
        D: (3, 3) covariance of the prediction.
        sd_mps: (m,) noise of the beams.
    """
    if not np.isfinite(z).all():
        return None
    weight = np.linalg.inv(B @ D @ B.T + np.diag(sd_mps**2))
    w2 = (weight @ z) ** 2 / np.diag(weight)
    second, first = np.sort(w2)[-2:]
    stands_out = first > chi2.ppf(GATE, 1) and first - second > STANDS_OUT
    return int(np.argmax(w2)) if stands_out else None


def closure_statistic(B: Floats, velocity_mps: Floats, valid: Flags, sd_mps: Floats) -> tuple[Floats, Times]:
    """Closure test statistic (n,) of the valid beams with noise `sd_mps` (B,), and its degrees of freedom (n,)."""
    statistic, degrees = np.zeros(len(valid)), np.zeros(len(valid), dtype=np.int64)
    for rows in np.unique(valid, axis=0):
        same = (valid == rows).all(axis=1)
        statistic[same], degrees[same] = _closure(B[rows], velocity_mps[same][:, rows], sd_mps[rows])
    return statistic, degrees


def _closure(B: Floats, y: Floats, sd_mps: Floats) -> tuple[Floats, int]:
    """Statistic of readings y (..., m) along directions B (m, 3), and its degrees of freedom."""
    if not len(B):
        return np.zeros(y.shape[:-1]), 0
    N = closure_rows(B).T
    residual = y @ N
    weighted = residual @ np.linalg.inv(N.T @ (N * sd_mps[:, None] ** 2)) if N.shape[1] else residual
    return np.asarray((residual * weighted).sum(axis=-1)), N.shape[1]


def _from_pings_around(
    geometry: BeamGeometry, time_ns: Times, velocity_mps: Floats, valid: Flags, outcome: Times, sd_mps: Floats
) -> tuple[Floats, Floats]:
    """Velocity (n, 3) as the median of passed pings before and after, NaN without any, and its scatter (3, 3).

    The scatter is that of passed pings about their own prediction: how far the vehicle's velocity changes meanwhile.
    """
    fixes = solve_velocity(geometry, velocity_mps, valid, method="lc", beam_sd_mps=sd_mps)
    passed = np.flatnonzero((outcome == PASSED) & (fixes.status == STATUS.index("fix")))
    expected = np.full((len(time_ns), 3), np.nan)
    if len(passed) < FEWEST_PASSED:
        return expected, np.eye(3)
    place = np.searchsorted(passed, np.arange(len(time_ns)))
    itself = np.isin(np.arange(len(time_ns)), passed)
    near = []
    for step in range(-AROUND, AROUND):
        at = place + step + (itself & (step >= 0))
        there = passed[np.clip(at, 0, len(passed) - 1)]
        apart_s = np.abs(time_ns[there] - time_ns) * 1e-9
        usable = (at >= 0) & (at < len(passed)) & (apart_s <= AROUND_S)
        near.append(np.where(usable[:, None], fixes.velocity_p_mps[there], np.nan))
    some = np.isfinite(near).any(axis=(0, 2))
    expected[some] = np.nanmedian(np.array(near)[:, some], axis=0)
    change = fixes.velocity_p_mps[passed] - expected[passed]
    change = change[np.isfinite(change).all(axis=1)]
    if len(change) < FEWEST_PASSED:
        return np.full_like(expected, np.nan), np.eye(3)
    return expected, np.diag(sd_about_zero(change, axis=0) ** 2 + 1e-12)


@dataclass(frozen=True, eq=False)
class RobustFixes:
    """Fixes of a log with the measured noise, and the outcome of the test of each ping."""

    fixes: VelocityFixes
    noise: BeamNoise
    screened: Screened

    def to_frame(self, time_ns: Times) -> pl.DataFrame:
        """A table with the columns of `VelocityFixes.to_frame`, the noise of the log and the outlier test of each ping.

        `beam_sd_factor` is the noise used over the claimed noise of the beams; the covariances contain it. The
        half-widths of the intervals that a Gaussian covers with 2 and 3 sigma (95.4 and 99.7 %) are in standard
        deviations of the fix.
        """
        return self.fixes.to_frame(time_ns).with_columns(
            pl.Series("outlier_test", [OUTLIER_TESTS[code] for code in self.screened.outcome], pl.String),
            pl.Series("beam_sd_factor", self.screened.factor),
            pl.Series("halfwidth_2sigma_over_sd", self.noise.halfwidths[:, 1]),
            pl.Series("halfwidth_3sigma_over_sd", self.noise.halfwidths[:, 2]),
        )


def solve_robust(
    geometry: BeamGeometry,
    time_ns: Times,
    velocity_mps: Floats,
    valid: Flags,
    *,
    method: FixMethod,
    beam_sd_mps: Floats,
    instrument_valid: NDArray[np.bool_] | None = None,
    prior_velocity_p_mps: Floats | None = None,
    prior_cov_m2ps2: Floats | None = None,
) -> RobustFixes:
    """Fixes by `kernel.solve_velocity` of the screened beams, with the noise measured on the closure of the log.

    Args:
        geometry: the beams.
        time_ns: (n,) rising times of the pings.
        velocity_mps: (n, B) beam velocities.
        valid: (n, B) validity.
        method: as for `solve_velocity`.
        beam_sd_mps: (B,) claimed noise of the beams, 1 sigma.
        instrument_valid: (n,) the instrument's own flag of its velocity.
        prior_velocity_p_mps: (n, 3) as for `solve_velocity`.
        prior_cov_m2ps2: (n, 3, 3) its covariance.
    """
    noise = measure_noise(geometry, velocity_mps, valid, beam_sd_mps, instrument_valid)
    screened = screen_beams(geometry, time_ns, velocity_mps, valid, beam_sd_mps, noise)
    fixes = solve_scaled(
        geometry,
        velocity_mps,
        screened.valid,
        screened.factor,
        method=method,
        beam_sd_mps=beam_sd_mps,
        prior_velocity_p_mps=prior_velocity_p_mps,
        prior_cov_m2ps2=prior_cov_m2ps2,
    )
    return RobustFixes(fixes, noise, screened)


def solve_scaled(
    geometry: BeamGeometry,
    velocity_mps: Floats,
    valid: Flags,
    factor: Floats,
    *,
    method: FixMethod,
    beam_sd_mps: Floats,
    prior_velocity_p_mps: Floats | None = None,
    prior_cov_m2ps2: Floats | None = None,
) -> VelocityFixes:
    """`kernel.solve_velocity` with the noise of each ping multiplied by `factor` (n,).

    The noise is scaled before the solution: a prior or an assumption keeps its own covariance.
    """
    values, group = np.unique(factor, return_inverse=True)
    same = [np.flatnonzero(group == k) for k in range(len(values))]
    parts = [
        solve_velocity(
            geometry,
            velocity_mps[rows],
            valid[rows],
            method=method,
            beam_sd_mps=beam_sd_mps * value,
            prior_velocity_p_mps=None if prior_velocity_p_mps is None else prior_velocity_p_mps[rows],
            prior_cov_m2ps2=None if prior_cov_m2ps2 is None else prior_cov_m2ps2[rows],
        )
        for rows, value in zip(same, values, strict=True)
    ]
    back = np.argsort(np.concatenate(same), kind="stable")
    names = [entry.name for entry in dataclasses.fields(VelocityFixes)]
    return VelocityFixes(
        **{name: np.concatenate([getattr(part, name) for part in parts])[back] for name in names}
    )
