"""An autopilot is asked for the messages that are read: by its heartbeat, in MAVLink, no more often than needed."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v10 import ardupilotmega as version_1
from pymavlink.dialects.v20 import ardupilotmega

from bottomlock.ports.mavlink import AGAIN_S, MessageIntervals

SECOND = 1_000_000_000


def heartbeat(system: int = 7, component: int = 1, dialect: object = ardupilotmega) -> bytes:
    link = dialect.MAVLink(None, srcSystem=system, srcComponent=component)  # type: ignore[attr-defined]
    return bytes(dialect.MAVLink_heartbeat_message(12, 3, 81, 0, 4, 3).pack(link))  # type: ignore[attr-defined]


def asked(data: bytes) -> list[tuple[int, int, int, float]]:
    """System, component, message and interval, us, of each command."""
    found = ardupilotmega.MAVLink(None).parse_buffer(data) or []
    assert all(one.get_type() == "COMMAND_LONG" and one.command == 511 for one in found)
    return [(one.target_system, one.target_component, int(one.param1), one.param2) for one in found]


@pytest.mark.parametrize("dialect", [ardupilotmega, version_1])
def test_each_message_is_asked_of_the_autopilot(dialect: object) -> None:
    """HIGHRES_IMU is message 105, ATTITUDE 30; the interval is in us, to the sender of the heartbeat."""
    one = MessageIntervals({"HIGHRES_IMU": 50.0, "ATTITUDE": 10.0})
    answer = one.answers(heartbeat(dialect=dialect), 0)
    assert asked(answer) == [(7, 1, 105, 20_000.0), (7, 1, 30, 100_000.0)]


def test_again_after_ten_seconds_and_not_before() -> None:
    """An autopilot that was restarted is asked anew; in between nothing is sent."""
    one = MessageIntervals({"HIGHRES_IMU": 50.0})
    times_s = [0.0, 1.0, AGAIN_S - 0.001, AGAIN_S, AGAIN_S + 1.0]
    assert [bool(one.answers(heartbeat(), round(at * SECOND))) for at in times_s] == [
        True,
        False,
        False,
        True,
        False,
    ]


def test_nobody_else_is_asked() -> None:
    """A ground station, a camera, another message, half a heartbeat and a damaged one are no autopilot."""
    one = MessageIntervals({"HIGHRES_IMU": 50.0})
    damaged = bytearray(heartbeat())
    damaged[-1] ^= 1
    link = ardupilotmega.MAVLink(None, srcSystem=7, srcComponent=1)
    attitude = bytes(ardupilotmega.MAVLink_attitude_message(0, 0, 0, 0, 0, 0, 0).pack(link))
    for data in (
        heartbeat(component=190),
        heartbeat(component=100),
        attitude,
        heartbeat()[:-3],
        bytes(damaged),
        b"",
    ):
        assert one.answers(data, 0) == b""
    assert one.answers(attitude + heartbeat() + attitude, 0)
