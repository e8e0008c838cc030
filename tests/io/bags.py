"""Small bags with Dvl messages, written by the library itself."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

TILT = math.radians(22.5)
UNIT = np.array(
    [
        [math.sin(TILT) * math.cos(a), math.sin(TILT) * math.sin(a), math.cos(TILT)]
        for a in np.pi / 180 * np.array([45, 135, 225, 315])
    ]
)
VELOCITY = np.array([1.0, -0.25, 0.125])


def message(store: Any, step: int, **changed: Any) -> Any:  # noqa: ANN401 - the library's own objects
    """A Dvl message of a vehicle with a constant velocity, 0.2 s a step; the third has lost beam 2."""
    types = store.types
    vector, time = types["geometry_msgs/msg/Vector3"], types["builtin_interfaces/msg/Time"]
    header = types["std_msgs/msg/Header"]
    beams = (UNIT @ VELOCITY).astype(np.float32)
    if step == 2:
        beams[1] = np.nan
    stamp = time(sec=1_700_000_000, nanosec=200_000_000 * step)
    try:
        head = header(stamp=stamp, frame_id="dvl")
    except TypeError:
        head = header(seq=step, stamp=stamp, frame_id="dvl")
    fields: dict[str, Any] = {
        "header": head,
        "velocity_mode": 1,
        "dvl_type": 0,
        "velocity": vector(*VELOCITY),
        "velocity_covar": np.diag([4e-6, 4e-6, 1e-6]).ravel(),
        "altitude": 2.5,
        "course_gnd": 0.0,
        "speed_gnd": 1.0,
        "num_good_beams": 3 if step == 2 else 4,
        "sound_speed": 1500.0,
        "beam_ranges_valid": True,
        "beam_velocities_valid": True,
        "beam_unit_vec": [vector(*u) for u in UNIT],
        "range": np.array([2.7, 2.8, 2.9, 3.0]) + 0.01 * step,
        "range_covar": np.full(4, -1.0, dtype=np.float32),
        "beam_quality": np.full(4, 0.5, dtype=np.float32),
        "beam_velocity": beams,
        "beam_velocity_covar": np.full(4, 1e-4, dtype=np.float32),
    }
    return types["marine_acoustic_msgs/msg/Dvl"](**(fields | changed))


def write_ros1(path: Path, steps: int, *, topics: tuple[str, ...] = ("/dvl",), **changed: Any) -> Path:  # noqa: ANN401
    """A ROS 1 bag."""
    from rosbags.rosbag1 import Writer

    from bottomlock.io.ros import TYPES, typestore

    store = typestore(latest=False)
    with Writer(path) as writer:
        connections = [writer.add_connection(topic, TYPES[0], typestore=store) for topic in topics]
        for step in range(steps):
            raw = store.serialize_ros1(message(store, step, **changed), TYPES[0])
            for connection in connections:
                writer.write(connection, 1_700_000_000_050_000_000 + 200_000_000 * step, raw)
    return path


def write_ros2(path: Path, steps: int, *, mcap: bool = False, **changed: Any) -> Path:  # noqa: ANN401
    """A ROS 2 bag: a folder with SQLite or MCAP in it."""
    from rosbags.rosbag2 import Writer
    from rosbags.rosbag2.enums import StoragePlugin

    from bottomlock.io.ros import TYPES, typestore

    store = typestore()
    plugin = StoragePlugin.MCAP if mcap else StoragePlugin.SQLITE3
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        connection = writer.add_connection("/dvl", TYPES[0], typestore=store)
        for step in range(steps):
            raw = store.serialize_cdr(message(store, step, **changed), TYPES[0])
            writer.write(connection, 1_700_000_000_050_000_000 + 200_000_000 * step, raw)
    return path
