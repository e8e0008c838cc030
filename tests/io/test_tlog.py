"""Telemetry logs: both versions of MAVLink, signed or not, one clock for each sender, an account of what is damaged."""

import contextlib
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pymavlink", reason="telemetry logs need the extra .[mavlink]")

from bottomlock.errors import DataError
from bottomlock.io import tlog
from bottomlock.io.log_stream import LogStream, LogStreams
from tests.io.autopilot_logs import START_S, Station

BOOT_US = 50_000_000


def attitudes(station: Station, count: int = 60, *, from_us: int = BOOT_US, **how: Any) -> list[bytes]:  # noqa: ANN401
    """Records of an attitude, ten a second, of which every second one is 15 ms later."""
    out = [station.heartbeat(from_us)]
    for k in range(count):
        us, angles = from_us + 100_000 * k, (0.1, -0.2, 0.01 * k)
        out.append(
            station.log(us, "ATTITUDE", us // 1000, *angles, 0.0, 0.0, 0.0, late_us=15_000 * (k % 2), **how)
        )
    return out


def stream(log: LogStreams, name: str) -> LogStream:
    return next(one for one in log.streams if one.name == name)


@pytest.mark.parametrize("version1", [True, False])
@pytest.mark.parametrize("signed", [True, False])
def test_times_are_the_vehicles_on_the_stations_clock(version1: bool, signed: bool) -> None:
    """The delays differ; the times are even, and 40 ms late as the least delayed message."""
    station = Station(signed=signed and not version1)
    log = tlog.streams(b"".join(attitudes(station, version1=version1)), "x")
    found = stream(log, "ATTITUDE")
    np.testing.assert_array_equal(np.diff(found.time_ns), 100_000_000)
    assert int(found.time_ns[0]) == (START_S * 1_000_000 + BOOT_US + 40_000) * 1000
    np.testing.assert_allclose(found.columns["yaw_rad"], 0.01 * np.arange(60), atol=1e-6)
    assert log.account.lost == 0


def test_messages_are_those_of_pymavlink(tmp_path: Path) -> None:
    """Another reader of the same file, with garbage in it, finds as many messages."""
    from pymavlink import mavutil

    rows = attitudes(Station())
    path = tmp_path / "x.tlog"
    path.write_bytes(b"".join(rows[:20]) + bytes(range(1, 60)) + b"".join(rows[20:]))
    theirs = mavutil.mavlogfile(str(path))
    count = 0
    while (message := theirs.recv_msg()) is not None:
        count += message.get_type() == "ATTITUDE"
    theirs.close()
    log = tlog.streams(path.read_bytes(), str(path))
    assert len(stream(log, "ATTITUDE").time_ns) == 60
    assert count >= 59  # it may lose the message after the garbage
    assert log.account.skipped["bytes of no message"].first == sum(map(len, rows[:20]))


def test_damage_is_counted() -> None:
    rows = attitudes(Station())
    bad = bytearray(rows[10])
    bad[25] ^= 0x10
    short = rows[30][:20] + rows[30][23:]
    log = tlog.streams(b"".join([*rows[:10], bad, *rows[11:30], short, *rows[31:]])[:-4], "x")
    assert len(stream(log, "ATTITUDE").time_ns) == 57
    assert log.account.skipped["wrong checksum or length"].first == sum(map(len, rows[:10]))
    assert log.account.skipped["wrong checksum or length"].count == 2
    assert log.account.skipped["breaks off within a message"].count == 1
    assert log.notes[-1].startswith("damaged parts are left out: 2 wrong checksum or length (first at byte ")


def test_a_restart_of_the_autopilot_starts_its_clock_anew() -> None:
    station = Station()
    before = attitudes(station)
    later = Station(delay_us=40_000 + 60_000_000)
    log = tlog.streams(b"".join([*before, *attitudes(later, from_us=1_000_000)]), "x")
    found = stream(log, "ATTITUDE")
    assert len(found.time_ns) == 120
    assert int(found.time_ns[60]) == (START_S * 1_000_000 + 1_000_000 + 60_040_000) * 1000
    np.testing.assert_array_equal(np.diff(found.time_ns[60:]), 100_000_000)


def test_two_vehicles_are_not_mixed() -> None:
    both = attitudes(Station()) + attitudes(Station(system=2))
    with pytest.raises(DataError, match=r"x: holds autopilots of the systems 1, 2; expected one vehicle"):
        tlog.streams(b"".join(both), "x")


def test_what_several_components_send_is_named_by_the_sender() -> None:
    both = attitudes(Station()) + attitudes(Station(component=191))[1:]
    assert [one.name for one in tlog.streams(b"".join(both), "x").streams] == [
        "ATTITUDE of 1/1",
        "ATTITUDE of 1/191",
    ]


def test_units_are_si() -> None:
    """Milli-g, mrad/s, hPa, 1e-7 degrees, mm, cm/s; a GPS without a fix gives no row."""
    station = Station()
    out = attitudes(station)
    for k in range(60):
        us = BOOT_US + 20_000 * k
        out.append(station.log(us, "SCALED_IMU2", us // 1000, 10, -20, -1000, 100, 200, -300, 0, 0, 0, 2000))
        out.append(station.log(us, "SCALED_PRESSURE2", us // 1000, 1313.25, 0.0, 1200, 0))
        out.append(station.log(us, "SCALED_PRESSURE", us // 1000, 990.0, 0.0, 1200, 0))
        out.append(
            station.log(us, "GPS_RAW_INT", us, 3 if k else 1, 450_000_000, 100_000_001, 1500, 0, 0, 0, 0, 9)
        )
        out.append(
            station.log(
                us, "GLOBAL_POSITION_INT", us // 1000, 450_000_000, 100_000_000, -2000, 0, 50, -25, 10, 0
            )
        )
    log = tlog.streams(b"".join(out), "x")
    imu = stream(log, "SCALED_IMU2")
    np.testing.assert_allclose(
        [imu.columns[f"acc_{a}_mps2"][0] for a in "xyz"], [0.0980665, -0.196133, -9.80665]
    )
    np.testing.assert_allclose([imu.columns[f"gyro_{a}_radps"][0] for a in "xyz"], [0.1, 0.2, -0.3])
    np.testing.assert_allclose(stream(log, "SCALED_PRESSURE2").columns["pressure_pa"], 131_325.0, rtol=1e-6)
    gps = stream(log, "GPS_RAW_INT")
    assert len(gps.time_ns) == 59
    assert gps.independent
    np.testing.assert_allclose(gps.columns["longitude_deg"], 10.0000001, rtol=1e-12)
    np.testing.assert_allclose(gps.columns["height_m"], 1.5)
    estimate = stream(log, "GLOBAL_POSITION_INT")
    assert not estimate.independent
    np.testing.assert_allclose(estimate.columns["velocity_east_mps"], -0.25)


@pytest.mark.parametrize(("step_us", "counts", "words"), [
    (250_000, 1000, "RAW_IMU comes at 4 Hz, too slow to be integrated"),
    (20_000, 16_384, "RAW_IMU is left out: its acceleration has a median of 1.638e.04 mg, expected gravity"),
])  # fmt: skip
def test_an_imu_that_cannot_be_integrated_is_left_out(step_us: int, counts: int, words: str) -> None:
    import re

    station = Station()
    out = attitudes(station)
    for k in range(60):
        us = BOOT_US + step_us * k
        out.append(station.log(us, "RAW_IMU", us, 0, 0, -counts, 0, 0, 0, 0, 0, 0))
    log = tlog.streams(b"".join(out), "x")
    assert [one.name for one in log.streams] == ["ATTITUDE"]
    assert re.match(words, log.notes[0])


@pytest.mark.parametrize("sent", [0, 2**64 - 1])
def test_a_sender_without_a_clock_has_the_stations_time(sent: int) -> None:
    """Some companions send displacements with the time 0."""
    vehicle, companion = Station(), Station(255, 197)
    out = attitudes(vehicle)
    for k in range(40):
        us = BOOT_US + 100_000 * k
        out.append(
            companion.log(
                us,
                "VISION_POSITION_DELTA",
                sent,
                100_000,
                [0.0] * 3,
                [0.1, 0.0, -0.01],
                0.0 if k == 3 else 50.0,
            )
        )
    found = stream(tlog.streams(b"".join(out), "x"), "VISION_POSITION_DELTA")
    np.testing.assert_allclose(found.columns["surge_mps"], 1.0, rtol=1e-6)
    np.testing.assert_array_equal(np.flatnonzero(found.columns["valid"] == 0.0), [3])
    assert int(found.time_ns[0]) == (START_S * 1_000_000 + BOOT_US + 40_000 - 50_000) * 1000


def test_odometry_counts_in_body_axes_alone() -> None:
    vehicle = Station()
    out = attitudes(vehicle)
    for k in range(30):
        us = BOOT_US + 100_000 * k
        frame, pose, speed = 12 if k < 20 else 1, [0, 0, 0, [1.0, 0, 0, 0]], [0.5, 0.1, -0.2, 0, 0, 0]
        out.append(vehicle.log(us, "ODOMETRY", us, 1, frame, *pose, *speed, [0.0] * 21, [0.0] * 21))
    found = stream(tlog.streams(b"".join(out), "x"), "ODOMETRY")
    assert len(found.time_ns) == 20
    np.testing.assert_allclose(
        [found.columns[a][0] for a in ("surge_mps", "sway_mps", "heave_mps")], [0.5, 0.1, -0.2], rtol=1e-6
    )


def test_damaged_bytes_end_in_streams_or_in_one_line() -> None:
    """Every message has a checksum: what is left is a part of what was sent."""
    good, rng, counts = b"".join(attitudes(Station())), random.Random(7), []
    whole = stream(tlog.streams(good, "x"), "ATTITUDE")
    for _ in range(150):
        data = bytearray(good)
        for _ in range(rng.choice([1, 5, 50])):
            data[rng.randrange(len(data))] = rng.randrange(256)
        at = rng.randrange(len(data))
        del data[at : at + rng.randrange(200)]
        with contextlib.suppress(DataError):
            for one in tlog.streams(bytes(data), "x").streams:
                counts.append(len(one.time_ns))
                assert set(one.columns["yaw_rad"]) <= set(whole.columns["yaw_rad"])
    assert 0 < min(counts) < max(counts) < 60


def speeds(vehicle: Station, *, turned: bool) -> bytes:
    """A velocity north while the vehicle heads east, with or without its attitude, which has a gap of 2 s."""
    out = [vehicle.heartbeat(BOOT_US)]
    for k in range(60):
        us = BOOT_US + 100_000 * k
        if turned and not 20 <= k < 40:
            half = float(np.sqrt(0.5))
            out.append(
                vehicle.log(us, "ATTITUDE_QUATERNION", us // 1000, half, 0.0, 0.0, half, 0.0, 0.0, 0.0)
            )
        out.append(vehicle.log(us, "VISION_SPEED_ESTIMATE", us, 1.0, 0.0, 0.0, [0.0] * 9, 0))
    return b"".join(out)


def test_a_level_velocity_is_turned_with_the_attitude() -> None:
    """To port, where it goes north and heads east; unknown where no attitude stands near."""
    found = stream(tlog.streams(speeds(Station(), turned=True), "x"), "VISION_SPEED_ESTIMATE")
    assert found.remark.endswith("turned with the recorded attitude: the accelerometers do not tell")
    sway = found.columns["sway_mps"]
    np.testing.assert_array_equal(np.isnan(sway), [20 <= k < 40 for k in range(60)])
    np.testing.assert_allclose(sway[np.isfinite(sway)], -1.0, rtol=1e-6)
    with pytest.raises(
        DataError, match=r"x: holds no stream that a replay could use \(VISION_SPEED_ESTIMATE is a vel"
    ):
        tlog.streams(speeds(Station(), turned=False), "x")
