"""An attitude or heading reference with slow errors beside the inertial readings of `live`."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from scipy.spatial.transform import Rotation

from bottomlock.encoders.ping import Ping as Recorded
from bottomlock.encoders.registry import encoder
from bottomlock.errors import DataError, ScenarioError
from bottomlock.kernel import Navigator
from bottomlock.live.alignment import Alignment
from bottomlock.live.checkpoint import pack, resume
from bottomlock.live.config import LiveConfig, parse_config
from bottomlock.live.engine import Engine, Message
from bottomlock.live.health import metrics, status
from bottomlock.live.navigation import NavigationEstimator
from bottomlock.live.navigator_config import kernel_settings
from bottomlock.live.pings import PingReader
from bottomlock.live.platform_attitude import PlatformAttitude
from bottomlock.live.raw_log import RawLog
from bottomlock.live.readings import MavlinkReader
from bottomlock.live.replay import replay_log
from bottomlock.live.runner import Live
from bottomlock.live.sections import AttitudeSection, StartSection
from bottomlock.ports.rotation import angles, quaternion
from bottomlock.recordings.axes import from_angles, platform_attitude, quaternions
from bottomlock.recordings.readings import AttitudeReading, ImuReading, Ping
from bottomlock.replay import rerun
from bottomlock.replay.case import load_case
from bottomlock.replay.reading import read_streams
from tests.dive import Dive, drawn_dive
from tests.dive_logs import write_a50
from tests.live.world import START_NS, Sent
from tests.recorded_dives import stpere

SECONDS = 60.0
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
IMU_SOURCE = TEXT[TEXT.index('[[source]]\nname = "imu"') : TEXT.index('[[source]]\nname = "ahrs"')]
AHRS_SOURCE = TEXT[TEXT.index('[[source]]\nname = "ahrs"') : TEXT.index("[[port]]")]
HEADING = 'level = "attitude"\nheading_deg = 34.377467707849394\nheading_sd_deg = 0.5'
"""That of the dive's calm start, as one that is known, in place of the reference's."""
DVL, IMU, AHRS = range(3)
Arrivals = list[tuple[int, int, bytes]]


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


def fly(config: LiveConfig, entries: Arrivals) -> tuple[Engine, list[Message]]:
    engine, sent = Engine(config), []
    for arrival_ns, source, data in entries:
        sent += engine.arrive(source, arrival_ns, data)
    return engine, sent


def navigator_of(engine: Engine) -> Navigator:
    assert isinstance(engine.estimator, NavigationEstimator)
    assert engine.estimator.navigator is not None
    return engine.estimator.navigator


@pytest.fixture(scope="module")
def entries(tmp_path_factory: pytest.TempPathFactory) -> Arrivals:
    return arrivals(dive(), *readings(dive(), 3.0), tmp_path_factory.mktemp("dive"))


def parsed(entries: Arrivals, config: LiveConfig) -> Iterator[tuple[int, Any]]:
    """The readings and pings, by their own times."""
    own = Engine(config)
    for _, source, data in entries:
        yield from ((one.time_ns, one) for one in own.sources[source].reader.feed(data))


@pytest.mark.parametrize("aids", ["attitude", "heading"])
def test_a_navigator_that_is_given_them_in_order_has_the_same_bits(entries: Arrivals, aids: str) -> None:
    """Pings and attitudes come late and unsorted; state, covariance and slow error are those of the sorted readings."""
    config = made(('aids = "heading"', f'aids = "{aids}"'))
    engine, _ = fly(config, entries)
    assert isinstance(engine.estimator, NavigationEstimator)
    live = navigator_of(engine)
    first = Engine(config)
    for arrival_ns, source, data in entries:
        first.arrive(source, arrival_ns, data)
        if isinstance(first.estimator, NavigationEstimator) and first.estimator.navigator is not None:
            break
    start = navigator_of(first).state()
    settings = kernel_settings(config, config.instrument())
    model = settings.model
    assert config.attitude is not None
    platform = PlatformAttitude(config.attitude)
    sorted_ = Navigator(
        config.instrument().geometry, model, settings.options, start, method="tc", horizon_ns=2_000_000_000
    )
    begin_ns = start["time_ns"]
    order = {Ping: 1, AttitudeReading: 2, ImuReading: 0}
    for time_ns, one in sorted(parsed(entries, config), key=lambda pair: (pair[0], order[type(pair[1])])):
        if isinstance(one, ImuReading) and time_ns >= begin_ns:
            sorted_.push_imu(time_ns, omega_p_radps=one.omega_radps, force_p_mps2=one.force_mps2)
        elif time_ns <= begin_ns:
            continue
        elif isinstance(one, Ping):
            sorted_.push_beams(time_ns, one.velocity_mps, one.valid, sd_mps=np.full(4, 0.008))
        elif isinstance(one, AttitudeReading) and aids == "attitude":
            sorted_.push_attitude(
                time_ns,
                platform.of(one),
                roll_pitch_sd_rad=np.deg2rad(0.2),
                yaw_sd_rad=np.deg2rad(0.3),
            )
        elif isinstance(one, AttitudeReading):
            sorted_.push_heading(time_ns, angles(platform.of(one))[2], sd_rad=np.deg2rad(0.3))
    for name in ("position_t_m", "attitude_t_p", "velocity_p_mps", "gyro_bias_p_radps"):
        np.testing.assert_array_equal(live.state()[name], sorted_.state()[name])
    np.testing.assert_array_equal(live.covariance(), sorted_.covariance())
    error = live.attitude_error() if aids == "attitude" else live.heading_error()
    same = sorted_.attitude_error() if aids == "attitude" else sorted_.heading_error()
    assert error is not None
    assert same is not None
    np.testing.assert_array_equal(error["error_rad"], same["error_rad"])
    assert engine.sources[AHRS].used > 590


MOTION = """[filter.motion]
mean_sd_mps = [0.2, 0.2, 0.2]
change_sd_mps = [0.11, 0.019, 0.013]
change_time_s = [43.0, 10.0, 10.0]
"""
CASE = """
name = "aided"
[origin]
latitude_deg = 45.0
gravity = 9.8062
[imu]
file = "imu.csv"
clock = { column = "time_ns", unit = "ns" }
force = ["fx", "fy", "fz"]
omega = ["wx", "wy", "wz"]
[imu.errors]
accel_bias_mg = 1.0
gyro_bias_deg_per_h = 20.0
accel_noise_mps_per_rt_h = 0.09
gyro_noise_deg_per_rt_h = 0.25
[dvl]
file = "beams.csv"
geometry = "waterlinked_a50"
beam_noise_mps = 0.008
clock = { column = "time_ns", unit = "ns" }
[attitude]
file = "ahrs.csv"
clock = { column = "time_ns", unit = "ns" }
roll = "roll"
pitch = "pitch"
yaw = "yaw"
ATTITUDE
[start]
at_s = AT
level = "attitude"
heading = "attitude"
position_sd_m = [1.0, 1.0, 1.0]
velocity = "given"
velocity_sd_mps = [0.1, 0.1, 0.1]
[replay]
methods = ["tc"]
smooth = false
sample_s = 0.02
"""


def write_tables(entries: Arrivals, config: LiveConfig, folder: Path) -> None:
    """The readings of the same bytes as the tables of a case."""
    found: dict[type, list[Any]] = {Ping: [], AttitudeReading: [], ImuReading: []}
    for _, one in sorted(parsed(entries, config), key=lambda pair: pair[0]):
        found[type(one)].append(one)
    imu, ahrs, pings = found[ImuReading], found[AttitudeReading], found[Ping]

    def write(name: str, rows: list[Any], columns: tuple[str, ...], values: list[Any]) -> None:
        times = {"time_ns": np.array([one.time_ns for one in rows])}
        table = times | dict(zip(columns, np.array(values, dtype=float).T, strict=True))
        pl.DataFrame(table).fill_nan(None).write_csv(folder / f"{name}.csv")

    force = [(*one.omega_radps, *one.force_mps2) for one in imu]
    write("imu", imu, ("wx", "wy", "wz", "fx", "fy", "fz"), force)
    write("ahrs", ahrs, ("roll", "pitch", "yaw"), [angles(np.array(one.attitude_t_s)) for one in ahrs])
    numbers = range(1, config.instrument().geometry.beams + 1)
    columns = tuple(f"beam{k}_{what}" for what in ("mps", "valid") for k in numbers)
    beams = [(*np.where(one.valid, one.velocity_mps, np.nan), *one.valid) for one in pings]
    write("beams", pings, columns, beams)


@pytest.mark.parametrize("aids", ["attitude", "heading"])
def test_a_replay_of_the_same_readings_says_the_same(tmp_path: Path, aids: str) -> None:
    """State, 1 sigma and slow error to rounding, of a section with the same keys, mounting and declination included.

    For 15 s every beam is lost, which is when the prior of the motion is used.
    """
    flown = dive(5, 40.0)
    lost = (flown.ping_s > 18.0) & (flown.ping_s < 33.0)
    flown = replace(flown, beams=np.where(lost[:, None], np.nan, flown.beams))
    entries = arrivals(flown, *readings(flown, 3.0), tmp_path)
    section = (
        f'aids = "{aids}"\nroll_pitch_sd_deg = 0.2\nyaw_sd_deg = 0.3\nroll_pitch_offset_sd_deg = 0.5\n'
        "yaw_offset_sd_deg = 4.0\nyaw_walk_sd_deg = 1.0\nwalk_time_s = 100.0\n"
        "mounting_yaw_deg = 2.0\nmounting_roll_deg = 1.0\nyaw_offset_deg = 1.5\n"
    )
    given = TEXT[TEXT.index("[attitude]\n") + len("[attitude]\n") : TEXT.index("[start]")]
    config = made((given, section), ("[start]", MOTION + "[start]"))
    case = CASE.replace("ATTITUDE", section) + MOTION
    engine, result = flown_and_replayed(entries, config, case, tmp_path)
    if aids == "attitude":
        found = navigator_of(engine).attitude_error()
        assert found is not None
        np.testing.assert_allclose(result["attitude_error"][0, -1], found["error_rad"], atol=1e-9)


def flown_and_replayed(entries: Arrivals, config: LiveConfig, case: str, folder: Path) -> tuple[Engine, Any]:
    """The engine and the kernel's results of a replay of the same readings, which end in the same state."""
    engine = Engine(config)
    begun = 0
    for arrival_ns, source, data in entries:
        engine.arrive(source, arrival_ns, data)
        begun = begun or engine.estimator.time_ns or 0
    write_tables(entries, config, folder)
    first_ns = min(time_ns for time_ns, one in parsed(entries, config) if isinstance(one, ImuReading))
    (folder / "case.toml").write_text(case.replace("AT", repr((begun - first_ns) * 1e-9), 1))
    read = load_case(folder / "case.toml")
    prepared = rerun.prepare(read, read_streams(read))
    result = rerun.run_methods(read, prepared, None).result
    assert prepared.alignment.time_ns == begun
    navigator = navigator_of(engine)
    state = navigator.state()
    assert state["time_ns"] == prepared.sample_time_ns[-1]
    np.testing.assert_allclose(result["position_t_m"][0, -1], state["position_t_m"], atol=1e-9)
    np.testing.assert_allclose(result["velocity_p_mps"][0, -1], state["velocity_p_mps"], atol=1e-9)
    np.testing.assert_allclose(result["attitude_t_p"][0, -1], state["attitude_t_p"], atol=1e-9)
    np.testing.assert_allclose(result["sd"][0, -1], np.sqrt(np.diag(navigator.covariance())), rtol=1e-8)
    return engine, result


