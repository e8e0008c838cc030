"""GPS and acoustic positions of `live`: lines, MAVLink, and what the filter makes of them."""

from __future__ import annotations

import os
from functools import cache

import numpy as np
import pytest

from bottomlock.geodesy import Place, geodetic_from_tangent
from bottomlock.live.config import LiveConfig, parse_config
from bottomlock.live.engine import Engine
from bottomlock.live.readings import LineReader, MavlinkReader
from bottomlock.recordings.readings import AcousticPositionReading, GpsReading
from tests.live.world import (
    LATITUDE_DEG,
    START_NS,
    VELOCITY,
    Arrivals,
    World,
    fly,
    navigator_of,
    text_of,
)

SECONDS, HEADING_RAD = 20.0, np.deg2rad(30.0)
HOME = Place(np.deg2rad(LATITUDE_DEG), np.deg2rad(35.0), 17.0)
AWAY_M = np.array([40.0, -25.0, 0.0])
"""Of the true start from that of the configuration, which allows for it."""
LEVER_M = np.array([1.0, 0.5, -2.0])
GPS = """
[gps]
position_sd_m = [0.5, 0.5, 1.0]
lever_arm_m = [1.0, 0.5, -2.0]
[[source]]
name = "gps"
address = "udpin:127.0.0.1:10"
format = "gps-csv"
rate_hz = 1
clock = "host"
"""
USBL = """
[acoustic_position]
sd_m = 0.5
lever_arm_m = [1.0, 0.5, -2.0]
[[source]]
name = "usbl"
address = "udpin:127.0.0.1:11"
format = "acoustic-csv"
rate_hz = 1
clock = "host"
"""


def navigation(extra: str = "", *, longitude: bool = True) -> LiveConfig:
    place = "\nlongitude_deg = 35.0\nheight_m = 17.0" if longitude else ""
    text = text_of("navigation").replace("origin.latitude_deg = 32.8\n", "")
    text = text.replace(
        "[start]\n", f"[origin]\nlatitude_deg = 32.8{place}\n[start]\nposition_sd_m = [50.0, 50.0, 1.0]\n"
    )
    return parse_config(text + extra, place="test")


def to_tangent() -> np.ndarray:
    c, s = np.cos(HEADING_RAD), np.sin(HEADING_RAD)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def truth_m(seconds: float) -> np.ndarray:
    return np.asarray(AWAY_M + to_tangent() @ VELOCITY * seconds)


def fixes(form: str, source: int, seed: int = 4) -> Arrivals:
    """Positions of the point at the lever arm, a second apart, with 0.5 m of noise, 0.3 s late."""
    random, lines = np.random.default_rng(seed), []
    for second in range(2, int(SECONDS)):
        time_ns = START_NS + second * 1_000_000_000 + 5_000_000
        at = truth_m(second + 0.005) + to_tangent() @ LEVER_M + 0.5 * random.standard_normal(3)
        numbers = at.tolist()
        if form == "gps":
            latitude, longitude, height = (
                float(part[0]) for part in geodetic_from_tangent(at[np.newaxis], HOME)
            )
            numbers = [np.rad2deg(latitude), np.rad2deg(longitude), height]
        line = f"{time_ns}," + ",".join(f"{number!r}" for number in map(float, numbers))
        lines.append((time_ns + 300_000_000, source, line.encode() + b"\n"))
    return lines


def position(settings: LiveConfig, more: Arrivals) -> tuple[np.ndarray, np.ndarray]:
    """Error and 1 sigma of the position at the end, m."""
    engine = Engine(settings)
    fly(engine, World(SECONDS).arrivals(more, imu=True))
    navigator = navigator_of(engine)
    state, covariance = navigator.state(), navigator.covariance()
    error = truth_m((state["time_ns"] - START_NS) * 1e-9) - state["position_t_m"]
    return np.asarray(error), np.sqrt(np.diag(covariance)[:3])


@cache
def unaided() -> tuple[np.ndarray, np.ndarray]:
    return position(navigation(), [])


