"""Models of the receivers: a small Kalman filter, fed by the bytes of a port as each receiver decodes and uses them.

The filter estimates the velocity (3) and the bias of its own accelerometers (3) in platform axes; the accelerometers
are its own, so that its errors and ours are independent. What it does with a message is what the sources named in
docs/ports.md say; decoders are pymavlink, rosbags and a struct of the tests, never the package's.
"""

from __future__ import annotations

import json
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
        {
            "min_noise_mps": MIN_NOISE,
            "max_noise_mps": MAX_NOISE,
            "max_interval_s": 1e6,
            "variance_factor": 1.0,
        },
        ardupilot_delta,
    ),
    "vision_speed_estimate": ({"variance_factor": 1.0}, ardupilot_speed),
    "odometry": ({"variance_factor": 1.0}, px4_odometry),
    "microstrain": ({"unseen": "estimate"}, microstrain),
}
"""Settings of each port, and what its receiver makes of the bytes. The first has the whole covariance.

Errors here are drawn anew for each message, so none is counted twice and the factor of mode navigation is 1."""


EV_MAX_INTERVAL_S, STOPS_AFTER_S, MOST_RESETS = 0.2, 0.4, 5
"""PX4: a stream starts with two samples strictly less than the first apart, and ends after the second without one."""
EPOCH_US = 1_800_000_000_000_000
"""Taken off the stamps, so that differences of seconds are exact."""


@dataclass
class Px4:
    """PX4's external vision around the filter: when it starts and stops, its gate, and its resets.

    After 1 s of rejections the velocity is set to the one sent, at most five times in a row; then the stream stops and
    must start anew. Stamps are on PX4's clock by TIMESYNC where `synchronised`, else the message is of its arrival, s
    since `EPOCH_US`.
    """

    filter: Receiver
    gate: float = 3.0
    synchronised: bool = True
    active: bool = False
    starts: int = 0
    resets: int = 0
    passed_s: float = 0.0
    before_s: float | None = None
    resets_in_a_row: int = 0

    def message(self, data: bytes | None, now_s: float) -> None:
        """A message that came at a time, or none."""
        if self.active and self.before_s is not None and now_s - self.before_s > STOPS_AFTER_S:
            self.active = False
        if data is None:
            return
        stamp_s = (mavlink(data).time_usec - EPOCH_US) * 1e-6 if self.synchronised else now_s
        apart_s = None if self.before_s is None else round(stamp_s - self.before_s, 6)
        self.before_s = stamp_s
        if not self.active:
            if apart_s is None or not 0.0 < apart_s < EV_MAX_INTERVAL_S:
                return
            self.active, self.passed_s, self.resets_in_a_row = True, stamp_s, 0
            self.starts += 1
        self._fuse(px4_odometry(data), stamp_s)

    def _fuse(self, reading: Reading, now_s: float) -> None:
        residual, spread = self.filter.innovation(reading)
        if bool((residual**2 <= self.gate**2 * np.diag(spread)).all()):
            self.filter.update(reading)
            self.passed_s, self.resets_in_a_row = now_s, 0
        elif now_s - self.passed_s > 1.0:
            if self.resets_in_a_row == MOST_RESETS:
                self.active = False
                return
            self.filter.velocity = reading.velocity
            covariance = self.filter.covariance
            covariance[:3, :] = covariance[:, :3] = 0.0
            # "bump the variance by a factor of 5 to make the reset less aggressive"
            covariance[:3, :3] = 5.0 * reading.covariance
            self.passed_s = now_s
            self.resets += 1
            self.resets_in_a_row += 1


def lost_by_sequence(messages: list[bytes]) -> int:
    """Messages that a receiver counts as lost: gaps of the sequence of each system and component (pymavlink)."""
    last: dict[tuple[int, int], int] = {}
    lost = 0
    for data in messages:
        sequence, sender = data[4], (data[5], data[6])
        if sender in last:
            lost += (sequence - last[sender] - 1) % 256
        last[sender] = sequence
    return lost


def waterlinked_client(data: bytes) -> list[dict[str, Any]]:
    """Reports as the maker's TCP client reads them: split at a carriage return and a line feed (dvl-python)."""
    *lines, _ = data.split(b"\r\n")
    return [json.loads(line) for line in lines]


def blueos_way_m(reports: list[dict[str, Any]]) -> Floats:
    """(3,) way that BlueOS' extension adds up: velocity times `time`, ms since the report before."""
    steps = [np.array([one["vx"], one["vy"], one["vz"]]) * one["time"] * 1e-3 for one in reports]
    way: Floats = np.sum(steps, axis=0)
    return way


def px4_timesync(request_ns: int, answer: bytes, now_ns: int) -> int:
    """Offset, ns, of the companion's clock from its own that PX4 computes of an answer (Timesync.cpp)."""
    message = mavlink(answer)
    assert message.ts1 == request_ns
    assert message.tc1 > 0
    return int(message.ts1 + now_ns - message.tc1 * 2) // 2
