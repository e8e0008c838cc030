"""An attitude or heading reference with slow errors beside the inertial readings of `live`."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bottomlock.live.config import LiveConfig, parse_config
from bottomlock.live.engine import Engine
from bottomlock.live.health import metrics, status
from bottomlock.live.readings import PingReader
from bottomlock.live.runner import Live
from bottomlock.recordings.rotation import angles
from tests.dive import Dive, drawn_dive
from tests.dive_logs import write_a50
from tests.live.world import START_NS, Arrivals, fly, navigator_of

SECONDS = 40.0
TEXT = """
name = "test"
mode = "navigation"
dvl.geometry = "waterlinked_a50"
dvl.beam_noise_mps = 0.008
[origin]
latitude_deg = 45.0
gravity = 9.8062
[imu]
rate_hz = 50
accel_bias_mg = 1.0
gyro_bias_deg_per_h = 20.0
accel_noise_mps_per_rt_h = 0.09
gyro_noise_deg_per_rt_h = 0.25
[attitude]
aids = "heading"
roll_pitch_sd_deg = 0.2
yaw_sd_deg = 0.3
roll_pitch_offset_sd_deg = 0.5
yaw_offset_sd_deg = 4.0
yaw_walk_sd_deg = 1.0
walk_time_s = 100.0
[start]
level = "attitude"
velocity = "given"
[[source]]
name = "dvl"
address = "tcp:127.0.0.1:9"
format = "waterlinked-json"
rate_hz = 4
clock = "host"
[[source]]
name = "imu"
address = "udpin:127.0.0.1:9"
format = "imu-csv"
rate_hz = 50
clock = "host"
[[source]]
name = "ahrs"
address = "udpin:127.0.0.1:10"
format = "attitude-csv"
rate_hz = 10
clock = "host"
[[port]]
port = "probe"
to = "udpout:127.0.0.1:9"
rate_hz = 10
"""
HEADING = 'level = "attitude"\nheading_deg = 34.377467707849394\nheading_sd_deg = 0.5'
"""That of the dive's calm start, as one that is known, in place of the reference's."""
DVL, IMU, AHRS = range(3)


def made(*changes: tuple[str, str]) -> LiveConfig:
    text = TEXT
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return parse_config(text, place="test")


@lru_cache(maxsize=4)
def dive(seed: int = 5, seconds: float = SECONDS) -> Dive:
    return drawn_dive(seed, seconds=seconds)


def readings(flown: Dive, yaw_offset_deg: float, seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Times, s, and angles (n, 3), rad, of the reference at 10 Hz: white noise, and offsets of yaw and tilt."""
    # Between inertial readings, so that none is of the very start.
    t = flown.imu_s[:-1:5] + 0.005
    rpy = flown.at(t, flown.rpy)
    noise = np.deg2rad([0.2, 0.2, 0.3]) * np.random.default_rng(seed).standard_normal(rpy.shape)
    return t, rpy + noise + np.deg2rad([0.3, -0.3, yaw_offset_deg])


def stamp(seconds: float) -> int:
    """On the host's clock, in whole microseconds, as the DVL has them."""
    return START_NS + round(seconds * 1e6) * 1000


def arrivals(flown: Dive, t: np.ndarray, rpy: np.ndarray, folder: Path) -> Arrivals:
    """All that arrives: inertial readings after 2 ms, pings after 60 ms, attitudes after 20 to 420 ms, unsorted."""
    late_s = np.random.default_rng(9).uniform(0.02, 0.42, len(t))
    # What has not come by then is no part of a start, and a replay has all of it.
    late_s[t < 1.0] = 0.001
    entries: Arrivals = []
    for second, w, f in zip(flown.imu_s, flown.omega, flown.force, strict=True):
        line = f"{stamp(second)}," + ",".join(map(repr, [*w.tolist(), *f.tolist()]))
        entries.append((stamp(second) + 2_000_000, IMU, line.encode() + b"\n"))
    for second, angles_rad, delay in zip(t, rpy, late_s, strict=True):
        line = f"{stamp(second)}," + ",".join(map(repr, angles_rad.tolist()))
        entries.append((stamp(second) + round(delay * 1e9), AHRS, line.encode() + b"\n"))
    log = write_a50(flown, folder / "dvl.log", start_s=START_NS * 1e-9).read_bytes().splitlines(keepends=True)
    for report in log:
        (ping,) = PingReader("waterlinked-json", 4).feed(report)
        entries.append((ping.time_ns + 60_000_000, DVL, report))
    # The last that arrives is an inertial reading, after which the state is that of a vehicle under way.
    last_ns = max(arrival_ns for arrival_ns, source, _ in entries if source == IMU)
    return sorted((entry for entry in entries if entry[0] <= last_ns), key=lambda entry: entry[:2])


def flown(config: LiveConfig, entries: Arrivals) -> Engine:
    engine = Engine(config)
    fly(engine, entries)
    return engine


@pytest.fixture(scope="module")
def entries(tmp_path_factory: pytest.TempPathFactory) -> Arrivals:
    return arrivals(dive(), *readings(dive(), 3.0), tmp_path_factory.mktemp("dive"))