def yaw_error_and_sd(engine: Engine, truth_rad: float) -> tuple[float, float]:
    navigator = navigator_of(engine)
    yaw = angles(np.asarray(navigator.state()["attitude_t_p"]))[2]
    error = (yaw - truth_rad + np.pi) % (2.0 * np.pi) - np.pi
    return error, float(np.sqrt(navigator.covariance()[5, 5]))


def test_the_slow_error_is_found(entries: Arrivals) -> None:
    """A start with a known heading and readings that are 3 degrees off: they are told apart, within the claim."""
    engine, _ = fly(made(('level = "attitude"', HEADING)), entries)
    found = engine.estimator.reference_error
    assert found is not None
    error, sd = (np.rad2deg(one[0]) for one in found)
    assert 0.2 < sd < 1.0
    assert abs(error - 3.0) < 2.5 * sd
    assert abs(error) > 3.0 * sd
    yaw, yaw_sd = yaw_error_and_sd(engine, dive().rpy[-1, 2])
    assert abs(yaw) < 2.5 * yaw_sd
    shown = status(Live(engine.config, engine, say=lambda _: None, send=lambda _: None))
    assert list(shown["reference"]) == ["yaw"]
    assert shown["reference"]["yaw"]["error_rad"] == pytest.approx(np.deg2rad(error))
    assert f'bottomlock_reference_error_rad{{angle="yaw"}} {np.deg2rad(error):.9g}' in metrics(shown)


