"""DataFlash logs: every number as pymavlink reads it, units as the log states them, an account of what is damaged."""

import contextlib
import random
import struct
from pathlib import Path

import numpy as np
import pytest

from bottomlock.errors import DataError
from bottomlock.io import ardupilot, dataflash
from bottomlock.io.account import Account
from tests.io import autopilot_logs as logs

NAMES = ("IMU", "ATT", "BARO", "GPS", "XKF1", "VISO", "VISV")


def rows(count: int = 40) -> list[bytes]:
    """Records of each message, numbers that differ from row to row."""
    out = []
    for k in range(count):
        us = 10_000_000 + 20_000 * k
        for i in (0, 1):
            gyro, force = (0.1 * k, -0.2 - i, 0.3), (0.5, 0.01 * k, -9.8)
            out.append(logs.record("IMU", us, i, *gyro, *force, 0, 0, 25.0, 1, 1, 1000, 1000))
        out.append(logs.record("ATT", us, 0, 100 + k, 0, -200, 0, 35_000, 0, 0, 3))
        out.append(logs.record("BARO", us, 0, 0.0, 99_000.0, 2500, 0.0))
        out.append(logs.record("BARO", us, 1, 0.0, 101_325.0 + 100.0 * k, 2500, 0.0))
        out.append(logs.gps(us, (float(k), -2.0 * k, 1.0), status=3 if k < 30 else 1))
        out.append(
            logs.record("XKF1", us, 0, 0, 0, 0, 0.5, 0.25, 0.0, 0.0, 0.01 * k, 0.005 * k, 3.0, 0, 0, 0, 0)
        )
        out.append(logs.record("VISO", us, 0.02, 0.0, 0.0, 0.0, 0.02, -0.01, 0.001, 90.0 if k % 4 else 0.0))
        out.append(logs.record("VISV", us, us, us // 1000, 0.5, 0.25, 0.0, 0.01, 0, int(k == 7)))
    return out


def whole(count: int = 40) -> bytes:
    return logs.head(NAMES) + b"".join(rows(count))


def test_every_number_is_that_of_pymavlink(tmp_path: Path) -> None:
    """Another reader of the same file: all messages and columns, with their scales."""
    reader = pytest.importorskip("pymavlink.DFReader", reason="needs the extra .[mavlink]")
    path = tmp_path / "dive.BIN"
    path.write_bytes(whole())
    theirs: dict[str, dict[str, list[object]]] = {}
    log = reader.DFReader_binary(str(path))
    while (message := log.recv_msg()) is not None:
        of = theirs.setdefault(message.get_type(), {})
        for name in message.get_fieldnames():
            of.setdefault(name, []).append(getattr(message, name))
    log.close()
    account = Account(unit="byte")
    ours = dataflash.parse(path.read_bytes(), str(path), account)
    assert {name: len(of.values) for name, of in ours.items()} == {
        name: len(next(iter(of.values()))) for name, of in theirs.items()
    }
    assert account.lost == 0
    for name in NAMES:
        for column, kind in ours[name].formats.items():
            if kind in "cCeEL":
                unit = {"D": "deg", "U": "deg"}.get(_unit_id(name, column)) or logs.UNITS[
                    _unit_id(name, column)
                ]
                if unit in {"m", "deg", "degheading"}:
                    wanted = "deg" if unit == "degheading" else unit
                    np.testing.assert_array_equal(ours[name].numbers(column, wanted), theirs[name][column])
            else:
                np.testing.assert_array_equal(ours[name].values[column], theirs[name][column])


def _unit_id(name: str, column: str) -> str:
    _, _, columns, units, _ = logs.FORMATS[name]
    return units[columns.split(",").index(column)]


@pytest.mark.parametrize("units", [True, False])
def test_streams_have_units_names_and_times(units: bool) -> None:
    """With and without the records of units the numbers are the same; GPS gives the date."""
    data = logs.head(NAMES, units=units) + b"".join(rows())
    found = {one.name: one for one in ardupilot.streams(data, "x").streams}
    instances = {"IMU 0", "IMU 1", "BARO 0", "BARO 1", "GPS 0", "XKF1 0"}
    assert instances | {"ATT", "VISO", "VISV"} == found.keys()
    imu = found["IMU 1"]
    np.testing.assert_allclose(imu.columns["gyro_y_radps"][-1], -1.2, rtol=1e-6)
    np.testing.assert_allclose(imu.columns["acc_z_mps2"], -9.8, rtol=1e-6)
    np.testing.assert_allclose(found["ATT"].columns["roll_deg"][:2], [1.0, 1.01])
    np.testing.assert_allclose(found["ATT"].columns["yaw_deg"], 350.0)
    assert len(found["GPS 0"].time_ns) == 30
    expected = (logs.START_S * 1_000_000 + 10_000_000) * 1000
    assert abs(int(found["ATT"].time_ns[0]) - expected) < 2_000_000


def test_an_interval_in_seconds_despite_its_factor() -> None:
    """ArduPilot writes VISO.dt in seconds and states a factor of 1e-6: the steps between records tell."""
    log = ardupilot.streams(whole(), "x")
    viso = next(one for one in log.streams if one.name == "VISO")
    np.testing.assert_allclose(viso.columns["surge_mps"], 1.0, rtol=1e-6)
    np.testing.assert_allclose(viso.columns["sway_mps"], -0.5, rtol=1e-6)
    np.testing.assert_array_equal(viso.columns["valid"], [float(k % 4 > 0) for k in range(40)])
    att = next(one for one in log.streams if one.name == "ATT")
    np.testing.assert_array_equal(viso.time_ns, att.time_ns - 10_000_000)
    assert "dt is taken in seconds" in viso.remark


def test_a_damaged_log_is_read_with_an_account() -> None:
    """Garbage between records, a record that lost bytes, a cut at the end: each is counted where it is."""
    parts = rows()
    start = logs.head(NAMES)
    hurt = start + b"".join(parts[:9]) + b"\xa3\x95garbage" + b"".join(parts[9:18])
    at_loss = len(hurt)
    hurt += parts[18][:20] + parts[18][24:] + b"".join(parts[19:])[:-5]
    account = Account(unit="byte")
    found = dataflash.parse(hurt, "x", account)
    assert len(found["IMU"].values) == 79
    assert len(found["VISV"].values) == 39
    reasons = account.skipped
    assert reasons["bytes of no known record"].count == 1
    assert reasons["bytes of no known record"].first == len(start) + sum(map(len, parts[:9]))
    assert reasons["record that no other follows: bytes are lost or wrong"].first == at_loss
    assert reasons["breaks off within a record"].count == 1
    notes = ardupilot.streams(hurt, "x").notes
    assert any(
        note.startswith("damaged parts are left out: 1 bytes of no known record (first at byte")
        for note in notes
    )


@pytest.mark.parametrize("filler", [b"\xff", b"\0"])
def test_a_board_pads_its_last_page(filler: bytes) -> None:
    account = Account(unit="byte")
    found = dataflash.parse(whole() + filler * 200, "x", account)
    assert (account.lost, len(found["VISV"].values)) == (0, 40)


def test_two_logs_in_a_file_are_refused() -> None:
    with pytest.raises(DataError, match=r"TimeUS of IMU goes back at its record 401 of 800"):
        ardupilot.streams(whole(200) + whole(200), "x")
    other = b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", 129, 11, b"POS", b"Q", b"TimeUS")
    with pytest.raises(DataError, match=r"record type 129 is IMU and, from byte \d+ on, POS"):
        dataflash.parse(whole() + other, "x", Account(unit="byte"))


def test_one_damaged_time_costs_its_own_record() -> None:
    parts = rows()
    bad = bytearray(parts[9 * 10])
    bad[8] ^= 0x40
    log = ardupilot.streams(logs.head(NAMES) + b"".join([*parts[:90], bytes(bad), *parts[91:]]), "x")
    imu = next(one for one in log.streams if one.name == "IMU 0")
    assert len(imu.time_ns) == 39
    assert log.notes == [
        "IMU 0: 1 of 40 records repeat a time or are out of order, the first of them number 11, and are left out"
    ]


def test_damaged_bytes_end_in_streams_or_in_one_line() -> None:
    """Flipped and lost bytes anywhere: no other exception, and times that rise."""
    good, rng, sizes = whole(), random.Random(7), []
    for _ in range(150):
        data = bytearray(good)
        for _ in range(rng.choice([1, 5, 50, 500])):
            data[rng.randrange(len(data))] = rng.randrange(256)
        at = rng.randrange(len(data))
        del data[at : at + rng.randrange(200)]
        with contextlib.suppress(DataError):
            log = ardupilot.streams(bytes(data), "x")
            sizes += [len(one.time_ns) for one in log.streams]
            assert all(
                (np.diff(one.time_ns) > 0).all() for one in log.streams if one.name not in {"VISO", "VISV"}
            )
    assert 0 < min(sizes) < max(sizes) == 40
