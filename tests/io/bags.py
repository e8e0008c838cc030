"""Small bags with Dvl messages, written by the library itself."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from bottomlock.io.ros import typestore
from tests import ros_messages
from tests.ros_messages import DVL, Messages

TILT = math.radians(22.5)
UNIT = np.array(
    [
        [math.sin(TILT) * math.cos(a), math.sin(TILT) * math.sin(a), math.cos(TILT)]
        for a in np.pi / 180 * np.array([45, 135, 225, 315])
    ]
)
VELOCITY = np.array([1.0, -0.25, 0.125])
FIRST_NS = 1_700_000_000_050_000_000
"""Arrival of the first message."""


def message(store: Any, step: int, **changed: Any) -> Any:  # noqa: ANN401 - the library's own objects
    """A Dvl message of a vehicle with a constant velocity, 0.2 s a step; the third has lost beam 2."""
    made = Messages(store)
    beams = UNIT @ VELOCITY
    if step == 2:
        beams[1] = np.nan
    fields: dict[str, Any] = {
        "dvl_type": 0, "velocity": made.vector(*VELOCITY), "velocity_covar": np.diag([4e-6, 4e-6, 1e-6]).ravel(),
        "altitude": 2.5, "course_gnd": 0.0, "speed_gnd": 1.0, "beam_quality": np.full(4, 0.5, dtype=np.float32),
        "beam_velocity_covar": np.full(4, 1e-4, dtype=np.float32),
    }  # fmt: skip
    time_ns = 1_700_000_000_000_000_000 + 200_000_000 * step
    ranges = np.array([2.7, 2.8, 2.9, 3.0]) + 0.01 * step
    return made.dvl(time_ns, beams, ranges, UNIT, **(fields | changed))


def write_ros1(path: Path, steps: int, *, topics: tuple[str, ...] = ("/dvl",), **changed: Any) -> Path:  # noqa: ANN401
    """A ROS 1 bag."""
    store = typestore(latest=False)
    sent = [
        (FIRST_NS + 200_000_000 * k, topic, DVL, message(store, k, **changed))
        for k in range(steps)
        for topic in topics
    ]
    return ros_messages.write_ros1(path, sent, store)


def write_ros2(path: Path, steps: int, *, mcap: bool = False, **changed: Any) -> Path:  # noqa: ANN401
    """A ROS 2 bag: a folder with SQLite or MCAP in it."""
    store = typestore()
    sent = [(FIRST_NS + 200_000_000 * k, "/dvl", DVL, message(store, k, **changed)) for k in range(steps)]
    return ros_messages.write_ros2(path, sent, store, mcap=mcap)