@pytest.mark.long
def test_the_slow_error_of_the_start_counts_once(tmp_path: Path) -> None:
    """Started from the readings, the heading stays as unknown as their slow error, and its ratio is one over draws."""
    ratios = []
    for draw in range(12):
        offset, error = np.random.default_rng([20, draw]).standard_normal(2)
        flown = dive(30 + draw, 15.0)
        came = arrivals(flown, *readings(flown, 4.0 * offset + 1.0 * error, seed=draw), tmp_path)
        engine, _ = fly(made(), came)
        yaw, sd = yaw_error_and_sd(engine, flown.rpy[-1, 2])
        assert 0.93 * np.hypot(4.0, 1.0) < np.rad2deg(sd) < np.hypot(4.0, 1.0) + 0.3
        ratios.append(yaw / sd)
    # 99.9 % of the mean square of twelve standard normals.
    assert 0.18 < np.mean(np.square(ratios)) < 2.75


def test_a_reading_far_off_is_rejected_and_shown(entries: Arrivals) -> None:
    """Half a turn for one reading: the gate rejects it, the page counts it, and nothing else changes."""
    clean, _ = fly(made(), entries)
    time_ns = stamp(30.05)
    far = (time_ns + 20_000_000, AHRS, f"{time_ns},0.0,0.0,{float(dive().rpy[1502, 2] + np.pi)!r}\n".encode())
    engine, _ = fly(made(), sorted([*entries, far], key=lambda entry: entry[:2]))
    assert engine.estimator.gated["heading"] == clean.estimator.gated["heading"] + 1
    assert engine.state == "OK"
    shown = status(Live(engine.config, engine, say=lambda _: None, send=lambda _: None))
    assert shown["gated"] == {"heading": engine.estimator.gated["heading"]}
    assert f'bottomlock_gated_total{{sensor="heading"}} {shown["gated"]["heading"]}\n' in metrics(shown)
    np.testing.assert_allclose(
        navigator_of(engine).state()["position_t_m"], navigator_of(clean).state()["position_t_m"], atol=1e-9
    )


