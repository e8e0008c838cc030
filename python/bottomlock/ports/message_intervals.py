"""Asking an autopilot for the messages that are read: it sends most of them slowly or not at all until it is asked."""

import re
from collections.abc import Mapping

from bottomlock.errors import ScenarioError
from bottomlock.ports.mavlink import ONBOARD_COMPUTER, dialect
from bottomlock.units import ns_from_s

AUTOPILOT = 1
"""MAV_COMP_ID_AUTOPILOT1."""
AGAIN_S = 10.0
"""Time after which it is asked again: an autopilot forgets it at a restart, and a line may lose a message."""
# A HEARTBEAT of MAVLink 2 or 1 by its length, component and number; the library checks the rest of it.
_HEARTBEAT = re.compile(rb"\xfd\x09.{4}\x01\x00\x00\x00|\xfe\x09..\x01\x00", re.DOTALL)


class MessageIntervals:
    """MAV_CMD_SET_MESSAGE_INTERVAL in answer to an autopilot's HEARTBEAT, at most every `AGAIN_S`.

    Args:
        rates_hz: of each message by its name in MAVLink.

    Raises:
        ScenarioError: where pymavlink is not installed, or for a name that is none of its messages.
    """

    def __init__(self, rates_hz: Mapping[str, float]) -> None:
        self._dialect = dialect()
        self._link = self._dialect.MAVLink(None, srcSystem=1, srcComponent=ONBOARD_COMPUTER)
        self._intervals_us = {self._number(name): 1e6 / rate for name, rate in rates_hz.items()}
        self._asked_ns: int | None = None

    def _number(self, name: str) -> int:
        number = getattr(self._dialect, f"MAVLINK_MSG_ID_{name}", None)
        if number is None:
            raise ScenarioError(f"MAVLink has no message '{name}'")
        return int(number)

    def answers(self, data: bytes, now_ns: int) -> bytes:
        """What to send back on these bytes, whole messages at `now_ns` of a clock that never falls; mostly nothing."""
        if self._asked_ns is not None and now_ns - self._asked_ns < ns_from_s(AGAIN_S):
            return b""
        if not _HEARTBEAT.search(data):
            return b""
        parser = self._dialect.MAVLink(None)
        parser.robust_parsing = True
        for message in parser.parse_buffer(data) or []:
            if message.get_type() == "HEARTBEAT" and message.get_srcComponent() == AUTOPILOT:
                self._asked_ns = now_ns
                return b"".join(
                    self._ask(message.get_srcSystem(), *one) for one in self._intervals_us.items()
                )
        return b""

    def _ask(self, system: int, number: int, interval_us: float) -> bytes:
        command = self._dialect.MAVLink_command_long_message(
            system,
            AUTOPILOT,
            self._dialect.MAV_CMD_SET_MESSAGE_INTERVAL,
            0,
            number,
            interval_us,
            0,
            0,
            0,
            0,
            0,
        )
        data = bytes(command.pack(self._link))
        self._link.seq = (self._link.seq + 1) % 256
        return data
