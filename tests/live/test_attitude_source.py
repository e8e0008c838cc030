"""Live navigation without inertial readings: an attitude as lines or MAVLink, a DVL, and nothing else."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pytest

from bottomlock.kernel import Navigator
from bottomlock.live.config import LiveConfig, parse_config
from bottomlock.live.engine import Engine
from bottomlock.live.navigation import NavigationEstimator
from bottomlock.live.readings import MavlinkReader
from bottomlock.recordings.readings import AttitudeReading
from bottomlock.recordings.rotation import quaternion
from tests.live.world import (
    NAVIGATION_TOML,
    START_NS,
    VELOCITY,
    Sent,
    World,
    fly,
    navigator_of,
    one_to_three_beams,
    text_of,
)
from tests.live.world import lines as sent_lines

IMU = NAVIGATION_TOML[NAVIGATION_TOML.index("[imu]") : NAVIGATION_TOML.index("[start]")]
TEXT = (
    text_of("navigation")
    .replace(IMU, '[imu]\nsource = "attitude"\naccel_noise_mps_per_rt_h = 1.0\n[attitude]\n')
    .replace("heading_deg = 30.0\n", "")
    .replace('"imu-csv"\nrate_hz = 100', '"attitude-csv"\nrate_hz = 10')
)
TURN = math.radians(10.0)
"""Rate of the turn, rad/s."""


def made(text: str = TEXT) -> LiveConfig:
    return parse_config(text, place="test")


def angles(t: float) -> tuple[float, float, float]:
    """A turn to starboard with a steady roll and pitch."""
    return math.radians(3.0), math.radians(-5.0), math.radians(30.0) + TURN * t


def lines(seconds: float, hz: float = 10.0) -> Iterator[tuple[int, int, bytes]]:
    for k in range(round(seconds * hz)):
        own_ns = round(k * 1e9 / hz)
        numbers = ",".join(f"{value:.9g}" for value in angles(k / hz))
        yield START_NS + own_ns + 300_000, 1, f"{own_ns},{numbers}\n".encode()


def flown(world: World, attitudes: Iterator[tuple[int, int, bytes]]) -> tuple[Engine, list[Sent]]:
    engine = Engine(made())
    return engine, sent_lines(fly(engine, world.arrivals(attitudes)))


def test_a_turning_vehicle_coasts() -> None:
    """OK, PARTIAL, COASTING, OK; the velocity along the vehicle's axes stays while the vehicle turns by 15 degrees."""
    engine, sent = flown(World(10.0, one_to_three_beams), lines(10.0))
    states = [line.state for line in sent]
    assert states[:1] + [b for a, b in pairwise(states) if a != b] == ["OK", "PARTIAL", "COASTING", "OK"]
    errors = np.array([(line.velocity - VELOCITY) / line.sd for line in sent])
    assert np.abs(errors).max() < 5.0
    coasting = np.array([line.velocity for line in sent if line.state == "COASTING"])
    # The tangent frame would turn it by more than 0.2 m/s.
    assert np.abs(coasting - VELOCITY).max() < 0.05
    assert engine.estimator.resets == 0


def test_heading_and_way_are_the_attitudes() -> None:
    """After 10 s the filter's attitude is the last one, and the way is the arc."""
    engine, _ = flown(World(10.0), lines(10.0))
    state = navigator_of(engine).state()
    last = np.array(quaternion(*angles(9.9)))
    assert abs(abs(float(np.dot(state["attitude_t_p"], last))) - 1.0) < 1e-6
    assert 7.0 < np.linalg.norm(state["position_t_m"]) < 10.0


def test_quaternions_of_mavlink() -> None:
    """Scalar first; one that is no rotation is counted, and ATTITUDE in radians is the same rotation."""
    os.environ.setdefault("MAVLINK20", "1")
    dialect = pytest.importorskip("pymavlink.dialects.v20.ardupilotmega")
    link = dialect.MAVLink(None)
    half = math.sqrt(0.5)
    reader = MavlinkReader(None, 9.81, "ATTITUDE_QUATERNION")
    data = b"".join(
        bytes(dialect.MAVLink_attitude_quaternion_message(7, *q, 0.0, 0.0, 0.0).pack(link))
        for q in ((half, 0.0, 0.0, half), (0.0, 0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 1.0))
    )
    (found,) = reader.feed(data)
    assert isinstance(found, AttitudeReading)
    assert found.time_ns == 7_000_000
    np.testing.assert_allclose(found.attitude_t_s, (half, 0.0, 0.0, half), atol=1e-7)
    assert dict(reader.skipped) == {"ATTITUDE_QUATERNION without a unit quaternion": 2}
    assert MavlinkReader(None, 9.81).feed(data) == []
    euler = MavlinkReader(None, 9.81, "ATTITUDE")
    (same,) = euler.feed(
        bytes(dialect.MAVLink_attitude_message(7, 0.0, 0.0, math.pi / 2, 0.0, 0.0, 0.0).pack(link))
    )
    assert isinstance(same, AttitudeReading)
    np.testing.assert_allclose(same.attitude_t_s, found.attitude_t_s, atol=1e-7)


def test_a_gap_of_the_attitude_is_unsafe_and_goes_on() -> None:
    """Three seconds without an attitude: nothing is sent, and the next one is a gap with its uncertainty."""
    kept = [entry for entry in lines(10.0) if not 4.0 < (entry[0] - START_NS) * 1e-9 < 7.0]
    engine, sent = flown(World(10.0), iter(kept))
    times = np.array([line.time_ns - START_NS for line in sent]) * 1e-9
    assert not ((times > 4.5) & (times < 6.9)).any()
    assert sent[-1].state == "OK"
    assert np.abs(sent[-1].velocity - VELOCITY).max() < 0.05
    assert engine.estimator.resets == 0


def test_a_checkpoint_goes_on_from_its_attitude() -> None:
    """The two seconds between are a turn from the estimate's attitude to the first one that comes."""
    world = World(5.0)
    before, _ = flown(world, lines(5.0))
    saved = navigator_of(before).save()
    engine = Engine(made())
    assert isinstance(engine.estimator, NavigationEstimator)
    engine.estimator.continue_from(Navigator.load(saved))
    later = [one for one in World(9.0).arrivals(lines(9.0)) if one[0] - START_NS > 7_000_000_000]
    sent = sent_lines(fly(engine, later))
    assert sent[-1].state == "OK"
    attitude = navigator_of(engine).state()["attitude_t_p"]
    assert abs(float(np.dot(attitude, quaternion(*angles(8.9))))) == pytest.approx(1.0, abs=1e-6)
    assert np.abs(sent[-1].velocity - VELOCITY).max() < 0.05