def test_readings_beyond_the_horizon_are_refused_and_counted(entries: Arrivals) -> None:
    """As a depth is; with those that are in time the bits are the same."""
    late = [
        (a + 3_000_000_000, s, d) if s == AHRS and k % 50 == 0 else (a, s, d)
        for k, (a, s, d) in enumerate(entries)
    ]
    without = [entry for k, entry in enumerate(entries) if entry[1] != AHRS or k % 50]
    engine, _ = fly(made(), sorted(late, key=lambda entry: entry[:2]))
    other, _ = fly(made(), without)
    assert sum(engine.sources[AHRS].refused.values()) > 3
    np.testing.assert_array_equal(navigator_of(engine).covariance(), navigator_of(other).covariance())


def test_a_silent_reference_changes_no_state(entries: Arrivals) -> None:
    """Nor does its slow rate let silent inertial readings pass as alive."""
    kept = [e for e in entries if e[1] != AHRS or not 20.0 < (e[0] - START_NS) * 1e-9 < 40.0]
    engine, sent = fly(made(("rate_hz = 10\nclock", "rate_hz = 0.5\nclock")), kept)
    assert {Sent.parse(one.data).state for one in sent} <= {"OK", "PARTIAL"}
    engine.advance(engine.now_ns + 200_000_000)
    assert engine.state == "UNSAFE"
    assert "inertial" in engine.machine.why


def test_the_start_waits_for_an_attitude(entries: Arrivals) -> None:
    engine, _ = fly(made(), [entry for entry in entries if entry[1] != AHRS])
    assert engine.state == "INITIALISING"
    assert engine.estimator.waiting_for == "an attitude"


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


def test_the_attitude_of_a_start_among_those_that_came() -> None:
    """The latest that is not after the inertial reading, in whatever order they came, and none that is a second old."""
    start = StartSection(level="attitude", velocity="given")
    alignment = Alignment(start, level_by_attitude=True)
    for milliseconds, yaw in ((900, 1.0), (800, 2.0), (1100, 3.0)):
        alignment.attitude(milliseconds * 1_000_000, np.array(quaternion(0.1, 0.2, yaw)))
    expected: tuple[tuple[int, float | None], ...] = ((799, None), (1000, 1.0), (2100, 3.0), (2101, None))
    for milliseconds, known in expected:
        alignment.imu(milliseconds * 1_000_000, np.array([0.0, 0.0, -9.8]))
        assert alignment.waiting_for == ("an attitude" if known is None else "")
        if known is not None:
            started = angles(np.array(alignment.state().attitude_t_p))
            np.testing.assert_allclose(started, (0.1, 0.2, known), atol=1e-12)


