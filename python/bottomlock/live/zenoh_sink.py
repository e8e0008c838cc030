"""Messages over zenoh: each a sample under a key, its payload the bytes of the port.

Without an endpoint the session is a peer that finds others by multicast; with one it is a client of the router there.
Samples of the ROS ports have the encoding `application/cdr`. They are plain samples: rmw_zenoh sees its own keys and
attachments only, so a bridge or a node with zenoh takes them up (docs/ports.md).
"""

import asyncio
import json
from typing import Any

from bottomlock.errors import DataError
from bottomlock.live.sink import Sink
from bottomlock.ports.address import Address
from bottomlock.support.extras import install

CDR_HEADER = b"\x00\x01\x00\x00"


def _zenoh() -> Any:  # noqa: ANN401 - an extra
    try:
        import zenoh  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise DataError(f"targets zenoh:KEY need eclipse-zenoh: {install('zenoh')}") from error
    return zenoh


class ZenohSink(Sink):
    """A publisher under one key.

    Raises:
        DataError: where eclipse-zenoh is not installed.
    """

    def __init__(self, address: Address) -> None:
        self._zenoh = _zenoh()
        self._address = address
        self._publisher: Any = None

    def write(self, data: bytes) -> None:
        """Publishes a message; what the network does not take at once is dropped by zenoh."""
        if self._publisher is None:
            self.dropped += 1
            return
        cdr = data.startswith(CDR_HEADER)
        try:
            self._publisher.put(data, encoding="application/cdr" if cdr else "application/octet-stream")
        except self._zenoh.ZError as error:
            self.dropped += 1
            self.state = f"cannot be sent: {str(error).splitlines()[0]}"

    async def run(self) -> None:
        """Opens the session, tries again where its router is absent, and closes it at the end."""
        session = await self.opened(lambda: asyncio.to_thread(self._session))
        try:
            self._publisher = session.declare_publisher(
                self._address.path, congestion_control=self._zenoh.CongestionControl.DROP
            )
            self.state = "publishing"
            await asyncio.Event().wait()
        finally:
            self._publisher = None
            session.close()

    def _session(self) -> Any:  # noqa: ANN401 - an extra
        config = self._zenoh.Config()
        if self._address.host:
            config.insert_json5("mode", '"client"')
            config.insert_json5("connect/endpoints", json.dumps([self._address.host]))
            config.insert_json5("scouting/multicast/enabled", "false")
        try:
            return self._zenoh.open(config)
        except self._zenoh.ZError as error:
            raise OSError(str(error).partition(" at /")[0].strip()) from error
