"""Models of the receivers: a small Kalman filter, fed by the bytes of a port as each receiver decodes and uses them.

The filter estimates the velocity (3) and the bias of its own accelerometers (3) in platform axes; the accelerometers
are its own, so that its errors and ours are independent. What it does with a message is what the sources named in
docs/ports.md say; decoders are pymavlink, rosbags and a struct of the tests, never the package's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bottomlock.io import ros as ros_reader
from tests.ports.cases import mavlink, mip

Floats = NDArray[np.float64]

STEP_S = 0.2
ACCEL_NOISE, BIAS_SD, BIAS_WALK, VELOCITY_SD = 0.02, 0.005, 0.0005, 0.5

TRANSITION = np.block([[np.eye(3), -STEP_S * np.eye(3)], [np.zeros((3, 3)), np.eye(3)]])
PROCESS = np.diag([(ACCEL_NOISE * STEP_S) ** 2] * 3 + [BIAS_WALK**2] * 3)


@dataclass(frozen=True)
class Reading:
    """What a receiver makes of a message: velocity and covariance of some axes."""

    velocity: Floats
    covariance: Floats
    axes: tuple[int, ...] = (0, 1, 2)


@dataclass
class Receiver:
    """The filter: predict with an accelerometer reading, update with a reading."""

    velocity: Floats
    covariance: Floats = field(default_factory=lambda: np.diag([VELOCITY_SD**2] * 3 + [BIAS_SD**2] * 3))
    bias: Floats = field(default_factory=lambda: np.zeros(3))

    def predict(self, accel: Floats) -> None:
        """A step with an accelerometer reading."""
        self.velocity = self.velocity + STEP_S * (accel - self.bias)
        self.covariance = TRANSITION @ self.covariance @ TRANSITION.T + PROCESS

    def innovation(self, reading: Reading) -> tuple[Floats, Floats]:
        """Residual of a reading and its covariance."""
        rows = list(reading.axes)
        residual = reading.velocity - self.velocity[rows]
        return residual, self.covariance[np.ix_(rows, rows)] + reading.covariance

    def update(self, reading: Reading) -> None:
        """Fuses a reading (Joseph form)."""
        residual, spread = self.innovation(reading)
        rows = np.eye(6)[list(reading.axes)]
        gain = self.covariance @ rows.T @ np.linalg.inv(spread)
        change = gain @ residual
        self.velocity, self.bias = self.velocity + change[:3], self.bias + change[3:]
        keep = np.eye(6) - gain @ rows
        self.covariance = keep @ self.covariance @ keep.T + gain @ reading.covariance @ gain.T


# Parameters of the modelled autopilots: floors far below what is sent, so that the port decides and not the floor.
MIN_NOISE, MAX_NOISE = 0.001, 20.0
EVV_NOISE = 0.001


def ardupilot_delta(data: bytes) -> Reading:
    """NavEKF3_core::writeBodyFrameOdom: velocity = delta / time, one σ of the confidence."""
    message = mavlink(data)
    sd = MIN_NOISE + (MAX_NOISE - MIN_NOISE) * (1.0 - 0.01 * message.confidence)
    return Reading(np.array(message.position_delta) / (message.time_delta_usec * 1e-6), np.eye(3) * sd**2)


def ardupilot_speed(data: bytes) -> Reading:
    """External navigation: one σ of the covariance; here the least that a receiver makes of it, its largest entry."""
    message = mavlink(data)
    return Reading(np.array([message.x, message.y, message.z]), np.eye(3) * max(message.covariance))


def px4_odometry(data: bytes) -> Reading:
    """EvVelBodyFrameFrd: three variances with a floor of EKF2_EVV_NOISE² and 0.01²; cross terms unused."""
    message = mavlink(data)
    velocity = np.array([message.vx, message.vy, message.vz])
    assert np.isfinite(velocity).all()
    floor = max(EVV_NOISE, 0.01) ** 2
    variances = np.maximum([message.velocity_covariance[k] for k in (0, 6, 11)], floor)
    return Reading(velocity, np.diag(variances))


def microstrain(data: bytes) -> Reading:
    """Axes whose flag is set, one σ each."""
    found = mip(data)
    axes = tuple(k for k in range(3) if found["flags"] >> k & 1)
    return Reading(found["velocity"][list(axes)], np.diag(found["sd"][list(axes)] ** 2), axes)


_STORE: list[Any] = []


def ros_full(data: bytes) -> Reading:
    """The whole covariance: robot_localization, in forward-left-up."""
    if not _STORE:
        _STORE.append(ros_reader.typestore())
    message = _STORE[0].deserialize_cdr(data, "geometry_msgs/msg/TwistWithCovarianceStamped")
    linear = message.twist.twist.linear
    flip = np.diag([1.0, -1.0, -1.0])
    covariance = flip @ message.twist.covariance.reshape(6, 6)[:3, :3] @ flip
    return Reading(flip @ np.array([linear.x, linear.y, linear.z]), covariance)


PORTS: dict[str, tuple[dict[str, Any], Callable[[bytes], Reading]]] = {
    "ros_twist": ({"unseen_sd_mps": 100.0}, ros_full),
    "vision_position_delta": (
        {"min_noise_mps": MIN_NOISE, "max_noise_mps": MAX_NOISE, "max_interval_s": 1e6},
        ardupilot_delta,
    ),
    "vision_speed_estimate": ({}, ardupilot_speed),
    "odometry": ({}, px4_odometry),
    "microstrain": ({"unseen": "estimate"}, microstrain),
}
"""Settings of each port, and what its receiver makes of the bytes. The first has the whole covariance."""


@dataclass
class Px4:
    """PX4's gate and reset around the filter: after 1 s of rejections the velocity is set to the one sent."""

    filter: Receiver
    gate: float = 3.0
    passed_s: float = 0.0
    now_s: float = 0.0
    resets: int = 0

    def message(self, data: bytes | None) -> None:
        """A step in which a message came, or none."""
        self.now_s += STEP_S
        if data is None:
            return
        reading = px4_odometry(data)
        residual, spread = self.filter.innovation(reading)
        if bool((residual**2 <= self.gate**2 * np.diag(spread)).all()):
            self.filter.update(reading)
            self.passed_s = self.now_s
        elif self.now_s - self.passed_s > 1.0:
            self.filter.velocity = reading.velocity
            covariance = self.filter.covariance
            covariance[:3, :] = covariance[:, :3] = 0.0
            # "bump the variance by a factor of 5 to make the reset less aggressive"
            covariance[:3, :3] = 5.0 * reading.covariance
            self.passed_s = self.now_s
            self.resets += 1
