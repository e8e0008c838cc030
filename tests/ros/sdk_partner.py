"""Another process of ROS 2, by zenoh-ros2-sdk: it publishes the sensors of a vehicle, and takes what `live` publishes.

`python -m tests.ros.sdk_partner PORT SECONDS`; a line of JSON at the end says what it saw.
"""

from __future__ import annotations

import json
import logging
import os
import sys
import time
from typing import Any

import numpy as np
import zenoh_ros2_sdk as sdk
from rosbags.typesys import Stores, get_typestore
from zenoh_ros2_sdk.attachment import Attachment
from zenoh_ros2_sdk.utils import get_type_hash

from bottomlock.io.beams import read_geometry
from bottomlock.io.ros_messages import DEFINITIONS
from bottomlock.kernel import normal_gravity_mps2
from tests.ros.dive import LATITUDE_DEG, TYPES, Messages

TAKEN = {
    "/odometry": "nav_msgs/msg/Odometry",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
}
NODE = "bottomlock"


def hash_of(name: str) -> str:
    """The hash of a type, as the SDK computes it from definitions."""
    if name == TYPES["/dvl"]:
        parts = {key.replace("/", "/msg/"): text for key, text in DEFINITIONS.items()}
        return str(get_type_hash(name, parts[name], parts))
    text, _ = get_typestore(Stores.LATEST).generate_msgdef(name, ros_version=2)
    first, *others = text.split("=" * 80 + "\nMSG: ")
    parts = {}
    for part in others:
        key, _, definition = part.partition("\n")
        parts[key.replace("/", "/msg/")] = definition
    return str(get_type_hash(name, first, parts))


def main(port: int, seconds: float) -> None:
    """Publishes and listens."""
    logging.disable(logging.INFO)
    session = sdk.ZenohSession.get_instance("127.0.0.1", port)
    session.store = Messages().store
    session._registered_types.update({name: name for name in session.store.types})
    where: dict[str, Any] = {"router_ip": "127.0.0.1", "router_port": port}
    seen: dict[str, list[Any]] = {topic: [] for topic in TAKEN}
    beside: list[Attachment] = []
    session.session.declare_subscriber(
        "0/odometry/**", lambda sample: beside.append(Attachment.from_bytes(sample.attachment.to_bytes()))
    )
    for topic, name in TAKEN.items():
        sdk.ROS2Subscriber(topic, name, seen[topic].append, type_hash=hash_of(name), **where)
    publish = {
        topic: sdk.ROS2Publisher(topic, TYPES[topic], type_hash=hash_of(TYPES[topic]), **where)
        for topic in ("/imu", "/dvl", "/pressure")
    }
    until(lambda: listens("/imu", where) and listens("/dvl", where), "a subscription of ours")
    messages = Messages()
    geometry = read_geometry("teledyne_30").geometry
    directions = np.asarray(geometry.directions_p)
    beams = geometry.beam_velocities(np.array([[1.5, 0.1, 0.0]]))[0]
    gravity = normal_gravity_mps2(np.deg2rad(LATITUDE_DEG))
    began = time.time()
    for step in range(round(50 * seconds)):
        time.sleep(max(began + step / 50 - time.time(), 0.0))
        now_ns = time.time_ns()
        publish["/imu"].publish(**fields(messages.imu(now_ns, (0.0, 0.0, 0.0), (0.0, 0.0, gravity))))
        if step % 10 == 0:
            message = messages.dvl(now_ns - 50_000_000, beams, np.full(4, 15.0), directions)
            publish["/dvl"].publish(**fields(message))
            publish["/pressure"].publish(**fields(messages.pressure(now_ns, 12.0)))
    known = sdk.get_topic_names_and_types(**where)
    last = seen["/odometry"][-1]
    print(
        json.dumps(
            {
                "received": {topic: len(messages) for topic, messages in seen.items()},
                "velocity": [getattr(last.twist.twist.linear, axis) for axis in "xyz"],
                "depth": last.pose.pose.position.z,
                "age_s": time.time() - last.header.stamp.sec - 1e-9 * last.header.stamp.nanosec,
                "numbers": [one.sequence_id for one in beside],
                "gids": sorted({one.gid.hex() for one in beside}),
                "sent_s": [1e-9 * one.timestamp_ns - time.time() for one in beside[-1:]],
                "topics": {name: types for name, types in known if name in TAKEN},
                "publishers": {topic: named(topic, where) for topic in TAKEN},
                "state": seen["/diagnostics"][-1].status[0].message.split(":")[0],
            }
        )
    )
    session.close()


def fields(message: Any) -> dict[str, Any]:  # noqa: ANN401
    return {name: value for name, value in vars(message).items() if not name.startswith("__")}


def until(condition: Any, what: str) -> None:  # noqa: ANN401
    for _ in range(200):
        if condition():
            return
        time.sleep(0.1)
    print(f"there never was {what}", file=sys.stderr, flush=True)
    # A session of zenoh that is open holds up the end of its process.
    os._exit(1)


def listens(topic: str, where: dict[str, Any]) -> bool:
    info = sdk.get_topic_info(topic, verbose=True, **where)
    return info is not None and any(one.node_name == NODE for one in info.subscribers)


def named(topic: str, where: dict[str, Any]) -> list[str]:
    return [
        f"{one.node_name} {one.type_hash}"
        for one in sdk.get_topic_info(topic, verbose=True, **where).publishers
    ]


if __name__ == "__main__":
    main(int(sys.argv[1]), float(sys.argv[2]))