@pytest.mark.parametrize(("form", "extra"), [("gps", GPS), ("usbl", USBL)])
def test_positions_bring_the_vehicle_where_it_is(form: str, extra: str) -> None:
    """Horizontally from 47 m off to within the claim of 0.3 m, the lever arm and the delay allowed for."""
    error, sd = position(navigation(extra), fixes(form, 2))
    assert (sd[:2] < 0.3).all()
    assert (np.abs(error[:2]) < 3.0 * sd[:2]).all()
    without, claimed = unaided()
    assert np.linalg.norm(without[:2]) > 40.0
    assert (claimed[:2] > 49.0).all()


def test_fixes_that_jump_are_not_ok_and_not_followed() -> None:
    """50 m for six seconds after eight that agreed: PARTIAL from the fourth on, and the position stays where it was."""
    jumped = [
        (at, source, _moved(line) if 10.0 < (at - START_NS) * 1e-9 < 16.1 else line)
        for at, source, line in fixes("usbl", 2)
    ]
    engine, found = Engine(navigation(USBL)), dict[int, set[str]]()
    for arrival_ns, source, data in World(SECONDS).arrivals(jumped, imu=True):
        engine.arrive(source, arrival_ns, data)
        found.setdefault((arrival_ns - START_NS) // 1_000_000_000, set()).add(engine.state)
    assert set().union(*(found[second] for second in range(6, 13))) == {"OK"}
    assert set().union(*(found[second] for second in range(14, 20))) == {"PARTIAL"}
    assert engine.machine.why == "acoustic position contradicted the estimate within the last 10 s"
    state = navigator_of(engine).state()
    error = truth_m((state["time_ns"] - START_NS) * 1e-9) - state["position_t_m"]
    assert np.linalg.norm(error) < 1.5


def _moved(line: bytes) -> bytes:
    time, north, *others = line.split(b",")
    return b",".join([time, repr(float(north) + 50.0).encode(), *others])


def test_lines() -> None:
    """Degrees and heights; positions with and without their sigma; what cannot be one is told."""
    gps, usbl = LineReader("gps-csv"), LineReader("acoustic-csv")
    assert gps.feed(b"7,54.5,-10.25,3\n") == [GpsReading(7, 54.5, -10.25, 3.0)]
    assert gps.feed(b"7,91,0,3\n7,0,361,3\n7,1,2\n") == []
    assert dict(gps.skipped) == {
        "numbers that are no time_ns,latitude_deg,longitude_deg,height_m": 2,
        "not the columns time_ns,latitude_deg,longitude_deg,height_m": 1,
    }
    assert usbl.feed(b"7,1,2,3\n8,1,2,3,0.5,0.6,0.7\n") == [
        AcousticPositionReading(7, (1.0, 2.0, 3.0), None),
        AcousticPositionReading(8, (1.0, 2.0, 3.0), (0.5, 0.6, 0.7)),
    ]
    assert usbl.feed(b"9,1,2,3,0.5,0,0.7\n9,1,2,3,4\n") == []
    assert sum(usbl.skipped.values()) == 2


def test_mavlink_gives_a_fix_in_three_dimensions() -> None:
    """1e-7 degrees and mm; a fix in two dimensions, and without [gps] every fix, is none."""
    os.environ.setdefault("MAVLINK20", "1")
    dialect = pytest.importorskip("pymavlink.dialects.v20.ardupilotmega")
    link = dialect.MAVLink(None)
    fixed = [545_000_000, -102_500_000, 3_000, 100, 100, 0, 0, 9]
    data = b"".join(dialect.MAVLink_gps_raw_int_message(5_000, kind, *fixed).pack(link) for kind in (3, 2))
    reader = MavlinkReader(None, 9.81, gps=True)
    (reading,) = reader.feed(data)
    assert isinstance(reading, GpsReading)
    assert (reading.time_ns, reading.height_m) == (5_000_000, 3.0)
    assert (reading.latitude_deg, reading.longitude_deg) == pytest.approx((54.5, -10.25), abs=1e-12)
    assert dict(reader.skipped) == {"GPS_RAW_INT without a fix in 3D": 1}
    assert MavlinkReader(None, 9.81).feed(data) == []
    engine = Engine(navigation(GPS.replace("gps-csv", "mavlink")))
    engine.arrive(2, START_NS, data)
    assert engine.sources[2].reader.skipped == reader.skipped
