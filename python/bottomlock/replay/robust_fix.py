"""Velocity fixes of recorded pings with the noise that the log shows and without the outliers that it identifies."""

import dataclasses
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from bottomlock.kernel import BeamGeometry, FixMethod, VelocityFixes, solve_velocity
from bottomlock.recordings.streams import Flags, Floats, Times
from bottomlock.replay.beam_noise import BeamNoise, measure_noise
from bottomlock.replay.ping_scale import ping_noise
from bottomlock.replay.screen_beams import Screened, screen_beams
from bottomlock.tables.fixes import OUTLIER_TESTS


@dataclass(frozen=True, eq=False)
class RobustFixes:
    """Fixes of a log with the measured noise, the outcome of the test of each ping, and the noise of each ping.

    `factor` (n,) and `halfwidths` (n, 3) are those of `replay.ping_scale`.
    """

    fixes: VelocityFixes
    noise: BeamNoise
    screened: Screened
    factor: Floats
    halfwidths: Floats

    def to_frame(self, time_ns: Times) -> pl.DataFrame:
        """A table with the columns of `tables.fixes.fixes_schema`, and the noise and outlier test of each ping.

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
