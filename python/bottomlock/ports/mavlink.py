"""What the MAVLink 2 messages share, by pymavlink (extra `mavlink`).

The dialect module of version 2 is used whatever `MAVLINK20` says: ODOMETRY and the covariance of VISION_SPEED_ESTIMATE
exist in version 2 only. Numbers are 32-bit floats; a variance is rounded up to one.

Sources: message definitions of MAVLink (common.xml, ardupilotmega.xml). What the receivers do: AP_VisualOdom,
NavEKF3_core::writeBodyFrameOdom, and PX4's ekf2 (docs/ports.md).
"""

import re
from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import Field

from bottomlock.errors import ScenarioError
from bottomlock.libraries import mavlink
from bottomlock.ports.estimate import Estimate, Floats
from bottomlock.ports.port import Port, RateHz
from bottomlock.units import ns_from_s

MAX_RATE_HZ: float = 10.0
VARIANCE_FACTOR: float = 2.0
"""PX4 begins to aid only while two messages are less than 200 ms apart, ArduPilot while the last one is younger than
that: 5 Hz is too slow for both. Twice the messages with twice the variance say as much (docs/ports.md)."""

VISUAL_INERTIAL_ODOMETRY = 197
"""MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY."""


def dialect() -> Any:  # noqa: ANN401 - the library is not typed
    """The library's module of the dialect "ardupilotmega", version 2; ScenarioError where it is not installed."""
    return mavlink(ScenarioError)


def packed(link: Any, message: Any) -> bytes:  # noqa: ANN401 - the library is not typed
    """The bytes of a message with the next number of its sender."""
    data = bytes(message.pack(link))
    link.seq = (link.seq + 1) % 256
    return data


_Address = Annotated[int, Field(ge=1, le=255)]


class MavlinkPort(Port):
    """Base of the MAVLink ports.

    The autopilot estimates from the same inertial sensors as mode navigation: consecutive errors of ours are alike, and
    each message counts as a new one. In mode velocity every ping is a new measurement, and none is held back.
    """

    max_rate_hz: RateHz | None = MAX_RATE_HZ
    """most messages a second in mode navigation"""
    system_id: _Address = 1
    """of the sender"""
    component_id: _Address = VISUAL_INERTIAL_ODOMETRY
    """of the sender"""

    def model_post_init(self, _context: Any, /) -> None:  # noqa: ANN401 - pydantic's
        """Begins a sequence of messages."""
        super().model_post_init(_context)
        self._dialect = dialect()
        self._link = self._dialect.MAVLink(None, srcSystem=self.system_id, srcComponent=self.component_id)

    @property
    def sender(self) -> tuple[int, int]:
        """System and component, by which a receiver counts messages."""
        return self._link.srcSystem, self._link.srcComponent

    def counts_with(self, other: Self) -> None:
        """Continues the sequence of another port of the same sender, since a receiver takes two for lost messages."""
        self._link = other._link

    def _waits(self, estimate: Estimate) -> str | None:
        return super()._waits(estimate) if estimate.mode == "navigation" else None

    def _pack(self, message: Any) -> bytes:  # noqa: ANN401 - the library is not typed
        return packed(self._link, message)


class MavlinkVelocity(MavlinkPort):
    """Base of those that send a velocity with its covariance."""

    variance_factor: Annotated[float, Field(ge=1, allow_inf_nan=False)] = VARIANCE_FACTOR
    """factor on the covariance in mode navigation"""

    def _covariance(self, estimate: Estimate) -> Floats:
        """(3, 3) of the velocity, with the factor of mode navigation."""
        factor = self.variance_factor if estimate.mode == "navigation" else 1.0
        return estimate.covariance_m2ps2 * factor

    def _above(self, sd_mps: float, noise_mps: float | None) -> str | None:
        """Why a receiver with a σ of its own, `noise_mps`, gets no estimate; None for one without, or where it may."""
        if noise_mps is None or sd_mps <= noise_mps:
            return None
        return f"σ is {sd_mps:.3f} m/s, above receiver_noise_mps, {noise_mps}, which the receiver would use"


ONBOARD_COMPUTER = 191
"""MAV_COMP_ID_ONBOARD_COMPUTER."""
_TIMESYNC = 111


class _Onboard:
    """Base of what is sent beside estimates: by an onboard computer, so that these count without gaps."""

    def __init__(self) -> None:
        self._dialect = dialect()
        self._link = self._dialect.MAVLink(None, srcSystem=1, srcComponent=ONBOARD_COMPUTER)

    def _read(self, data: bytes) -> list[Any]:
        parser = self._dialect.MAVLink(None)
        parser.robust_parsing = True
        return parser.parse_buffer(data) or []


class Heartbeat(_Onboard):
    """HEARTBEAT of an onboard computer, for who sends to those that speak."""

    def __call__(self) -> bytes:
        """The next one."""
        kind, none = self._dialect.MAV_TYPE_ONBOARD_CONTROLLER, self._dialect.MAV_AUTOPILOT_INVALID
        active = self._dialect.MAV_STATE_ACTIVE
        return packed(self._link, self._dialect.MAVLink_heartbeat_message(kind, none, 0, 0, active, 3))


class Timesync(_Onboard):
    """Answers to an autopilot's TIMESYNC, by which it puts our stamps on its own clock.

    PX4 asks ten times a second; without answers it takes a message as of its arrival.
    """

    def answers(self, data: bytes, now_ns: int) -> bytes:
        """What to send back on these bytes, whole messages at `now_ns` of the clock of our stamps; mostly nothing."""
        if _TIMESYNC not in data:
            return b""
        return b"".join(
            packed(self._link, self._dialect.MAVLink_timesync_message(tc1=now_ns, ts1=message.ts1))
            for message in self._read(data)
            if message.get_type() == "TIMESYNC" and message.tc1 == 0
        )


AUTOPILOT = 1
"""MAV_COMP_ID_AUTOPILOT1."""
AGAIN_S = 10.0
"""Time after which it is asked again: an autopilot forgets it at a restart, and a line may lose a message."""
# A HEARTBEAT of MAVLink 2 or 1 by its length, component and number; the library checks the rest of it.
_HEARTBEAT = re.compile(rb"\xfd\x09.{4}\x01\x00\x00\x00|\xfe\x09..\x01\x00", re.DOTALL)


class MessageIntervals(_Onboard):
    """MAV_CMD_SET_MESSAGE_INTERVAL in answer to an autopilot's HEARTBEAT, at most every `AGAIN_S`.

    Args:
        rates_hz: of each message by its name in MAVLink.
        system: of the autopilot; None for any.

    Raises:
        ScenarioError: where pymavlink is not installed, or for a name that is none of its messages.
    """

    def __init__(self, rates_hz: Mapping[str, float], system: int | None = None) -> None:
        super().__init__()
        self._system = system
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
        for message in self._read(data) if _HEARTBEAT.search(data) else ():
            sender = message.get_srcSystem(), message.get_srcComponent()
            if message.get_type() == "HEARTBEAT" and sender == (self._system or sender[0], AUTOPILOT):
                self._asked_ns = now_ns
                return b"".join(self._ask(sender[0], *one) for one in self._intervals_us.items())
        return b""

    def _ask(self, system: int, number: int, interval_us: float) -> bytes:
        interval, unused = self._dialect.MAV_CMD_SET_MESSAGE_INTERVAL, [0] * 5
        make = self._dialect.MAVLink_command_long_message
        return packed(self._link, make(system, AUTOPILOT, interval, 0, number, interval_us, *unused))
