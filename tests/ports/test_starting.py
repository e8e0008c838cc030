"""What decides whether a receiver begins at all: rates, intervals, clocks, line ends, sequences, advice.

Each of these was found with receivers that nobody here wrote: PX4's EKF2 compiled and run, the makers' own clients.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega

from bottomlock.live.config import cautions, parse_config
from bottomlock.live.templates import AUTOPILOTS, template
from bottomlock.ports.mavlink import Timesync
from bottomlock.ports.registry import port
from tests.live.world import text_of
from tests.ports.cases import JANUS, MASKS, SECOND, START, TRUTH, from_beams, navigated
from tests.ports.receivers import (
    Px4,
    Receiver,
    blueos_way_m,
    lost_by_sequence,
    px4_timesync,
    waterlinked_client,
)


def offered(seconds: float, dvl_hz: float, *, estimate_hz: float = 20.0) -> list[int]:
    """Times at which mode navigation gives the ports an estimate: `estimate_hz` and after each ping."""
    steady = np.arange(0.0, seconds, 1.0 / estimate_hz)
    pings = np.arange(0.013, seconds, 1.0 / dvl_hz)
    times = np.unique(np.round(np.concatenate((steady, pings)) * 1e9).astype(np.int64))
    return [START + int(time) for time in times]


@pytest.mark.first_cases(4)
@pytest.mark.parametrize("synchronised", [True, False])
@pytest.mark.parametrize("dvl_hz", [2.0, 3.0, 4.0, 5.0, 7.0, 12.0])
def test_px4_starts_and_stays_with_the_default_rate(dvl_hz: float, synchronised: bool) -> None:
    """Whatever the DVL's rate, by stamps and by arrival with 30 ms of jitter; once in a minute, and never anew."""
    random = np.random.default_rng(3)
    one, px4 = port("odometry"), Px4(Receiver(TRUTH.copy()), synchronised=synchronised)
    for time_ns in offered(60.0, dvl_hz):
        data = one.encode(navigated(time_ns))
        if data is not None:
            px4.message(data, (time_ns - START) / SECOND + 0.03 * random.random())
    assert (px4.starts, px4.active) == (1, True)


def test_timesync_is_answered_by_its_definition() -> None:
    """PX4's offset is that of the clocks to half the way there and back; other messages are not answered."""
    timesync, asks = Timesync(), ardupilotmega.MAVLink(None, srcSystem=1, srcComponent=1)
    own_ns, ours_ns = 5 * SECOND, START
    request = bytes(ardupilotmega.MAVLink_timesync_message(tc1=0, ts1=own_ns).pack(asks))
    heartbeat = bytes(ardupilotmega.MAVLink_heartbeat_message(2, 12, 81, 0, 3, 3).pack(asks))
    answer = timesync.answers(heartbeat + request, ours_ns + 1_000_000)
    assert px4_timesync(own_ns, answer, own_ns + 2_000_000) == pytest.approx(own_ns - ours_ns, abs=1)
    for other in (
        heartbeat,
        bytes(ardupilotmega.MAVLink_timesync_message(tc1=7, ts1=8).pack(asks)),
        b"\x6f" * 40,
        b"",
    ):
        assert timesync.answers(other, ours_ns) == b""
    # Component and sequence of its own: the estimates count without gaps.
    again = timesync.answers(request, ours_ns)
    assert (answer[4], again[4], answer[6]) == (0, 1, 191)


def test_two_ports_to_one_receiver_count_together() -> None:
    """One sequence of one sender: no message is taken for lost. To another place, or as another component, apart."""
    text = text_of("navigation").replace(
        'port = "probe"',
        'port = "odometry"\nsettings.receiver = "ardupilot"\nsettings.receiver_noise_mps = 9.0',
    )
    text += '[[port]]\nport = "vision_speed_estimate"\nto = "udpout:127.0.0.1:9"\nrate_hz = 10\n'
    ports = parse_config(text, place="test").ports()
    sent = [
        data for k in range(20) for one in ports if (data := one.encode(navigated(START + k * SECOND // 5)))
    ]
    assert len(sent) == 40
    assert lost_by_sequence(sent) == 0
    for other in ('to = "udpout:127.0.0.1:10"', 'to = "udpout:127.0.0.1:9"\nsettings.component_id = 198'):
        apart = text.rpartition('to = "udpout:127.0.0.1:9"')
        one, two = parse_config(apart[0] + other + apart[2], place="test").ports()
        first, second = one.encode(navigated(START)), two.encode(navigated(START))
        assert first is not None
        assert second is not None
        assert first[4] == second[4] == 0


@pytest.mark.parametrize(("settings", "count"), [({}, 300), ({"max_rate_hz": None}, 749)])
def test_the_makers_client_reads_every_report_and_the_way_adds_up(
    settings: dict[str, None], count: int
) -> None:
    """Mode navigation, estimates 53 ms apart and less, two beams: the way is that which the vehicle went.

    A client of a DVL may take no more than ten reports a second: the default.
    """
    one = port("waterlinked_json", geometry=JANUS, **settings)
    beams = from_beams(MASKS["2 neighbours"]).beams
    small = np.diag([0.01, 0.02, 0.005]) ** 2
    times = offered(30.0, 5.0)
    messages = [
        (time_ns, one.encode(navigated(time_ns, beams=beams, covariance_m2ps2=small))) for time_ns in times
    ]
    sent = [(time_ns, data) for time_ns, data in messages if data is not None]
    reports = waterlinked_client(b"".join(data for _, data in sent))
    assert len(reports) == len(sent) == count
    np.testing.assert_allclose(blueos_way_m(reports), TRUTH * (sent[-1][0] - times[0]) / SECOND, rtol=1e-9)


def test_the_way_of_mode_velocity_adds_up_over_lost_pings() -> None:
    """A ping that cannot be sent belongs to the interval of the next."""
    one = port("waterlinked_json", geometry=JANUS)
    sent: list[bytes | None] = []
    for k in range(50):
        mask = MASKS["2 neighbours"] if k % 10 in {3, 4} else MASKS["4 beams"]
        sent.append(one.encode(from_beams(mask, START + k * SECOND // 5)))
    reports = waterlinked_client(b"".join(data for data in sent if data))
    assert len(reports) == 39
    np.testing.assert_allclose(blueos_way_m(reports), TRUTH * 49 / 5, rtol=1e-9)


def configuration(autopilot: str) -> Any:  # noqa: ANN401
    return parse_config(template("a50", autopilot), place="template")


def test_templates_send_what_their_receivers_take() -> None:
    """PX4's simulator listens on 14580 and sends to who speaks; robot_localization has no input for a velocity."""
    px4 = configuration("px4")
    assert (px4.port[0].to, px4.port[0].port) == ("udpout:127.0.0.1:14580", "odometry")
    assert [one.address for one in px4.source if one.format == "mavlink"] == [px4.port[0].to]
    assert configuration("ros2").port[0].port == "ros_twist"
    assert all(not cautions(configuration(name)) for name in AUTOPILOTS)
