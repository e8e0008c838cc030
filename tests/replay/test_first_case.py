"""`replay --init`: units, axes, clocks and columns of a synthetic dive are found back, and the case runs at once."""

import datetime as dt
import re
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bottomlock.errors import DataError, OutputError
from bottomlock.replay.case import Case, load_case
from bottomlock.replay.init.any_table import AnyTable
from bottomlock.replay.init.attitude_part import angles_of
from bottomlock.replay.init.found import find_streams
from bottomlock.replay.init.imu_part import guess_imu
from bottomlock.replay.init.make import make_case
from bottomlock.replay.run import replay_case
from tests.dive import EARTH, Dive, Floats, drawn_dive
from tests.dive_logs import write_a50, write_csv
from tests.replay.undiagnosed import tc_row, unsmoothed

EPOCH_S = 1.7e9
G = 9.80665


@pytest.fixture(scope="module")
def dive() -> Dive:
    return drawn_dive(3, seconds=120.0)


def imu_columns(
    dive: Dive, force: float = 1.0, omega: float = 1.0, axes: tuple[str, ...] = ("x", "y", "z")
) -> list[Any]:
    """Readings in other units and axes: `axes` names the platform axis that each sensor axis points along."""
    chosen = [("xyz".index(a[-1]), -1.0 if a.startswith("-") else 1.0) for a in axes]
    return [s * dive.force[:, k] / force for k, s in chosen] + [
        s * dive.omega[:, k] / omega for k, s in chosen
    ]


def made(dive: Dive, folder: Path, imu: dict[str, Any], *files: Path, start_s: float = EPOCH_S) -> Case:
    """The case of the log of an A50, of a table of the IMU, and of other files."""
    write_csv(folder / "imu.csv", imu)
    make_case(
        [write_a50(dive, folder / "dvl.json", start_s=start_s), folder / "imu.csv", *files],
        folder / "case.toml",
    )
    return load_case(folder / "case.toml")


def inertial(
    dive: Dive, seconds: NDArray[Any] | None = None, column: str = "t", names: str = "short", **units: Any  # noqa: ANN401
) -> dict[str, Any]:  # fmt: skip
    """A table of the IMU."""
    times = dive.imu_s + EPOCH_S if seconds is None else seconds
    return {column: times} | dict(zip(NAMES[names], imu_columns(dive, **units), strict=True))


NAMES = {
    "spaced": ["Acc X [g]", "Acc Y [g]", "Acc Z [g]", "GyrX", "GyrY", "GyrZ"],
    "ros": [f"field.{q}.{a}" for q in ("linear_acceleration", "angular_velocity") for a in "xyz"],
    "short": ["ax", "ay", "az", "wx", "wy", "wz"],
    "words": ["accel_x", "accel_y", "accel_z", "gyro_x (deg/s)", "gyro_y (deg/s)", "gyro_z (deg/s)"],
}


@pytest.mark.first_cases(2)
@pytest.mark.parametrize(
    ("names", "force", "omega", "axes", "unit_f", "unit_w", "found"),
    [
        ("spaced", G, np.pi / 180, ("x", "-y", "-z"), "g", "deg/s", ("x", "-y", "-z")),
        ("ros", 1.0, 1.0, ("x", "y", "z"), "m/s2", "rad/s", ("x", "y", "z")),
        ("short", G * 1e-3, 1.0, ("y", "x", "z"), "mg", "rad/s", ("y", "x", "z")),
        ("words", 1.0, np.pi / 180, ("z", "-y", "x"), "m/s2", "deg/s", ("z", "-y", "x")),
        ("short", 1.0, np.pi / 180, ("-x", "-y", "z"), "m/s2", "deg/s", ("-x", "-y", "z")),
    ],
)  # fmt: skip
def test_units_and_axes_are_found_back(
    dive: Dive, tmp_path: Path, names: str, force: float, omega: float, axes: tuple[str, ...], unit_f: str,
    unit_w: str, found: tuple[str, ...],
) -> None:  # fmt: skip
    case = made(dive, tmp_path, inertial(dive, names=names, force=force, omega=omega, axes=axes))
    assert (case.readings.force_unit, case.readings.omega_unit, case.readings.axes) == (unit_f, unit_w, found)
    row = tc_row(case)
    assert row["nis_mean_over_fixes"] / row["nis_degrees_mean_over_fixes"] < 3.0
    assert row["fixes_rejected"] == 0