def test_a_checkpoint_holds_the_slow_error(entries: Arrivals) -> None:
    """A restart goes on with what was found of it; one of another mounting is refused as other settings."""
    config = made(('level = "attitude"', HEADING))
    early = [entry for entry in entries if entry[0] < START_NS + 40_000_000_000]
    before, _ = fly(config, early)
    content = pack(before, before.now_ns)
    assert content is not None
    after = resume(config, content)
    one, same = before.estimator.reference_error, after.estimator.reference_error
    assert one is not None
    assert same is not None
    np.testing.assert_array_equal(one[0], same[0])
    for arrival_ns, source, data in entries:
        if arrival_ns > START_NS + 41_000_000_000:
            after.arrive(source, arrival_ns, data)
    assert after.state == "OK"
    found = after.estimator.reference_error
    assert found is not None
    assert abs(np.rad2deg(found[0][0]) - 3.0) < 2.5 * np.rad2deg(found[1][0])
    other = made(
        ('level = "attitude"', HEADING), ("yaw_sd_deg = 0.3", "yaw_sd_deg = 0.3\nyaw_offset_deg = 1")
    )
    with pytest.raises(DataError, match="other settings"):
        resume(other, content)


def test_a_raw_log_gives_the_same_bits(entries: Arrivals, tmp_path: Path) -> None:
    pytest.importorskip("mcap")
    config = made()
    names = [source.name for source in config.source]
    log = RawLog(tmp_path, sources=names, ports=["probe"], start={})
    engine, messages = Engine(config), 0
    for arrival_ns, source, data in entries:
        log.write("in", source, arrival_ns, data)
        for message in engine.arrive(source, arrival_ns, data):
            log.write("out", message.port, arrival_ns, message.data)
            messages += 1
    log.close()
    again = replay_log(config, log.path)
    assert again.first_difference == ""
    assert again.sent == messages > 400


