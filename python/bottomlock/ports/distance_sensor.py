"""DISTANCE_SENSOR: the distance to the bottom, for an autopilot's rangefinder (surface tracking, terrain)."""

import math
from dataclasses import dataclass, field

import numpy as np

from bottomlock.errors import ScenarioError
from bottomlock.kernel import BeamGeometry
from bottomlock.ports.estimate import Beams, Estimate
from bottomlock.ports.mavlink import MavlinkPort
from bottomlock.ports.ros_dvl import altitude_m

_ULTRASOUND, _DOWN, _UNKNOWN = 1, 25, 255
"""MAV_DISTANCE_SENSOR_ULTRASOUND, MAV_SENSOR_ROTATION_PITCH_270, and a covariance that is not known."""


@dataclass(kw_only=True, eq=False)
class DistanceSensor(MavlinkPort):
    """DISTANCE_SENSOR (132), downwards: the mean of a ping's ranges along the vehicle's z axis, one message a ping.

    It says nothing of the velocity. A ping whose beams have no range gives none: the receiver sees a rangefinder that
    falls silent. What tilts the vehicle tilts the axis, and ArduPilot corrects for it.

    Args:
        geometry: directions of the beams, all within 60 degrees of down.
        min_distance_m: the least distance that the receiver is to believe.
        max_distance_m: the greatest.
        max_rate_hz: see `MavlinkPort`.
        system_id: see `MavlinkPort`.
        component_id: see `MavlinkPort`.
    """

    name = "distance_sensor"

    geometry: BeamGeometry
    min_distance_m: float = 0.05
    max_distance_m: float = 50.0
    variance_factor: float = field(default=1.0, init=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._directions = np.asarray(self.geometry.directions_p)
        if bool((self._directions[:, 2] < math.cos(math.radians(60.0))).any()):
            raise ScenarioError(
                (
                    "a beam points more than 60 degrees away from down: its range is no distance "
                    "to the bottom below the vehicle"
                ),
                place=f"port {self.name}",
            )
        self._least_m = self._positive("min_distance_m", self.min_distance_m)
        self._most_m = self._positive("max_distance_m", self.max_distance_m)
        if not self._least_m < self._most_m <= 655.0:
            raise ScenarioError(
                f"is {self.max_distance_m}",
                place=f"port {self.name}",
                key="max_distance_m",
                expected=f"more than min_distance_m, {self.min_distance_m}, and at most 655",
            )
        self._sent: Beams | None = None

    def _refuses(self, estimate: Estimate) -> str | None:
        beams = estimate.beams
        if beams is None or len(beams.range_m) != len(self._directions):
            return "there is no ping of the geometry's beams"
        distance_m = altitude_m(beams, self._directions)
        if math.isnan(distance_m):
            return "no beam of the ping has a range"
        if not self._least_m <= distance_m <= self._most_m:
            return f"the distance is {distance_m:.2f} m, outside of {self._least_m:g} to {self._most_m:g}"
        return None

    def _waits(self, estimate: Estimate) -> str | None:
        if estimate.beams is self._sent:
            return "the distance of this ping was sent"
        return super()._waits(estimate)

    def _message(self, estimate: Estimate) -> bytes:
        assert estimate.beams is not None  # refused without
        message = self._dialect.MAVLink_distance_sensor_message(
            estimate.time_ns // 1_000_000 % 2**32,
            round(self._least_m * 100.0),
            round(self._most_m * 100.0),
            round(altitude_m(estimate.beams, self._directions) * 100.0),
            _ULTRASOUND,
            0,
            _DOWN,
            _UNKNOWN,
        )
        return self._pack(message)

    def _observe(self, estimate: Estimate, *, sent: bool) -> None:
        if sent:
            self._sent = estimate.beams