@pytest.mark.first_cases(2)
@pytest.mark.parametrize(
    ("column", "factor", "unit", "start_s"),
    [
        ("timestamp", 1e9, "ns", EPOCH_S),
        ("TimeUS", 1e6, "us", 100.0),
        ("t", 1e3, "ms", 0.0),
        ("time", 1.0, "s", EPOCH_S),
    ],
)
def test_clocks_are_found_back(
    dive: Dive, tmp_path: Path, column: str, factor: float, unit: str, start_s: float
) -> None:
    """The DVL counts from its own zero, 40 s after the IMU: the motion tells the offset."""
    seconds = np.round((dive.imu_s + start_s) * factor, 3)
    time = seconds.astype(np.int64) if factor > 1.0 else seconds
    case = made(dive, tmp_path, inertial(dive, time, column), start_s=7040.0)
    assert case.readings.clock.unit == unit
    assert case.dvl.clock.offset_s == pytest.approx(start_s - 7040.0, abs=0.05)


def test_a_european_spreadsheet(dive: Dive, tmp_path: Path) -> None:
    """Semicolons, decimal commas, ISO dates and a row of units."""
    rows = ["Zeit;".replace("Zeit", "time") + "ax;ay;az;gx;gy;gz", "UTC;m/s2;m/s2;m/s2;deg/s;deg/s;deg/s"]
    numbers = np.column_stack([dive.force, np.rad2deg(dive.omega)])
    for second, row in zip(dive.imu_s, numbers, strict=True):
        when = dt.datetime.fromtimestamp(EPOCH_S + second, dt.UTC).strftime("%Y-%m-%d %H:%M:%S.%fZ")
        rows.append(";".join([when, *(f"{x:.6f}".replace(".", ",") for x in row)]))
    (tmp_path / "imu.csv").write_text("\n".join(rows), encoding="utf-8")
    make_case(
        [write_a50(dive, tmp_path / "dvl.json", start_s=EPOCH_S), tmp_path / "imu.csv"],
        tmp_path / "case.toml",
    )
    case = load_case(tmp_path / "case.toml")
    assert case.readings.file.name == "case_imu.parquet"
    assert case.readings.omega_unit == "deg/s"
    assert tc_row(case)["fixes_rejected"] == 0


@pytest.mark.first_cases(1)
@pytest.mark.parametrize("quaternion", [False, True])
def test_an_attitude_in_other_frames_on_another_clock(dive: Dive, tmp_path: Path, quaternion: bool) -> None:
    """East-north-up angles in degrees or as a quaternion, 0.4 s late."""
    k = slice(0, None, 5)
    roll, pitch, yaw = dive.rpy[k].T
    enu = Rotation.from_euler("ZYX", np.stack([np.pi / 2 - yaw, -pitch, roll], axis=1))
    columns: dict[str, Any] = {"t": dive.imu_s[k] + EPOCH_S + 0.4}
    if quaternion:
        columns |= {f"orientation.{a}": enu.as_quat()[:, j] for j, a in enumerate("xyzw")}
    else:
        columns |= dict(zip(("yaw", "pitch", "roll"), np.rad2deg(enu.as_euler("ZYX")).T, strict=True))
    case = made(dive, tmp_path, inertial(dive), write_csv(tmp_path / "ahrs.csv", columns))
    assert case.attitude is not None
    assert case.attitude.frame == "enu_flu"
    assert case.attitude.unit == ("rad" if quaternion else "deg")
    assert case.attitude.clock.offset_s == pytest.approx(-0.4, abs=0.06)
    assert case.start.heading == "attitude"
    assert tc_row(case)["fixes_rejected"] < 10


def test_gyros_that_agree_with_an_attitude_make_it_no_gyrocompass(tmp_path: Path) -> None:
    """Gyros without any bias show a good IMU. They say nothing of north."""
    dive = drawn_dive(3, seconds=120.0, gyro_bias=0.0)
    earth = Rotation.from_euler("ZYX", dive.rpy[:, ::-1]).inv().apply(EARTH)
    imu = {"t": dive.imu_s} | dict(zip(NAMES["short"], [*dive.force.T, *(dive.omega - earth).T], strict=True))
    ahrs = {"t": dive.imu_s} | dict(zip(("roll", "pitch", "yaw"), np.rad2deg(dive.rpy.T), strict=True))
    case = made(dive, tmp_path, imu, write_csv(tmp_path / "ahrs.csv", ahrs), start_s=0.0)
    assert case.attitude is not None
    assert case.attitude.grade == "mti_ahrs"