def mavlink(entries: Arrivals, kind: str, *, inertial: bool) -> Arrivals:
    """The attitudes as pymavlink packs them, and the inertial readings; or others beside them, of the other sign."""
    os.environ.setdefault("MAVLINK20", "1")
    dialect = pytest.importorskip("pymavlink.dialects.v20.ardupilotmega")
    link = dialect.MAVLink(None)
    found: Arrivals = []
    for arrival_ns, source, data in entries:
        if source == DVL or (source == IMU and not inertial):
            found.append((arrival_ns, source, data))
        if source == DVL:
            continue
        time_ns, *values = (float(part) if k else int(part) for k, part in enumerate(data.split(b",")))
        since_us = (int(time_ns) - START_NS) // 1000
        if source == IMU:
            sign = 1.0 if inertial else -1.0
            numbers = [sign * value for value in (*values[3:], *values[:3])]
            # The others are of times at which they could be taken.
            own_us = since_us + (0 if inertial else 5_000)
            packed = dialect.MAVLink_highres_imu_message(own_us, *numbers, *[0.0] * 7, 0xFFFF)
        elif kind == "ATTITUDE":
            packed = dialect.MAVLink_attitude_message(since_us // 1000, *values, 0.0, 0.0, 0.0)
        else:
            turned = quaternion(*values)
            packed = dialect.MAVLink_attitude_quaternion_message(since_us // 1000, *turned, 0.0, 0.0, 0.0)
        found.append((arrival_ns, AHRS, bytes(packed.pack(link))))
    return found


@pytest.mark.parametrize("kind", ["ATTITUDE", "ATTITUDE_QUATERNION"])
@pytest.mark.parametrize("inertial", [True, False])
def test_mavlink_gives_what_lines_give(tmp_path: Path, kind: str, inertial: bool) -> None:
    """One source for both, or beside an IMU of its own, whose readings the autopilot's do not disturb.

    To single precision, and the millisecond to which an attitude has its time.
    """
    flown = dive(5, 20.0)
    # The autopilot's clock is mapped by its least delay: all its messages come after 2 ms.
    came = sorted(
        ((int(data.split(b",")[0]) + 2_000_000 if source == AHRS else arrival_ns), source, data)
        for arrival_ns, source, data in arrivals(flown, *readings(flown, 3.0), tmp_path)
    )
    by_lines, _ = fly(made(), came)
    rate = 50 if inertial else 10
    source = (
        f'[[source]]\nname = "autopilot"\naddress = "udpin:127.0.0.1:10"\nformat = "mavlink"\nrate_hz = {rate}\n'
        "latency_s = 0.002\n"
    )
    config = made(
        (AHRS_SOURCE, source),
        ("[attitude]", f'[attitude]\nmessage = "{kind}"'),
        *[(IMU_SOURCE, "")] * inertial,
    )
    place = {DVL: 0, IMU: 1, AHRS: len(config.source) - 1}
    sent = [(when, place[one], data) for when, one, data in mavlink(came, kind, inertial=inertial)]
    engine, _ = fly(config, sent)
    assert engine.state == by_lines.state == "OK"
    assert engine.sources[-1].used == by_lines.sources[AHRS].used + inertial * by_lines.sources[IMU].used
    state, same = navigator_of(engine).state(), navigator_of(by_lines).state()
    np.testing.assert_allclose(state["velocity_p_mps"], same["velocity_p_mps"], atol=1e-4)
    np.testing.assert_allclose(state["position_t_m"], same["position_t_m"], atol=1e-3)
    one, other = engine.estimator.reference_error, by_lines.estimator.reference_error
    assert one is not None
    assert other is not None
    np.testing.assert_allclose(one, other, atol=1e-5)


def test_what_mavlink_is_read_for() -> None:
    """One message stream holds both; each is read only if it is asked for."""
    os.environ.setdefault("MAVLINK20", "1")
    dialect = pytest.importorskip("pymavlink.dialects.v20.ardupilotmega")
    link = dialect.MAVLink(None)
    imu = dialect.MAVLink_highres_imu_message(5_000, *[0.5] * 6, *[0.0] * 7, 0xFFFF)
    turned = dialect.MAVLink_attitude_message(5, 0.1, 0.2, 0.3, 0.0, 0.0, 0.0)
    data = bytes(imu.pack(link)) + bytes(turned.pack(link))
    kinds = [type(one) for one in MavlinkReader(None, 9.81, "ATTITUDE").feed(data)]
    assert kinds == [ImuReading, AttitudeReading]
    kinds = [type(one) for one in MavlinkReader(None, 9.81, "ATTITUDE", inertial=False).feed(data)]
    assert kinds == [AttitudeReading]
    assert [type(one) for one in MavlinkReader(None, 9.81).feed(data)] == [ImuReading]


@pytest.mark.parametrize("frame", ["ned_frd", "enu_flu"])
def test_the_platforms_attitude_is_that_of_a_replay(frame: str) -> None:
    """Two ways to the same rotation: quaternions here, matrices there."""
    random = np.random.default_rng(8)
    section = AttitudeSection.model_validate(
        {
            "frame": frame,
            "mounting_roll_deg": 20,
            "mounting_pitch_deg": -30,
            "mounting_yaw_deg": 110,
            "yaw_offset_deg": 7,
        }
    )
    for rpy in random.uniform(-1.4, 1.4, (5, 3)):
        there = platform_attitude(from_angles(*rpy), frame, np.deg2rad([20, -30, 110]), np.deg2rad(7.0))
        here = PlatformAttitude(section).of(AttitudeReading(0, quaternion(*rpy)))
        assert abs(float(np.dot(quaternions(there), here))) == pytest.approx(1.0, abs=1e-12)
        np.testing.assert_allclose(angles(here), Rotation.from_quat(here[[1, 2, 3, 0]]).as_euler("ZYX")[::-1])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"heading"', '"yaw"', "'attitude.aids' is 'yaw', expected 'attitude', 'heading' or 'nothing'"),
        (
            "[attitude]",
            '[attitude]\ngrade = "mti"',
            "attitude: grade is 'mti', did you mean 'mti_ahrs'? expected one of magnetic, mti_ahrs",
        ),
        (AHRS_SOURCE, "", "0 sources can be that of [attitude] (none), expected one"),
        (
            AHRS_SOURCE,
            AHRS_SOURCE + AHRS_SOURCE.replace('"ahrs"', '"b"'),
            "2 sources can be that of [attitude] (ahrs, b), expected one",
        ),
        (
            "[attitude]",
            '[attitude]\nmessage = "ATTITUDE"',
            "'attitude.message' is one of MAVLink, and the attitudes are those of source 'ahrs'",
        ),
        ("yaw_sd_deg = 0.3", "yaw_sd_deg = 0", "'attitude.yaw_sd_deg' is 0, expected > 0.0 deg"),
        (
            'level = "attitude"',
            "heading_deg = 1",
            "'start.heading_sd_deg' is missing, expected number in deg, > 0",
        ),
        ('"attitude"\nvelocity', '"gyros"\nvelocity', "'start.level' is 'gyros', expected 'levelling' or"),
        ("[attitude]", "[magnetometer]", "unknown key 'magnetometer'"),
    ],
)
def test_mistakes(old: str, new: str, message: str) -> None:
    """One line with the key, what it is, what was expected and the likely mistake."""
    assert old in TEXT
    with pytest.raises(ScenarioError) as error:
        parse_config(TEXT.replace(old, new, 1), place="test")
    assert message in str(error.value)


