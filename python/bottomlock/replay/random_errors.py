"""Random errors of a replay, each from its own keyed stream: beam noise, errors of a lower-grade IMU, the start."""

import hashlib

import numpy as np
from numpy.typing import NDArray

from bottomlock import units
from bottomlock.config.scenario_sections import ImuErrors
from bottomlock.plant.beam_loss import generator
from bottomlock.recordings.streams import Floats, Inertial

_NOISE, _FORCE, _OMEGA, _START = 0xE1, 0xE2, 0xE3, 0xE4


def case_key(name: str) -> int:
    """Key of a case's random streams: the first 8 bytes of the SHA-256 of its name."""
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "big")


def random_stream(seed: int, key: int, run: int, error: int) -> np.random.Generator:
    """The random numbers of one kind of error in one run."""
    return generator(seed, key, run, error, 0)


def white_beam_noise(shape: tuple[int, int], sd_mps: float, *, seed: int, key: int, run: int) -> Floats:
    """(E, B) white noise, m/s."""
    return np.asarray(random_stream(seed, key, run, _NOISE).standard_normal(shape) * sd_mps)


def resampled_beam_noise(
    shape: tuple[int, int], residuals: Floats, *, seed: int, key: int, run: int
) -> Floats:
    """(E, B) noise, m/s, drawn with replacement from residuals."""
    return np.asarray(random_stream(seed, key, run, _NOISE).choice(residuals, size=shape))


def degraded_imu(inertial: Inertial, errors: ImuErrors, *, seed: int, key: int, run: int) -> Inertial:
    """IMU readings with the constant bias, white noise and bias random walk of a lower-grade IMU added, per axis.

    White noise of density N over a step dt has the standard deviation N/√dt; the walk grows by K√dt a step.

    Source: Tal et al. 2017, Eq. (12), as in the simulated sensors.
    """
    steps_s = np.diff(inertial.time_ns, prepend=2 * inertial.time_ns[0] - inertial.time_ns[1]) * 1e-9
    force = _axis_errors(
        steps_s,
        random_stream(seed, key, run, _FORCE),
        bias_sd=units.mps2_from_mg(errors.accel_bias_mg),
        noise_rts=units.per_rt_s_from_per_rt_h(errors.accel_noise_mps_per_rt_h),
        walk_rts=errors.accel_bias_walk_mps2_per_rt_s,
    )
    omega = _axis_errors(
        steps_s,
        random_stream(seed, key, run, _OMEGA),
        bias_sd=units.radps_from_deg_per_h(errors.gyro_bias_deg_per_h),
        noise_rts=units.rad_from_deg(units.per_rt_s_from_per_rt_h(errors.gyro_noise_deg_per_rt_h)),
        walk_rts=units.rad_from_deg(errors.gyro_bias_walk_deg_per_s_per_rt_s),
    )
    return Inertial(inertial.time_ns, inertial.force_p_mps2 + force, inertial.omega_p_radps + omega)


def _axis_errors(
    steps_s: Floats, draw: np.random.Generator, *, bias_sd: float, noise_rts: float, walk_rts: float
) -> Floats:
    shape = (len(steps_s), 3)
    bias = draw.standard_normal(3) * bias_sd
    noise = draw.standard_normal(shape) * (noise_rts / np.sqrt(steps_s))[:, None]
    walk = np.cumsum(draw.standard_normal(shape) * (walk_rts * np.sqrt(steps_s))[:, None], axis=0)
    return np.asarray(bias + noise + walk)


def start_errors(sds: NDArray[np.float64], *, seed: int, key: int, run: int) -> Floats:
    """(9,) initial errors with these 1 sigma: position_t (m), misalignment_t (rad), velocity_p (m/s)."""
    return np.asarray(random_stream(seed, key, run, _START).standard_normal(9) * sds)
