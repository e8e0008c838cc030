"""Inertial and depth readings from lines and from MAVLink: what is not one is counted."""

from __future__ import annotations

import json
import os

import pytest

from bottomlock.io.sentences import xor_of
from bottomlock.live.engine import Engine
from bottomlock.live.readings import LineReader, MavlinkReader, PingReader
from bottomlock.live.sections import DepthSection
from bottomlock.recordings.readings import DepthReading, ImuReading
from tests.live.world import START_NS, World, config

IMU = b"1000,0.1,-0.2,0.3,0.01,0.02,-9.81"


def test_lines() -> None:
    """Seven numbers, in any pieces."""
    reader = LineReader("imu-csv")
    assert reader.feed(IMU[:9]) == []
    (found,) = reader.feed(IMU[9:] + b"\r\n2000,")
    assert found == ImuReading(1000, (0.1, -0.2, 0.3), (0.01, 0.02, -9.81))
    assert LineReader("depth-csv").feed(b"5,12.5\n") == [DepthReading(5, 12.5)]


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        (IMU[:-6], "not the columns time_ns,wx,wy,wz,fx,fy,fz"),
        (IMU + b",1", "not the columns time_ns,wx,wy,wz,fx,fy,fz"),
        (IMU.replace(b"0.1", b"nan"), "not a time in ns and finite numbers"),
        (IMU.replace(b"0.1", b"1e999"), "not a time in ns and finite numbers"),
        (IMU.replace(b"0.1", b"3e38"), "numbers that are no time_ns,wx,wy,wz,fx,fy,fz"),
        (IMU.replace(b"1000", b"10.5"), "not a time in ns and finite numbers"),
        (IMU.replace(b"1000", b"9" * 19), "not a time in ns and finite numbers"),
        (IMU[:-1] + b"*%02x" % xor_of(IMU), "bad checksum"),
    ],
)
def test_lines_that_are_none(line: bytes, reason: str) -> None:
    """Counted by reason; the next line is read."""
    reader = LineReader("imu-csv")
    assert len(reader.feed(line + b"\n" + IMU + b"*%02X\n" % xor_of(IMU))) == 1
    assert dict(reader.skipped) == {reason: 1}


def test_once_a_line_has_a_checksum_every_line_must() -> None:
    """A line that was cut before its checksum, or joined from two, is no reading; nor is a first one if so set."""
    whole = IMU + b"*%02X\n" % xor_of(IMU)
    joined = IMU[:11] + b"5" + IMU[IMU.index(b",0.3") :] + b"\n"
    assert len(LineReader("imu-csv").feed(joined)) == 1
    for reader, begins in (
        (LineReader("imu-csv"), whole),
        (LineReader("imu-csv", checksum=True), IMU + b"\n"),
    ):
        reader.feed(begins)
        assert reader.feed(joined + IMU[:-2] + b"\n") == []
        assert reader.skipped["no checksum"] == 2 + (begins != whole)
        assert len(reader.feed(whole)) == 1


def test_a_stream_that_begins_within_a_line() -> None:
    """What is before the first end of a line is dropped: it would be a reading at another time."""
    reader = LineReader("imu-csv", within=True)
    assert reader.feed(IMU[2:] + b"\n" + IMU) == []
    assert reader.feed(b"\n") == [ImuReading(1000, (0.1, -0.2, 0.3), (0.01, 0.02, -9.81))]
    reader.reset()
    assert reader.feed(IMU[1:] + b"\n") == []
    assert reader.framer.dropped == len(IMU) - 2 + len(IMU) - 1


def test_mavlink() -> None:
    """HIGHRES_IMU in SI as it stands, the chosen pressure as a depth, other messages passed over, in any pieces."""
    os.environ.setdefault("MAVLINK20", "1")
    dialect = pytest.importorskip("pymavlink.dialects.v20.ardupilotmega")
    link = dialect.MAVLink(None)
    messages = [
        dialect.MAVLink_highres_imu_message(5_000, 0.5, 0.25, -9.75, 0.125, 0.0, -0.5, *[0.0] * 7, 0xFFFF),
        dialect.MAVLink_scaled_pressure2_message(6, 1013.25 + 1005.525, 0.0, 0),
        dialect.MAVLink_scaled_pressure_message(6, 900.0, 0.0, 0),
        dialect.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3),
    ]
    stream = b"\x00\x01" + b"".join(message.pack(link) for message in messages)
    for step in (1, 7, len(stream)):
        reader = MavlinkReader(DepthSection(message="SCALED_PRESSURE2"), 9.81)
        found = [r for at in range(0, len(stream), step) for r in reader.feed(stream[at : at + step])]
        imu, depth = found
        assert imu == ImuReading(5_000_000, (0.125, 0.0, -0.5), (0.5, 0.25, -9.75))
        assert isinstance(depth, DepthReading)
        assert depth.time_ns == 6_000_000
        assert depth.depth_m == pytest.approx(100_552.5 / (1025.0 * 9.81), rel=1e-6)
        assert reader.records == 4
        assert reader.framer.dropped > 0


def test_what_is_not_used_of_a_ping_is_counted() -> None:
    """A time of sending that is none, a beam of 0 m/s without a distance, and a flag that is none."""
    report = json.loads(next(World(0.1).dvl())[2])
    report["time_of_transmission"] = 10**17
    report["transducers"][0] |= {"velocity": 0.0, "distance": -1.0}
    report["transducers"][1]["beam_valid"] = 1
    reader = PingReader("waterlinked-json", 4)
    (ping,) = reader.feed(json.dumps(report).encode() + b"\n")
    assert ping.transmission_ns == ping.time_ns
    assert ping.valid.tolist() == [False, False, True, True]
    assert dict(reader.flagged) == {
        "sent at a time that is not near its own": 1,
        "velocity is a code for no reading": 1,
        "transducer without beam_valid": 1,
    }


def test_each_message_of_an_autopilot_has_its_own_clock() -> None:
    """Inertial readings since 1970, pressures since boot, whose count of ms wraps: a second of these is not used."""
    dialect = pytest.importorskip("pymavlink.dialects.v20.ardupilotmega")
    link, change = dialect.MAVLink(None), ('format = "imu-csv"', 'format = "mavlink"')
    engine = Engine(config("navigation", extra="[depth]\n", change=change, to="stdout"))
    for k in range(300):
        inertial = dialect.MAVLink_highres_imu_message(
            START_NS // 1000 + 10_000 * k, 0, 0, -9.8, *[0.0] * 10, 63
        )
        pressure = dialect.MAVLink_scaled_pressure_message((2**32 - 1000 + 10 * k) % 2**32, 1013.25, 0.0, 0)
        data = bytes(inertial.pack(link)) + bytes(pressure.pack(link))
        engine.arrive(1, START_NS + 10_000_000 * k, data)
    autopilot = engine.sources[1]
    assert sum(autopilot.refused.values()) == 600 - autopilot.used
    assert 90 <= 600 - autopilot.used <= 110
    assert autopilot.clock_steps == 1