def test_mistakes_of_a_section_that_is_missing_or_idle() -> None:
    section = TEXT[TEXT.index("[attitude]") : TEXT.index("[start]")]
    with pytest.raises(ScenarioError, match=r"start\.level = \"attitude\" needs the section \[attitude\]"):
        made((section, ""))
    bare = TEXT.replace(section, "").replace('level = "attitude"', "")
    with pytest.raises(
        ScenarioError, match=r"'start\.heading_deg' is missing, .*only a section \[attitude\]"
    ):
        parse_config(bare, place="test")
    bare = bare.replace("[start]", "[start]\nheading_deg = 1.0\nheading_sd_deg = 1.0")
    with pytest.raises(ScenarioError, match=r"'attitude-csv', which needs the section \[attitude\]"):
        parse_config(bare, place="test")
    with pytest.raises(ScenarioError, match=r"aids is \"nothing\", and the start does not use \[attitude\]"):
        made(('aids = "heading"', ""), ('level = "attitude"', "heading_deg = 1.0\nheading_sd_deg = 1.0"))
    lines = 'format = "attitude-csv"\nrate_hz = 10\nclock = "host"'
    with pytest.raises(ScenarioError, match=r"attitude\.frame is \"enu_flu\", expected \"ned_frd\""):
        made(
            (lines, 'format = "mavlink"\nrate_hz = 10'),
            ('aids = "heading"', 'aids = "heading"\nframe = "enu_flu"'),
        )


def test_the_documented_section_is_a_configuration() -> None:
    """The example of docs/live.md, in place of the test's own sections."""
    page = (Path(__file__).parents[2] / "docs" / "live.md").read_text(encoding="utf-8")
    block = page[page.index("## Attitude reference") :].split("```toml\n", 1)[1].split("```", 1)[0]
    own = TEXT[TEXT.index("[attitude]") : TEXT.index("[[source]]")]
    config = made((AHRS_SOURCE, ""), (own, block))
    assert config.attitude is not None
    assert config.attitude.aids == "heading"
    assert config.start_sd_deg()[1] == pytest.approx(3.0 * np.sqrt(0.2**2 + 1.0**2 + 1.7**2))


@pytest.mark.parametrize("grade", ["magnetic", "mti_ahrs", "gyrocompass"])
def test_a_grade_is_that_of_a_case(grade: str) -> None:
    section = TEXT[TEXT.index("[attitude]") : TEXT.index("[start]")]
    config = made((section, f'[attitude]\naids = "heading"\ngrade = "{grade}"\nyaw_sd_deg = 0.7\n'))
    assert config.attitude is not None
    assert config.attitude.yaw_sd_deg == 0.7
    assert config.attitude.yaw_walk_sd_deg > 0.0