@pytest.mark.parametrize(
    ("name", "scale", "unit"),
    [("pressure", 1e2, "Pa"), ("pressure_mbar", 1.0, "mbar"), ("press", 0.1, "kPa")],
)
def test_a_pressure(dive: Dive, tmp_path: Path, name: str, scale: float, unit: str) -> None:
    k = slice(0, None, 10)
    pressure = (1013.25 + dive.position[k, 2] * 1025 * G / 100) * scale
    depth = write_csv(tmp_path / "depth.csv", {"t": dive.imu_s[k], name: pressure})
    case = made(dive, tmp_path, inertial(dive, dive.imu_s), depth, start_s=0.0)
    assert case.depth is not None
    assert case.depth.unit == unit
    assert case.depth.offset_m == pytest.approx(-10.08, abs=0.01)
    assert case.start.position_m[2] == pytest.approx(3.0, abs=0.3)


def test_what_cannot_be_used_is_said_in_one_line(dive: Dive, tmp_path: Path) -> None:
    log = write_a50(dive, tmp_path / "dvl.json")
    imu = inertial(dive, dive.imu_s)
    with pytest.raises(DataError, match="no file holds specific force and angular rate"):
        make_case([log], tmp_path / "case.toml")
    with pytest.raises(DataError, match="no file holds a DVL"):
        make_case([write_csv(tmp_path / "imu.csv", imu)], tmp_path / "case.toml")
    free = imu | {name: imu[name] * 0.01 for name in ("ax", "ay", "az")}
    with pytest.raises(DataError, match="is gravity removed"):
        make_case([log, write_csv(tmp_path / "free.csv", free)], tmp_path / "case.toml")
    with pytest.raises(DataError, match="none of its columns has a known name"):
        make_case(
            [log, write_csv(tmp_path / "x.csv", {"foo": dive.imu_s, "bar": dive.imu_s})],
            tmp_path / "case.toml",
        )
    assert not (tmp_path / "case.toml").exists()
    make_case([log, tmp_path / "imu.csv"], tmp_path / "case.toml")
    with pytest.raises(OutputError, match="is there already"):
        make_case([log, tmp_path / "imu.csv"], tmp_path / "case.toml")
    for line in (tmp_path / "case.toml").read_text(encoding="utf-8").splitlines():
        assert len(line) < 140


def stamps(kind: str, seconds: Floats) -> Floats:
    """Times as poor loggers write them."""
    random = np.random.default_rng(0)
    found = seconds.copy()
    if kind == "repeats":
        rows = random.choice(np.arange(1, len(found)), 20, replace=False)
        found[rows] = found[rows - 1]
    elif kind == "burst":
        found[500:530] = found[500]
    elif kind == "backward":
        found[1000:1010] -= 0.5
    elif kind == "jitter":
        found += 0.012 * random.standard_normal(len(found))
    else:
        found = np.floor(found)
    return found


@pytest.mark.first_cases(2)
@pytest.mark.parametrize("kind", ["repeats", "burst", "backward", "jitter", "whole seconds"])
def test_poor_stamps_keep_their_column(dive: Dive, tmp_path: Path, kind: str) -> None:
    """Few rows out of order are left out and named; stamps that jitter or are coarse begin an even rate."""
    case = made(dive, tmp_path, inertial(dive, stamps(kind, dive.imu_s) + EPOCH_S))
    clock = case.readings.clock
    assert clock.column == "t"
    text = (tmp_path / "case.toml").read_text(encoding="utf-8")
    if kind in {"jitter", "whole seconds"}:
        assert clock.rate_hz == pytest.approx(50.0, rel=2e-4)
        assert "the stamps are coarse or jitter by up to" in text
    else:
        assert (clock.rate_hz, clock.unordered) == (None, "drop")
        assert re.search(
            r"rows repeat a time or go back, the first of them row \d+: they are\s+(# )?left out", text
        )
    # Stamps cut to whole seconds are half a second early; the motion tells.
    assert case.dvl.clock.offset_s == pytest.approx(-0.5 if kind == "whole seconds" else 0.0, abs=0.05)
    row = tc_row(case)
    assert row["nis_mean_over_fixes"] / row["nis_degrees_mean_over_fixes"] < 3.0


