"""The covariance at every step with averaged samples, against dense steps.

An averaged reading belongs to its own step: with that of the step before at its start, a shaking vehicle's σ is off by
parts in a thousand.
"""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import bottomlock
from tests.oracle import error_model
from tests.oracle.mechanisation import earth_rate_tangent
from tests.oracle.rotations import Array
from tests.property import settings

RATE_HZ, FINE = 150, 16
# Beams 1 and 3 of a Janus: the direction across both stays open on a straight leg.
PAIR = np.array([True, False, True, False])


class Shaken:
    """A straight leg in waves, shaken at 3 Hz, at the fine rate."""

    def __init__(self, seconds: int) -> None:
        dt = 1.0 / (RATE_HZ * FINE)
        t = np.arange(seconds * RATE_HZ * FINE + 1) * dt
        turn = 2 * np.pi * t
        roll = np.deg2rad(8.0 * np.sin(0.2 * turn) + 0.5 * np.sin(3.0 * turn))
        pitch = np.deg2rad(4.0 * np.sin(0.25 * turn) + 0.5 * np.cos(3.1 * turn))
        attitude = Rotation.from_euler("ZYX", np.stack([np.full_like(t, 0.3), pitch, roll], axis=1))
        self.dt, self.rotation = dt, attitude.as_matrix()
        self.quaternion = attitude.as_quat()[0, [3, 0, 1, 2]]
        self.earth = earth_rate_tangent(settings.LATITUDE_RAD)
        self.velocity = np.array([2.0, 0.0, 0.0])
        earth_p = np.einsum("nji,j->ni", self.rotation, self.earth)
        rate = (attitude[:-1].inv() * attitude[1:]).as_rotvec() / dt
        rate = np.vstack([rate[:1], 0.5 * (rate[:-1] + rate[1:]), rate[-1:]])
        self.rate = rate + earth_p
        gravity_p = self.rotation[:, 2, :] * settings.GRAVITY
        self.force = np.cross(rate + 2 * earth_p, self.velocity) - gravity_p

    def averaged(self, values: Array) -> Array:
        """Means over the steps of the slow instrument."""
        steps = (0.5 * (values[:-1] + values[1:])).reshape(-1, FINE, 3)
        return np.asarray(steps.mean(axis=1))


def initial_covariance() -> Array:
    """P at the start, as a textbook lays it out."""
    model = settings.table_2()
    initial, imu, dvl = model["initial"], model["imu"], model["dvl"]
    sd = np.concatenate(
        [
            initial["position_sd_m"], initial["attitude_sd_rad"], initial["velocity_sd_mps"],
            [imu["accel_bias_sd_mps2"]] * 3, [imu["gyro_bias_sd_radps"]] * 3,
            [dvl["beam_bias_sd_mps"]] * 4, [dvl["scale_factor_sd"]],
        ]
    )  # fmt: skip
    return np.diag(np.square(sd))


def oracle_sd(
    motion: Shaken, rows: Array | None, *, order: int, every: int, rate: tuple[Array, Array]
) -> Array:
    """σ at the end by dense steps of `every` fine ones, to first or second order; `rows` are a ping's, each second.

    `rate` has those at the start and at the end of each step; F is the mean of its ends, as the paper's Φ has it.
    """
    P, Q = initial_covariance(), error_model.noise_density(*settings.noise_densities(settings.table_2()))
    gravity, dt = np.array([0.0, 0.0, settings.GRAVITY]), motion.dt * every
    noise = settings.table_2()["dvl"]["beam_noise_sd_mps"] ** 2

    def f(k: int, own_rate: Array) -> Array:
        return error_model.f_full(motion.rotation[k], motion.velocity, own_rate, gravity, motion.earth)

    for step in range(len(rate[0])):
        first, last = step * every, (step + 1) * every
        F = 0.5 * dt * (f(first, rate[0][step]) + f(last, rate[1][step]))
        Phi = np.eye(20) + F + (0.5 * F @ F if order == 2 else 0.0)
        G = error_model.g_full(0.5 * (motion.rotation[first] + motion.rotation[last]), motion.velocity)
        half = G @ Q @ G.T * (0.5 * dt)
        P = Phi @ (P + half) @ Phi.T + half
        if rows is not None and last % (RATE_HZ * FINE) == 0:
            S = rows @ P @ rows.T + np.eye(len(rows)) * noise
            P = P - P @ rows.T @ np.linalg.solve(S, rows @ P)
            P = 0.5 * (P + P.T)
    return np.asarray(np.sqrt(np.diag(P)))


def filter_sd(motion: Shaken, beams: Array | None, period_ns: int) -> Array:
    """σ at the end by the product, fed with averaged samples and perfect pings."""
    geometry = bottomlock.BeamGeometry.janus(0.35)
    start: Any = settings.start(velocity=motion.velocity, attitude=motion.quaternion)
    options = settings.options(covariance_period_ns=period_ns, imu_sampling="averaged")
    navigator = bottomlock.Navigator(geometry, settings.table_2(), options, start, method="tc")
    rate, force = motion.averaged(motion.rate), motion.averaged(motion.force)
    time_ns = np.round(np.arange(1, len(rate) + 1) * 1e9 / RATE_HZ).astype(np.int64)
    reading = geometry.beam_velocities(motion.velocity[None])[0]
    for first in range(0, len(rate), RATE_HZ):
        block = slice(first, first + RATE_HZ)
        navigator.push_imu_block(time_ns[block], omega_p_radps=rate[block], force_p_mps2=force[block])
        if beams is not None:
            sd = np.full(4, settings.table_2()["dvl"]["beam_noise_sd_mps"])
            navigator.push_beams(int(time_ns[block][-1]), reading, beams, sd_mps=sd)
    return np.asarray(np.sqrt(np.diag(navigator.covariance())))


def rows_of(motion: Shaken, beams: Array) -> Array:
    """H of a ping: velocity, beam biases, scale factor."""
    directions = bottomlock.BeamGeometry.janus(0.35).directions_p
    H = np.zeros((4, 20))
    H[:, error_model.V], H[:, error_model.BDVL] = directions, np.eye(4)
    H[:, 19] = directions @ motion.velocity
    return H[beams]


@pytest.mark.first_cases(1)
@pytest.mark.parametrize("beams", [None, PAIR])
def test_every_step_takes_its_own_reading(beams: Array | None) -> None:
    """First order at every step is the dense first order; the reading of the step before is off by parts in a thousand.

    Second order at every step is what steps sixteen times finer give.
    """
    motion = Shaken(5)
    rows = None if beams is None else rows_of(motion, beams)
    own = motion.averaged(motion.rate)
    first = oracle_sd(motion, rows, order=1, every=FINE, rate=(own, own))
    fine = oracle_sd(motion, rows, order=2, every=1, rate=(motion.rate[:-1], motion.rate[1:]))
    for period_ns, expected in ((0, first), (1, fine)):
        off = np.abs(filter_sd(motion, beams, period_ns) / expected - 1)
        assert off.max() < 1e-5, (period_ns, off)
    stale = np.vstack([own[:1], own[:-1]])
    assert np.abs(oracle_sd(motion, rows, order=1, every=FINE, rate=(stale, own)) / first - 1).max() > 1e-4
