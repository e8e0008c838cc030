"""DISTANCE_SENSOR: the distance to the bottom, for an autopilot's rangefinder (surface tracking, terrain)."""

import math
from typing import Any

import numpy as np

from bottomlock.errors import ScenarioError
from bottomlock.kernel import BeamGeometry
from bottomlock.kernel.models import Positive
from bottomlock.ports.estimate import Estimate
from bottomlock.ports.mavlink import MavlinkPort
from bottomlock.ports.ros_dvl import altitude_m
from bottomlock.recordings.readings import Ping

_ULTRASOUND, _DOWN, _UNKNOWN = 1, 25, 255
"""MAV_DISTANCE_SENSOR_ULTRASOUND, MAV_SENSOR_ROTATION_PITCH_270, and a covariance that is not known."""


class DistanceSensor(MavlinkPort):
    """DISTANCE_SENSOR (132), downwards: the mean of a ping's ranges along the vehicle's z axis, one message a ping.

    It says nothing of the velocity. A ping whose beams have no range gives none: the receiver sees a rangefinder that
    falls silent. What tilts the vehicle tilts the axis, and ArduPilot corrects for it.
    """

    name = "distance_sensor"

    geometry: BeamGeometry
    """directions of the beams, all within 60 degrees of down"""
    min_distance_m: Positive = 0.05
    """the least distance that the receiver is to believe"""
    max_distance_m: Positive = 50.0
    """the greatest"""

    def model_post_init(self, _context: Any, /) -> None:  # noqa: ANN401 - pydantic's
        """Checks beams and range.

        Raises:
            ScenarioError: for beams that do not look down, and for a range that is none.
        """
        super().model_post_init(_context)
        self._directions = np.asarray(self.geometry.directions_p)
        if bool((self._directions[:, 2] < math.cos(math.radians(60.0))).any()):
            raise ScenarioError(
                "a beam points more than 60 degrees away from down: its range is no distance to the bottom below the "
                "vehicle",
                place=f"port {self.name}",
            )
        if not self.min_distance_m < self.max_distance_m <= 655.0:
            expected = f"more than min_distance_m, {self.min_distance_m}, and at most 655"
            raise self.wrong("max_distance_m", expected)
        self._sent: Ping | None = None

    def _refuses(self, estimate: Estimate) -> str | None:
        beams = estimate.beams
        if beams is None or len(beams.range_m) != len(self._directions):
            return "there is no ping of the geometry's beams"
        distance_m = altitude_m(beams, self._directions)
        if math.isnan(distance_m):
            return "no beam of the ping has a range"
        if not self.min_distance_m <= distance_m <= self.max_distance_m:
            return f"the distance is {distance_m:.2f} m, outside of {self.min_distance_m:g} to {self.max_distance_m:g}"
        return None

    def _waits(self, estimate: Estimate) -> str | None:
        if estimate.beams is self._sent:
            return "the distance of this ping was sent"
        return super()._waits(estimate)

    def _message(self, estimate: Estimate) -> bytes:
        assert estimate.beams is not None  # refused without
        message = self._dialect.MAVLink_distance_sensor_message(
            estimate.time_ns // 1_000_000 % 2**32,
            round(self.min_distance_m * 100.0),
            round(self.max_distance_m * 100.0),
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