def yaw_error_and_sd(engine: Engine, truth_rad: float) -> tuple[float, float]:
    navigator = navigator_of(engine)
    yaw = angles(np.asarray(navigator.state()["attitude_t_p"]))[2]
    error = (yaw - truth_rad + np.pi) % (2.0 * np.pi) - np.pi
    return error, float(np.sqrt(navigator.covariance()[5, 5]))


def test_the_slow_error_is_found(entries: Arrivals) -> None:
    """A start with a known heading and readings that are 3 degrees off: they are told apart, within the claim."""
    engine = flown(made(('level = "attitude"', HEADING)), entries)
    found = engine.estimator.known()["reference"]["yaw"]
    error, sd = (np.rad2deg(found[key]) for key in ("error_rad", "sd_rad"))
    assert 0.2 < sd < 1.0
    assert abs(error - 3.0) < 2.5 * sd
    assert abs(error) > 3.0 * sd
    yaw, yaw_sd = yaw_error_and_sd(engine, dive().rpy[-1, 2])
    assert abs(yaw) < 2.5 * yaw_sd
    shown = status(Live(engine.config, engine, say=lambda _: None, send=lambda _: None))
    assert list(shown["reference"]) == ["yaw"]
    assert shown["reference"]["yaw"]["error_rad"] == pytest.approx(np.deg2rad(error))
    assert f'bottomlock_reference_error_rad{{angle="yaw"}} {np.deg2rad(error):.9g}' in metrics(shown)


def test_a_reading_far_off_is_rejected_and_shown(entries: Arrivals) -> None:
    """Half a turn for one reading: the gate rejects it, the page counts it, and nothing else changes."""
    clean = flown(made(), entries)
    time_ns = stamp(30.05)
    far = (time_ns + 20_000_000, AHRS, f"{time_ns},0.0,0.0,{float(dive().rpy[1502, 2] + np.pi)!r}\n".encode())
    engine = flown(made(), sorted([*entries, far], key=lambda entry: entry[:2]))
    assert engine.estimator.doubts.gated["heading"] == clean.estimator.doubts.gated["heading"] + 1
    assert engine.state == "OK"
    shown = status(Live(engine.config, engine, say=lambda _: None, send=lambda _: None))
    assert shown["gated"] == {"heading": engine.estimator.doubts.gated["heading"]}
    assert f'bottomlock_gated_total{{sensor="heading"}} {shown["gated"]["heading"]}\n' in metrics(shown)
    np.testing.assert_allclose(
        navigator_of(engine).state()["position_t_m"], navigator_of(clean).state()["position_t_m"], atol=1e-9
    )


@pytest.mark.parametrize("level", ["levelling", "attitude"])
def test_a_start_by_the_latest_attitude_that_is_not_after_it(entries: Arrivals, level: str) -> None:
    """Levelled or by the attitude; the yaw is that of the last reading before the start, as in a replay."""
    config = made(('level = "attitude"', f'level = "{level}"\nwindow_s = 3.0'))
    engine, last = Engine(config), (0, np.zeros(3))
    for arrival_ns, source, data in entries:
        if engine.estimator.time_ns is None and source == AHRS:
            time, *values = data.decode().split(",")
            if int(time) > last[0]:
                last = int(time), np.array([float(value) for value in values])
        engine.arrive(source, arrival_ns, data)
        if engine.estimator.time_ns is not None:
            break
    started = angles(np.asarray(navigator_of(engine).state()["attitude_t_p"]))
    assert started[2] == pytest.approx(last[1][2], abs=1e-9)
    sd = np.rad2deg(np.sqrt(np.diag(navigator_of(engine).covariance())[3:6]))
    assert sd[2] == pytest.approx(3.0 * np.sqrt(0.3**2 + 4.0**2 + 1.0**2))
    if level == "attitude":
        np.testing.assert_allclose(started, last[1], atol=1e-12)
        assert sd[0] == pytest.approx(np.hypot(0.2, 0.5))
    else:
        # The accelerometers' bias is a milligee, and the reference's offset of 0.3 degrees is not in it.
        assert np.rad2deg(np.abs(started[:2] - dive().rpy[0, :2])).max() < 0.2
        assert sd[0] == pytest.approx(1.0)


def test_a_start_with_the_mounting_and_the_declination_of_the_reference(entries: Arrivals) -> None:
    """R = Rz(offset) R_sensor R_mounting⁻¹, of the reading by which the same dive starts without them."""
    keys = "yaw_offset_sd_deg = 4.0\nmounting_yaw_deg = 2.0\nmounting_roll_deg = 1.0\nyaw_offset_deg = 1.5"
    starts = []
    for config in (made(), made(("yaw_offset_sd_deg = 4.0", keys))):
        engine, came = Engine(config), iter(entries)
        while engine.estimator.time_ns is None:
            arrival_ns, source, data = next(came)
            engine.arrive(source, arrival_ns, data)
        attitude = navigator_of(engine).state()["attitude_t_p"]
        starts.append(Rotation.from_quat(attitude, scalar_first=True))
    mounting, north = (
        Rotation.from_euler("ZYX", [2.0, 0.0, 1.0], degrees=True),
        Rotation.from_euler("Z", np.deg2rad(1.5)),
    )
    assert ((north * starts[0] * mounting.inv()).inv() * starts[1]).magnitude() < 1e-9
