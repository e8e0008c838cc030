"""The linear model of the errors over a stretch: transition and noise in additive errors."""

import numpy as np
from numpy.typing import NDArray

from benches.rivals import rotations
from benches.rivals.state import ACCEL_BIAS, GYRO_BIAS, MISALIGNMENT, POSITION, VELOCITY, Layout
from benches.rivals.strapdown import Earth, Increment
from bottomlock.kernel.models import DepthModel, DvlModel, HeadingModel, Model

Floats = NDArray[np.float64]


def transition(layout: Layout, increment: Increment, duration_s: float, earth: Earth, model: Model) -> Floats:
    """Φ (n, n) over a stretch, along the motion that was estimated.

    δv̇ = −[R f ×] ρ − R δb_a − 2 ω_ie × δv, ρ̇ = −ω_ie × ρ − R δb_g, δṗ = δv. The integrals of R f are the strapdown's
    own, so that in right-invariant errors Φ does not depend on the motion but for the columns of the biases.
    """
    phi = np.eye(layout.size)
    turn = rotations.skew(earth.rate_t_radps)
    gained, moved = rotations.skew(increment.velocity_t_mps), rotations.skew(increment.position_t_m)
    rotation_s = increment.rotation_s
    phi[MISALIGNMENT, MISALIGNMENT] = rotations.exp(-duration_s * earth.rate_t_radps)
    phi[MISALIGNMENT, GYRO_BIAS] = -rotation_s
    phi[VELOCITY, VELOCITY] -= 2.0 * duration_s * turn
    phi[VELOCITY, MISALIGNMENT] = -gained
    phi[VELOCITY, ACCEL_BIAS] = -rotation_s
    # A gyro bias tilts in proportion to the time: half of the tilt at the end, on average over an even force.
    phi[VELOCITY, GYRO_BIAS] = 0.5 * gained @ rotation_s
    phi[POSITION, VELOCITY] = duration_s * np.eye(3)
    phi[POSITION, MISALIGNMENT] = -moved
    phi[POSITION, ACCEL_BIAS] = -0.5 * duration_s * rotation_s
    phi[POSITION, GYRO_BIAS] = moved @ rotation_s / 3.0
    if model.of(DepthModel).bias_sd_m > 0.0:
        phi[layout.depth_bias, layout.depth_bias] = np.exp(-duration_s / model.of(DepthModel).bias_time_s)
    if layout.slow_heading:
        walk = layout.heading.stop - 1
        phi[walk, walk] = np.exp(-duration_s / model.of(HeadingModel).walk_time_s)
    return phi


def noise(layout: Layout, phi: Floats, duration_s: float, model: Model) -> Floats:
    """Q (n, n) over a stretch, half of it before and half after the transition."""
    imu, dvl = model.imu, model.of(DvlModel)
    density = np.zeros(layout.size)
    density[MISALIGNMENT], density[VELOCITY] = imu.gyro_noise_rad_rts**2, imu.accel_noise_mps_rts**2
    density[ACCEL_BIAS] = imu.accel_bias_walk_mps2_rts**2
    density[GYRO_BIAS] = imu.gyro_bias_walk_radps_rts**2
    density[layout.beam_bias] = dvl.beam_bias_walk_mps_rts**2
    density[layout.scale_factor] = dvl.scale_factor_walk_rts**2
    if model.of(DepthModel).bias_sd_m > 0.0:
        density[layout.depth_bias] = (
            2.0 * model.of(DepthModel).bias_sd_m ** 2 / model.of(DepthModel).bias_time_s
        )
    if layout.slow_heading:
        heading = model.of(HeadingModel)
        density[layout.heading.stop - 1] = 2.0 * heading.walk_sd_rad**2 / heading.walk_time_s
    even: Floats = np.diag(0.5 * duration_s * density)
    out: Floats = phi @ even @ phi.T + even
    return out
