"""Analytic motions with exact derivatives, and the truth sampled from them.

A motion gives Euler angles and platform velocity as functions of time, with their exact first derivatives. Angular rate
and specific force follow from the mechanisation equations, position from Gauss-Legendre quadrature of R v, exact to
rounding. A perfect IMU, integrated by the strapdown step, therefore returns the motion.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bottomlock.config.scenario import EARTH_RATE_RADPS, Scenario, load_scenario
from bottomlock.config.trajectory import Trajectory
from bottomlock.errors import DataError
from bottomlock.truth import Array, Truth, sample_times_ns


@dataclass(frozen=True)
class Attitudes:
    """Euler angles and body velocity with their first time derivatives, each (n,) or (n, 3)."""

    roll_rad: Array
    pitch_rad: Array
    yaw_rad: Array
    roll_rate: Array
    pitch_rate: Array
    yaw_rate: Array
    velocity_p_mps: Array
    acceleration_p_mps2: Array


Motion = Callable[[Array], Attitudes]


def smootherstep(x: Array) -> tuple[Array, Array, Array, Array]:
    """Integral, value, slope and curvature of a rise from 0 to 1 over x in [0, 1], three derivatives zero at its ends.

    >>> [abs(float(part)) for part in smootherstep(np.array(1.0))]
    [0.5, 1.0, 0.0, 0.0]
    """
    y = np.clip(x, 0.0, 1.0)
    value = y**4 * (35.0 - 84.0 * y + 70.0 * y**2 - 20.0 * y**3)
    slope = 140.0 * y**3 * (1.0 - y) ** 3
    curvature = 420.0 * y**2 * (1.0 - y) ** 2 * (1.0 - 2.0 * y)
    integral = y**5 * (7.0 - 14.0 * y + 10.0 * y**2 - 2.5 * y**3) + np.maximum(x - 1.0, 0.0)
    return integral, value, slope, curvature


@dataclass(frozen=True)
class Profile:
    """A sum of smooth changes: each `(start_s, length_s, size)` adds `size` between its start and its end."""

    changes: tuple[tuple[float, float, float], ...]
    base: float = 0.0

    def __call__(self, time_s: Array) -> tuple[Array, Array, Array, Array]:
        """Integral from 0, value, first and second derivative."""
        integral, value = self.base * time_s, np.full_like(time_s, self.base)
        slope, curvature = np.zeros_like(time_s), np.zeros_like(time_s)
        for start, length, size in self.changes:
            parts = smootherstep((time_s - start) / length)
            integral = integral + size * length * parts[0]
            value = value + size * parts[1]
            slope = slope + size / length * parts[2]
            curvature = curvature + size / length**2 * parts[3]
        return integral, value, slope, curvature


def _motion(settings: Trajectory, *, yaw_rate: Profile, pitch: Profile) -> Motion:
    """Level wings, constant speed through the water; sway = -gain * yaw rate, surge makes up the rest of the speed."""
    gain, speed, heading = settings.sway_gain_m, settings.speed_mps, math.radians(settings.heading_deg)

    def motion(time_s: Array) -> Attitudes:
        turned, rate, rate_slope, _ = yaw_rate(time_s)
        _, theta, theta_rate, _ = pitch(time_s)
        sway, sway_slope = -gain * rate, -gain * rate_slope
        surge = np.sqrt(speed**2 - sway**2)
        zero = np.zeros_like(time_s)
        return Attitudes(
            roll_rad=zero, pitch_rad=theta, yaw_rad=heading + turned,
            roll_rate=zero, pitch_rate=theta_rate, yaw_rate=rate,
            velocity_p_mps=np.stack([surge, sway, zero], axis=-1),
            acceleration_p_mps2=np.stack([-sway * sway_slope / surge, sway_slope, zero], axis=-1),
        )  # fmt: skip

    return motion


_BLEND_S = 5.0
"""Length of a change of turn or pitch, s: what a 3 m vehicle at 2 m/s needs."""


def _straight(settings: Trajectory) -> Motion:
    return _motion(settings, yaw_rate=Profile(()), pitch=Profile(()))


def _constant_turn(settings: Trajectory) -> Motion:
    rate = math.radians(settings.yaw_rate_deg_per_s)
    return _motion(settings, yaw_rate=Profile((), base=rate), pitch=Profile(()))


def _figure_eight(settings: Trajectory) -> Motion:
    """One whole circle to starboard, one to port; the reversal is centred between them."""
    half = settings.duration_s / 2.0
    rate = 2.0 * math.pi / half
    yaw_rate = Profile(((half - _BLEND_S, 2.0 * _BLEND_S, -2.0 * rate),), base=rate)
    return _motion(
        settings, yaw_rate=yaw_rate, pitch=Profile((), base=-math.radians(settings.dive_angle_deg))
    )


def _lawn_mower(settings: Trajectory) -> Motion:
    dive = math.radians(settings.dive_angle_deg)
    pitch = (
        Profile(((settings.dive_s - _BLEND_S, _BLEND_S, dive),), base=-dive) if dive > 0.0 else Profile(())
    )
    changes = []
    start, sense = settings.dive_s + settings.leg_s, 1.0
    # The rate is full between the blends, so that a half turn takes its time less one blend at the full rate.
    rate = math.pi / (settings.turn_s - _BLEND_S)
    while start < settings.duration_s:
        changes.append((start, _BLEND_S, sense * rate))
        changes.append((start + settings.turn_s - _BLEND_S, _BLEND_S, -sense * rate))
        start, sense = start + settings.turn_s + settings.leg_s, -sense
    return _motion(settings, yaw_rate=Profile(tuple(changes)), pitch=pitch)


_MOTIONS = {
    "straight": _straight,
    "constant_turn": _constant_turn,
    "figure_eight": _figure_eight,
    "lawn_mower": _lawn_mower,
}


def analytic_motion(settings: Trajectory) -> Motion:
    """The motion of a trajectory section as a function of time in seconds.

    Raises:
        DataError: for waypoints, and for a motion that is not possible: a half turn shorter than its blends, or
            sideslip as large as the speed.
    """
    if settings.kind not in _MOTIONS:
        raise DataError(
            f"trajectory.kind '{settings.kind}' has no analytic motion: set trajectory.source = 'vehicle'"
        )
    if settings.kind == "lawn_mower" and settings.turn_s <= 2.0 * _BLEND_S:
        raise DataError(
            f"is {settings.turn_s} s", key="trajectory.turn_s", expected=f"more than {2.0 * _BLEND_S} s"
        )
    if settings.kind == "lawn_mower" and settings.dive_angle_deg > 0.0 and settings.dive_s < _BLEND_S:
        raise DataError(
            f"is {settings.dive_s} s", key="trajectory.dive_s", expected=f"at least {_BLEND_S} s for a dive"
        )
    motion = _MOTIONS[settings.kind](settings)
    with np.errstate(invalid="ignore"):
        probe = motion(np.linspace(0.0, settings.duration_s, 1001))
    if (
        not np.isfinite(probe.velocity_p_mps).all()
        or (probe.velocity_p_mps[:, 0] < 0.1 * settings.speed_mps).any()
    ):
        raise DataError(
            "trajectory.sway_gain_m times the yaw rate is as large as trajectory.speed_mps: the motion is not possible"
        )
    return motion


def rotation_t_p(state: Attitudes) -> Rotation:
    """Platform to tangent; as `Rotation.from_euler("ZYX", …)`, which takes six times as long."""
    (sr, cr), (sp, cp), (sy, cy) = (
        (np.sin(0.5 * angle), np.cos(0.5 * angle))
        for angle in (state.roll_rad, state.pitch_rad, state.yaw_rad)
    )
    x, y = sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy
    z, w = cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy
    return Rotation.from_quat(np.stack([x, y, z, w], axis=-1))


def rate_tp(roll_rad: Array, pitch_rad: Array, roll_rate: Array, pitch_rate: Array, yaw_rate: Array) -> Array:
    """(n, 3) angular rate of the platform against the tangent frame, platform frame, rad/s."""
    sin_roll, cos_roll = np.sin(roll_rad), np.cos(roll_rad)
    sin_pitch, cos_pitch = np.sin(pitch_rad), np.cos(pitch_rad)
    return np.stack(
        [
            roll_rate - yaw_rate * sin_pitch,
            pitch_rate * cos_roll + yaw_rate * sin_roll * cos_pitch,
            -pitch_rate * sin_roll + yaw_rate * cos_roll * cos_pitch,
        ],
        axis=-1,
    )


def ideal_inertial_readings(
    state: Attitudes, *, latitude_rad: float, gravity_mps2: float, earth_rate_radps: float
) -> tuple[Array, Array]:
    """Perfect gyro and accelerometer readings of a motion, each (n, 3), platform frame.

    omega_ip = omega_tp + R' omega_ie;  f = dv/dt + (omega_ip + R' omega_ie) x v - R' g.
    """
    to_platform = rotation_t_p(state).inv()
    earth_t = earth_rate_radps * np.array([math.cos(latitude_rad), 0.0, -math.sin(latitude_rad)])
    earth_p = to_platform.apply(earth_t)
    omega_tp = rate_tp(state.roll_rad, state.pitch_rad, state.roll_rate, state.pitch_rate, state.yaw_rate)
    omega_ip = omega_tp + earth_p
    gravity_p = to_platform.apply(np.array([0.0, 0.0, gravity_mps2]))
    force = state.acceleration_p_mps2 + np.cross(omega_ip + earth_p, state.velocity_p_mps) - gravity_p
    return omega_ip, force


def analytic_truth(scenario: Scenario | str | Path, gravity_mps2: float) -> Truth:
    """The analytic truth of a scenario, a packaged name or a file at its IMU rate.

    Raises:
        ScenarioError: as `load_scenario`.
        DataError: if the motion is not possible or the duration holds fewer than two samples.

    Examples:
        >>> truth = analytic_truth("straight", 9.795)
        >>> truth.position_t_m[-1].round(6).tolist()
        [500.0, 0.0, 0.0]
    """
    scenario = load_scenario(scenario)
    motion = analytic_motion(scenario.trajectory)
    time_ns = sample_times_ns(scenario.trajectory.duration_s, scenario.imu.rate_hz)
    if len(time_ns) < 2:
        raise DataError("is shorter than one IMU interval", key="trajectory.duration_s")
    return sample_motion(
        motion,
        time_ns,
        latitude_rad=math.radians(scenario.environment.latitude_deg),
        gravity_mps2=gravity_mps2,
        earth_rate_radps=EARTH_RATE_RADPS if scenario.environment.earth_rotation else 0.0,
        depth_m=scenario.environment.depth_m,
    )


def sample_motion(
    motion: Motion,
    time_ns: NDArray[np.int64],
    *,
    latitude_rad: float,
    gravity_mps2: float,
    earth_rate_radps: float,
    depth_m: float = 0.0,
) -> Truth:
    """The truth of a motion at given times (n,), int64 and rising; it starts at the origin, at `depth_m`.

    Raises:
        DataError: for fewer than two times, times that do not rise, and a motion that is not finite.

    Examples:
        >>> def drift(t):
        ...     zero, still = np.zeros_like(t), np.zeros((len(t), 3))
        ...     return Attitudes(zero, zero, zero, zero, zero, zero, still + [1.0, 0.0, 0.0], still)
        >>> truth = sample_motion(
        ...     drift, np.array([0, 10**9]), latitude_rad=0.0, gravity_mps2=9.8, earth_rate_radps=0.0
        ... )
        >>> truth.position_t_m[-1].round(9).tolist()
        [1.0, 0.0, 0.0]
    """
    time_s = np.asarray(time_ns * 1e-9, np.float64)
    state = motion(time_s)
    omega, force = ideal_inertial_readings(
        state, latitude_rad=latitude_rad, gravity_mps2=gravity_mps2, earth_rate_radps=earth_rate_radps
    )
    # Four Gauss-Legendre nodes a step leave far less than rounding.
    nodes, weights = np.polynomial.legendre.leggauss(4)
    steps = np.diff(time_s)
    moved = np.zeros((len(steps), 3))
    for node, weight in zip(nodes.tolist(), weights.tolist(), strict=True):
        inner = motion(time_s[:-1] + 0.5 * steps * (1.0 + node))
        moved += 0.5 * weight * steps[:, None] * rotation_t_p(inner).apply(inner.velocity_p_mps)
    position = np.vstack([np.zeros(3), np.cumsum(moved, axis=0)])
    position[:, 2] += depth_m
    return Truth(
        time_ns=time_ns,
        position_t_m=position,
        attitude_t_p=np.ascontiguousarray(rotation_t_p(state).as_quat()[:, [3, 0, 1, 2]]),
        velocity_p_mps=np.ascontiguousarray(state.velocity_p_mps),
        omega_p_radps=np.ascontiguousarray(omega),
        force_p_mps2=np.ascontiguousarray(force),
        latitude_rad=latitude_rad,
        gravity_mps2=gravity_mps2,
    )
