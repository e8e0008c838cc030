"""Topics of ROS 2 as rmw_zenoh has them: keys, tokens by which the graph is known, and what stands beside a message.

A message of a topic is a sample under `DOMAIN/TOPIC/TYPE/HASH`. Its attachment is its number, the time when it was
sent (ns), and the 16 bytes that name the publisher. Nodes, publishers and subscriptions declare liveliness tokens
under `@ros2_lv`, in which `/` is written `%`. A subscription takes any hash: distributions of ROS differ in them.

Source: rmw_zenoh, docs/design.md; zenoh-ros2-sdk 0.1.8.
"""

import hashlib
import os
import struct
from dataclasses import dataclass
from typing import Any

from bottomlock.errors import DataError
from bottomlock.live.zenoh_session import Session

ROUTER = "tcp/localhost:7447"
"""Where rmw_zenoh's router listens."""
NODE = "bottomlock"
_MOST_DOMAIN = 232
_ROOT = "%"
_BEST_EFFORT = "2::,10:,:,:,,"
"""Quality of service: best effort, volatile, the last ten; what a slow receiver misses is dropped."""
HASHES = {
    "diagnostic_msgs/DiagnosticArray": "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    "dvl_msgs/DVL": "da453fb8531a5600ff863de396b3367ec5a433138929495b26fd97aadd8b307d",
    "geometry_msgs/PoseWithCovarianceStamped": "26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e",
    "geometry_msgs/TwistWithCovarianceStamped": "77b67434531e6529b7a0091357b186b6ebdb17fd9ffd3e0c7ce9d3fb11a44563",
    "geometry_msgs/VelocityWithCovarianceStamped": "f0957be0a63943af8b24abcb20e4e1fc8b71368e872dbf802f87b8a2ca8e60a0",
    "marine_acoustic_msgs/Dvl": "77604ba1b113d1a39148d095ac2cb21540de83cff2bbc5443e06e25208afd421",
    "nav_msgs/Odometry": "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
    "sensor_msgs/FluidPressure": "22dfb2b145a0bd5a31a1ac3882a1b32148b51d9b2f3bab250290d66f3595bc32",
    "sensor_msgs/Imu": "7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b",
    "sensor_msgs/NavSatFix": "62223ab3fe210a15976021da7afddc9e200dc9ec75231c1b6a557fc598a65404",
    "std_msgs/Float64": "705ba9c3d1a09df43737eb67095534de36fd426c0587779bda2bc51fe790182a",
    "tf2_msgs/TFMessage": "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
}
"""SHA-256 of the description of each type, REP 2016, without "RIHS01_"."""


def domain() -> int:
    """The domain that `ROS_DOMAIN_ID` states; 0 without.

    Raises:
        DataError: for one that is no domain.
    """
    text = os.environ.get("ROS_DOMAIN_ID", "").strip() or "0"
    if not (text.isascii() and text.isdigit() and int(text) <= _MOST_DOMAIN):
        raise DataError(f"ROS_DOMAIN_ID is '{text}', expected an integer from 0 to {_MOST_DOMAIN}")
    return int(text)


@dataclass(frozen=True)
class Topic:
    """A topic and the type of its messages, `package/msg/Name`."""

    name: str
    type: str

    @property
    def _type_name(self) -> str:
        package, kind, name = self.type.split("/")
        return f"{package}::{kind}::dds_::{name}_"

    @property
    def _hash(self) -> str:
        return f"RIHS01_{HASHES[self.type.replace('/msg/', '/')]}"

    def published(self) -> str:
        """The key of its messages."""
        return f"{domain()}{self.name}/{self._type_name}/{self._hash}"

    def subscribed(self) -> str:
        """The key under which its messages are taken."""
        return f"{domain()}{self.name}/{self._type_name}/*"

    def declare(self, session: Session, kind: str) -> tuple[Any, bytes]:
        """Makes a publisher, kind "MP", or a subscription, "MS", known; its token and the bytes that name it."""
        node = f"@ros2_lv/{domain()}/{session.zenoh.info.zid()}/0"
        liveliness = session.zenoh.liveliness()
        if session.node is None:
            session.node = liveliness.declare_token(f"{node}/0/NN/{_ROOT}/{_ROOT}/{NODE}")
        session.entities += 1
        name = self.name.replace("/", "%")
        key = (
            f"{node}/{session.entities}/{kind}/{_ROOT}/{_ROOT}/{NODE}/{name}/{self._type_name}/{self._hash}"
            f"/{_BEST_EFFORT}"
        )
        return liveliness.declare_token(key), hashlib.sha256(key.encode()).digest()[:16]


def attachment(number: int, time_ns: int, gid: bytes) -> bytes:
    """What stands beside a message."""
    return struct.pack("<qqB", number, time_ns, len(gid)) + gid