GEOMETRY = """configuration = "angles"
tilts_deg = [25, 25, 25]
azimuths_deg = [0, 120, 240]
mounting_yaw_deg = 70.2
beam_noise_mps = 0.065
"""
STPERE = {
    "waterlinked_a50": "dvl.toml", "latitude_deg = 45.0\ngravity = 9.8062": "latitude_deg = 42.2\ngravity = 9.803",
    "beam_noise_mps = 0.008": "beam_noise_mps = 0.065",
    "accel_bias_mg = 1.0\ngyro_bias_deg_per_h = 20.0\naccel_noise_mps_per_rt_h = 0.09\ngyro_noise_deg_per_rt_h = 0.25":
    'grade = "mti"\naccel_bias_mg = 1.0\ngyro_bias_deg_per_h = 2500.0\naccel_noise_mps_per_rt_h = 3.2\n'
    "gyro_noise_deg_per_rt_h = 11.0",
}  # fmt: skip
"""What `replay --init` finds of the recording, where it is not what the simulated dive has."""


def stpere_text(text: str) -> str:
    for old, new in STPERE.items():
        text = text.replace(old, new)
    return text


@pytest.mark.long
@pytest.mark.recordings
def test_the_recorded_auv(tmp_path: Path, recordings: Path) -> None:
    """St Pere, 1,700 s: IMU at 10 Hz, AHRS of its grade and three beams, live and replayed, and where DGPS saw it."""
    if not (recordings / "stpere_ictineu").is_dir():
        pytest.skip("no recording of St Pere")
    stpere(recordings, tmp_path)
    (tmp_path / "dvl.toml").write_text(GEOMETRY)
    section = 'aids = "attitude"\ngrade = "mti_ahrs"\n'
    given = TEXT[TEXT.index("[attitude]\n") + len("[attitude]\n") : TEXT.index("[start]")]
    text = stpere_text(TEXT).replace(given, section).replace("waterlinked-json", "nucleus")
    text = text.replace("rate_hz = 50", "rate_hz = 10").replace("rate_hz = 4\n", "rate_hz = 1.4\n")
    config = parse_config(text + MOTION, place="test", folder=tmp_path)
    case = stpere_text(CASE).replace("ATTITUDE", section).replace("sample_s = 0.02", "sample_s = 0.001")
    engine, _ = flown_and_replayed(recorded_arrivals(tmp_path, config), config, case + MOTION, tmp_path)
    assert engine.reset_counter == 0
    found = engine.estimator.reference_error
    assert found is not None
    gps = pl.read_csv(tmp_path / "gps.csv")
    lat, lon = (np.radians(gps[name].to_numpy()[[0, -1]]) for name in ("latitude", "longitude"))
    moved = 6.371e6 * np.array([np.diff(lat)[0], np.diff(lon)[0] * np.cos(lat[0])])
    end = navigator_of(engine).state()["position_t_m"][:2]
    sd = np.sqrt(np.diag(navigator_of(engine).covariance())[:2])
    # 430 m of way.
    assert np.linalg.norm(end - moved) < 6.5
    assert (np.abs(end - moved) < 2.0 * sd).all()
    assert (np.abs(found[0]) < 2.0 * found[1]).all()


def recorded_arrivals(tables: Path, config: LiveConfig) -> Arrivals:
    """The tables of `tests/recorded_dives.py` as lines and records: inertial readings first, then the other two."""
    entries: Arrivals = []

    def rows(name: str) -> Iterator[tuple[int, list[float]]]:
        for time_s, *values in pl.read_csv(tables / f"{name}.csv").iter_rows():
            yield round(time_s * 1e3) * 1_000_000, [np.nan if v is None else v for v in values]

    for time_ns, values in rows("imu"):
        entries.append((time_ns + 2_000_000, IMU, f"{time_ns},{','.join(map(repr, values))}\n".encode()))
    for time_ns, values in rows("ahrs"):
        # The sensor's clock is the IMU's; its readings are of the time between two of them.
        own_ns = time_ns + 1_000_000
        numbers = ",".join(repr(float(np.radians(value))) for value in values)
        entries.append((own_ns + 30_000_000, AHRS, f"{own_ns},{numbers}\n".encode()))
    encode = encoder("nucleus", config.instrument().geometry).encode
    for k, (time_ns, values) in enumerate(rows("dvl_beams")):
        ping = Recorded(
            time_ns=time_ns, transmission_ns=time_ns + 60_000_000, interval_ns=0, number=k + 1,
            beam_velocity_mps=np.array(values[:3]), range_m=np.array(values[3:]),
        )  # fmt: skip
        entries.append((time_ns + 60_000_000, DVL, encode(ping)))
    last_ns = max(arrival_ns for arrival_ns, source, _ in entries if source == IMU)
    return sorted((entry for entry in entries if entry[0] <= last_ns), key=lambda entry: entry[:2])
