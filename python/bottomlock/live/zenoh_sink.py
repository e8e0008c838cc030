"""Messages over zenoh: each a sample, its payload the bytes of the port.

A target `zenoh:KEY` is a publisher of plain samples under this key. A target `ros:/TOPIC` is a publisher of ROS 2, as
rmw_zenoh knows it. Samples of the ROS ports have the encoding `application/cdr`.
"""

import asyncio
from collections.abc import Callable
from typing import Any

from bottomlock.live import zenoh_session
from bottomlock.live.rmw_zenoh import ROUTER, Topic, attachment
from bottomlock.live.sink import Sink
from bottomlock.ports.address import Address

CDR_HEADER = b"\x00\x01\x00\x00"


class ZenohSink(Sink):
    """A publisher under one key, or of one topic.

    Args:
        address: key or topic, and endpoint.
        ros_type: type of the messages of a topic.
        clock: host's clock, ns since 1970: when a message of a topic was sent.

    Raises:
        DataError: where eclipse-zenoh is not installed.
    """

    def __init__(self, address: Address, ros_type: str, clock: Callable[[], int]) -> None:
        self._zenoh = zenoh_session.library()
        self._topic = Topic(address.path, ros_type) if address.kind == "ros" else None
        self._key = address.path if self._topic is None else self._topic.published()
        self._endpoint = address.host or ("" if self._topic is None else ROUTER)
        self._clock = clock
        self._publisher: Any = None
        self._gid = b""
        self._sent = 0

    def write(self, data: bytes) -> None:
        """Publishes a message; what the network does not take at once is dropped by zenoh."""
        if self._publisher is None:
            self.dropped += 1
            return
        cdr = data.startswith(CDR_HEADER)
        beside: dict[str, Any] = {}
        if self._topic is not None:
            self._sent += 1
            beside["attachment"] = attachment(self._sent, self._clock(), self._gid)
        try:
            self._publisher.put(
                data, encoding="application/cdr" if cdr else "application/octet-stream", **beside
            )
        except self._zenoh.ZError as error:
            self.dropped += 1
            self.state = f"cannot be sent: {str(error).splitlines()[0]}"

    async def run(self) -> None:
        """Joins the session, tries again where its router is absent, and leaves it at the end."""
        session = await self.opened(lambda: zenoh_session.joined(self._endpoint))
        token: Any = None
        try:
            publisher = session.zenoh.declare_publisher(
                self._key, congestion_control=self._zenoh.CongestionControl.DROP
            )
            if self._topic is not None:
                token, self._gid = self._topic.declare(session, "MP")
            self._publisher = publisher
            self.state = "publishing"
            await asyncio.Event().wait()
        finally:
            self._publisher = None
            if token is not None:
                token.undeclare()
            await asyncio.to_thread(zenoh_session.leave, self._endpoint)