@pytest.mark.first_cases(1)
@pytest.mark.parametrize("given_deg", [0.0, 120.0, 211.0])
def test_a_heading_that_nothing_tells_is_unknown(dive: Dive, tmp_path: Path, given_deg: float) -> None:
    """±180°: the track keeps its shape and claims nothing of its direction; it is called relative.

    Gyros no better than the Earth's rate would else find a heading that is 170° wrong, and claim it to 24°.
    """
    case = made(dive, tmp_path, inertial(dive, dive.imu_s), start_s=0.0)
    assert (case.start.heading_deg, case.start.heading_sd_deg) == (0.0, 180.0)
    start = case.start.model_copy(update={"heading_deg": given_deg})
    result = replay_case(unsmoothed(case.model_copy(update={"start": start}).with_methods(["tc"])))
    rows = result.samples.sort("time_ns")
    assert np.rad2deg(rows["sd_misalignment_down_rad"].to_numpy()).min() > 170.0
    true = np.interp(
        rows["time_ns"] * 1e-9, np.linspace(0.0, 120.0, len(dive.rpy)), np.unwrap(dive.rpy[:, 2])
    )
    off = np.unwrap(np.deg2rad(rows["yaw_deg"].to_numpy()) - true)
    assert np.ptp(off) < np.deg2rad(2.5)
    assert "relative_track" in [one["kind"] for one in result.manifest["findings"]]
    assert result.manifest["answer"]["verdict"] == "partly"


@pytest.mark.parametrize(
    ("yaw", "scalar", "unit_known", "why"),
    [
        (0.6, "first", True, "off gravity, else"),
        (0.6, "last", True, "the last column is the scalar"),
        (np.pi, "first", False, "neither gyros nor gravity tell it"),
    ],
)
def test_the_scalar_of_a_numbered_quaternion(yaw: float, scalar: str, unit_known: bool, why: str) -> None:
    """A vehicle that does not turn: gravity tells it, but for a heading at which both orders are level."""
    rng, n = np.random.default_rng(2), 400
    time_ns = np.arange(n, dtype=np.int64) * 100_000_000
    rpy = np.tile([0.02, -0.03, yaw], (n, 1))
    q = np.roll(Rotation.from_euler("ZYX", rpy[:, ::-1]).as_quat(), int(scalar == "first"), axis=1)
    frame = pl.DataFrame({"time_ns": time_ns} | {f"q{k}": one for k, one in enumerate(q.T)})
    (found,) = find_streams(AnyTable(Path("ahrs.csv"), frame, plain=True, units={}))
    force = np.tile([0.0, 0.0, -G], (n, 1)) + 0.05 * rng.normal(size=(n, 3))
    turns = 0.01 * rng.normal(size=(n, 3))
    names = [*(f"a{a}" for a in "xyz"), *(f"w{a}" for a in "xyz")]
    readings = pl.DataFrame({"time_ns": time_ns} | dict(zip(names, np.hstack([force, turns]).T, strict=True)))
    imu = guess_imu(find_streams(AnyTable(Path("imu.csv"), readings, plain=True, units={}))[0], None)
    for sensor in (imu, None):
        angles, unit = angles_of(found, sensor)
        assert (unit.known, why in unit.why) == (unit_known, True)
        assert not unit_known or np.allclose(angles, rpy)


def test_four_numbers_without_the_norm_of_a_quaternion_are_none() -> None:
    columns = {"t": np.arange(100) * 0.1} | {f"q{k}": np.full(100, 0.9) for k in range(4)}
    assert not find_streams(AnyTable(Path("flow.csv"), pl.DataFrame(columns), plain=True, units={}))


def test_the_depth_begins_a_dive_whose_positions_have_no_height(dive: Dive, tmp_path: Path) -> None:
    """53 m down, followed acoustically: positions of the surface's 0 m would be 50 sigma off the depth."""
    k = slice(0, None, 25)
    depth = write_csv(
        tmp_path / "depth.csv", {"t": dive.imu_s[k] + EPOCH_S, "depth": dive.position[k, 2] + 50.0}
    )
    north, east = dive.position[k, :2].T
    places = {"t": dive.imu_s[k] + EPOCH_S, "lat": 45.0 + north / 111_131.745, "lon": 10.0 + east / 78_846.8}
    case = made(dive, tmp_path, inertial(dive), depth, write_csv(tmp_path / "usbl.csv", places))
    assert case.start.position == "reference"
    assert case.start.position_sd_m == (1.0, 1.0, 100.0)
