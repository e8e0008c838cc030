"""Velocity fixes of recorded pings with the noise that the log shows and without the outliers that it identifies."""

import dataclasses
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from bottomlock.kernel import BeamGeometry, FixMethod, VelocityFixes, solve_velocity
from bottomlock.recordings.streams import Flags, Floats, Times
from bottomlock.replay.beam_noise import MOST_DEGREES, BeamNoise, measure_noise, student_halfwidths
from bottomlock.replay.screen_beams import OUTLIER_TESTS, Screened, screen_beams


@dataclass(frozen=True, eq=False)
class RobustFixes:
    """Fixes of a log with the measured noise, the outcome of the test of each ping, and the noise of each ping.

    `factor` (n,) and `halfwidths` (n, 3) are those of `ping_noise`.
    """

    fixes: VelocityFixes
    noise: BeamNoise
    screened: Screened
    factor: Floats
    halfwidths: Floats

    def to_frame(self, time_ns: Times) -> pl.DataFrame:
        """A table with the columns of `VelocityFixes.to_frame`, and the noise and outlier test of each ping.

        `beam_sd_factor` is the noise used over the claimed noise of the beams; the covariances contain it. The
        half-widths of the intervals that a Gaussian covers with 2 and 3 sigma (95.4 and 99.7 %) are in standard
        deviations of the fix.
        """
        return self.fixes.to_frame(time_ns).with_columns(
            pl.Series("outlier_test", [OUTLIER_TESTS[code] for code in self.screened.outcome], pl.String),
            pl.Series("beam_sd_factor", self.factor),
            pl.Series("halfwidth_2sigma_over_sd", self.halfwidths[:, 1]),
            pl.Series("halfwidth_3sigma_over_sd", self.halfwidths[:, 2]),
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
    factor, halfwidths = ping_noise(geometry, velocity_mps, beam_sd_mps, noise, screened)
    fixes = solve_scaled(
        geometry,
        velocity_mps,
        screened.valid,
        factor,
        method=method,
        beam_sd_mps=beam_sd_mps,
        prior_velocity_p_mps=prior_velocity_p_mps,
        prior_cov_m2ps2=prior_cov_m2ps2,
    )
    return RobustFixes(fixes, noise, screened, factor, halfwidths)


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


OF_MEDIAN = 0.4
"""Variance of the median of four pings over that of one, about: the least scatter of a prediction."""
STEP = 0.01
"""Relative step of the noise of a ping: pings of the same noise are solved together."""


def ping_noise(
    geometry: BeamGeometry, velocity_mps: Floats, sd_mps: Floats, noise: BeamNoise, screened: Screened
) -> tuple[Floats, Floats]:
    """Noise (n,) of each ping over the claimed one, and its half-widths (n, 3) over the standard deviation.

    Student's t with ν degrees of freedom and scale s is Gaussian noise whose variance differs from ping to ping (Lange,
    Little & Taylor 1989). A ping whose beams differ by z from the pings around it, with S = B D Bᵀ + s²R, shows
    q = zᵀS⁻¹ s²R S⁻¹z, of which ρ = tr(S⁻¹ s²R) is expected: as many numbers as it has beams where the vehicle is
    steady, as it has redundant beams where nothing is known of its motion. Given q, the noise is Student's t with ν + ρ
    degrees of freedom and the scale s √((ν + q)/(ν + ρ)). Its tail is lighter, so that one covariance serves a filter.

    A ping that no others predict, and a log whose noise is Gaussian or was not measured, keep those of the screening
    and of the log.

    Args:
        geometry: the beams.
        velocity_mps: (n, B) beam velocities.
        sd_mps: (B,) claimed noise of the beams, 1 sigma.
        noise: of the log.
        screened: the pings after the test.
    """
    B = np.asarray(geometry.directions_p)
    factor, halfwidths = screened.factor.copy(), noise.halfwidths.copy()
    judged = np.isfinite(screened.expected_mps).all(axis=1) & (noise.degrees < MOST_DEGREES)
    if not judged.any():
        return factor, halfwidths
    scale = noise.factor / student_halfwidths(noise.degrees)[:, 0]
    # The scatter of passed pings about their prediction holds their own noise as well as the prediction's.
    own = np.diag(np.linalg.inv(B.T @ (B / (scale[judged].min() * sd_mps[:, None]) ** 2)))
    D = np.diag(np.maximum(np.diag(screened.scatter_m2ps2) - own, OF_MEDIAN * own))
    for beams in np.unique(screened.valid[judged], axis=0):
        rows = np.flatnonzero(judged & (screened.valid == beams).all(axis=1))
        if not beams.any():
            continue
        A = B[beams]
        R = scale[rows, None, None] ** 2 * np.diag(sd_mps[beams] ** 2)
        W = np.linalg.inv(A @ D @ A.T + R)
        z = velocity_mps[rows][:, beams] - screened.expected_mps[rows] @ A.T
        weighted = np.einsum("nij,nj->ni", W, z)
        q = np.einsum("ni,nij,nj->n", weighted, R, weighted)
        shown = np.trace(W @ R, axis1=1, axis2=2)
        degrees = noise.degrees[rows] + shown
        quantiles = student_halfwidths(degrees)
        found = scale[rows] * np.sqrt((noise.degrees[rows] + q) / degrees) * quantiles[:, 0]
        factor[rows] = np.exp(STEP * np.round(np.log(found) / STEP))
        halfwidths[rows] = quantiles / quantiles[:, :1]
    return factor, halfwidths
