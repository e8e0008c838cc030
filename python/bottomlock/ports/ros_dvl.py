"""ROS 2: `marine_acoustic_msgs/Dvl` as CDR, with the beams as they are and the velocity as far as it is known.

By the message's definition z points where the instrument looks, so the axes are forward-right-down, ours. A lost beam
has a velocity that is not a number and a variance of -1; so has a component that the beams do not determine. The beams
are the instrument's measurements also in mode navigation, where the velocity is the navigator's.
"""

import math
from typing import Any

import numpy as np

from bottomlock.errors import ScenarioError
from bottomlock.kernel import BeamGeometry
from bottomlock.kernel.models import Positive
from bottomlock.ports.cdr import CdrWriter
from bottomlock.ports.estimate import Estimate, Floats
from bottomlock.ports.port import FrameName, Port
from bottomlock.ports.ros_velocity import later_than_a_ros_time
from bottomlock.recordings.readings import Ping

_BOTTOM, _BEAMS, _UNKNOWN = 1, 4, -1.0


class RosDvl(Port):
    """`marine_acoustic_msgs/Dvl`."""

    name = "ros_dvl"
    ros_type = "marine_acoustic_msgs/msg/Dvl"

    geometry: BeamGeometry
    """the beams; the message holds four"""
    frame_id: FrameName = "base_link_frd"
    """name of the axes, forward-right-down"""
    sound_speed_mps: Positive = 1500.0
    """as set in the instrument"""

    def model_post_init(self, _context: Any, /) -> None:  # noqa: ANN401 - pydantic's
        """Checks the number of beams.

        Raises:
            ScenarioError: for others than four.
        """
        super().model_post_init(_context)
        if self.geometry.beams != _BEAMS:
            raise ScenarioError(
                f"the geometry has {self.geometry.beams} beams, the message {_BEAMS}",
                place=f"port {self.name}",
            )
        self._directions = np.asarray(self.geometry.directions_p)

    def _refuses(self, estimate: Estimate) -> str | None:
        if late := later_than_a_ros_time(estimate):
            return late
        if estimate.beams is None:
            return "there is no ping"
        if len(estimate.beams.velocity_mps) != _BEAMS:
            return f"the ping has {len(estimate.beams.velocity_mps)} beams, the message {_BEAMS}"
        return None

    def _message(self, estimate: Estimate) -> bytes:
        beams = estimate.beams
        assert beams is not None
        # Course and speed of the message's own x and y, as the makers' drivers fill them; NaN without both.
        x, y, _ = estimate.velocity_p_mps.tolist()
        course_speed = math.atan2(y, x), math.hypot(x, y)
        writer = CdrWriter()
        writer.header(estimate.time_ns, self.frame_id)
        writer.uint8(_BOTTOM, 0)
        writer.float64(*estimate.velocity_p_mps.tolist())
        there = estimate.components
        covariance = np.where(np.outer(there, there), estimate.covariance_m2ps2, 0.0)
        covariance[~there, ~there] = _UNKNOWN
        writer.float64(*covariance.ravel().tolist())
        writer.float64(altitude_m(beams, self._directions), *course_speed)
        writer.uint8(int(beams.valid.sum()))
        writer.float32(self.sound_speed_mps)
        writer.uint8(int(np.isfinite(beams.range_m).any()), int(beams.valid.any()))
        writer.float64(*self._directions.ravel().tolist())
        writer.float64(*beams.range_m.tolist())
        writer.float32(*[_UNKNOWN] * _BEAMS)
        writer.float32(*[math.nan] * _BEAMS)
        writer.float32(*beams.velocity_mps.tolist())
        writer.float32(*np.where(beams.valid, beams.sd_mps**2, _UNKNOWN).tolist())
        return bytes(writer)


def altitude_m(beams: Ping, directions_p: Floats) -> float:
    """Mean distance to the bottom along the platform's z axis; NaN without a range."""
    vertical = beams.range_m * directions_p[:, 2]
    return float(np.nanmean(vertical)) if bool(np.isfinite(vertical).any()) else math.nan
