"""Tables as loggers, spreadsheets and cut-off downloads leave them: what is read, and what is said of the rest."""

import gzip
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.spatial.transform import Rotation

from bottomlock.errors import DataError
from bottomlock.recordings.stream_sections import ImuStream
from bottomlock.recordings.streams import Attitudes, Inertial
from bottomlock.replay.case import load_case
from bottomlock.replay.init.any_table import AnyTable, read_any_table
from bottomlock.replay.init.attitude_part import angles_of
from bottomlock.replay.init.dvl_part import dvl_of_velocity
from bottomlock.replay.init.found import find_streams, in_order, table_times
from bottomlock.replay.init.guess import NOTHING
from bottomlock.replay.init.make import draft, make_case
from bottomlock.replay.init.positions import guess_positions
from bottomlock.replay.init.sources import read_sources
from bottomlock.replay.reading import read_streams
from bottomlock.replay.screen_aiding import screened
from tests.dive import drawn_dive, tables
from tests.dive_logs import write

ROWS = [(f"{1_764_000_000 + 0.25 * k:.2f}", f"{0.5 + 0.01 * k:.3f}", "-0.125") for k in range(40)]
NAMES = ("time_s", "vx", "vy")
PLAIN = "\n".join(",".join(row) for row in (NAMES, *ROWS)) + "\n"


def read(path: Path, content: str | bytes) -> AnyTable:
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_any_table(path)


def lines(text: str, *further: str, at: int) -> str:
    rows = text.splitlines()
    return "\n".join([*rows[:at], *further, *rows[at:]]) + "\n"


QUOTED = "\n".join(",".join(f'"{cell.replace(".", ",")}"' for cell in row) for row in (NAMES, *ROWS))


@pytest.mark.parametrize(
    ("content", "rows", "said"),
    [
        (PLAIN.encode("utf-16"), 40, ""),
        (PLAIN.encode("utf-16-le"), 40, ""),
        (PLAIN.replace(",", ", "), 40, ""),
        (QUOTED, 40, ""),
        ("Logger v2.1\nSerial: 7, port 3, firmware 5\n\n" + PLAIN, 40, ""),
        (PLAIN[:-9], 39, "1 lines are cut off or repeat the names, the first of them line 41: they are left out"),
        (QUOTED[:-3], 39, "line 41"),
        (PLAIN.replace("\n", "\r"), 40, ""),
        (PLAIN.replace("\n", ",\n").replace("vy,", "vy"), 40, ""),
        (lines(PLAIN, "1764000\0\0\0", at=20), 40, "line 21"),
        (lines(PLAIN, "$$#%&!!", at=20), 40, "line 21"),
        (lines(PLAIN, ",".join(NAMES), at=20), 40, "line 21"),
        (PLAIN.replace("0.600,", "N/A,"), 40, "1 cells of vx are no numbers ('N/A')"),
    ],
    ids=["UTF-16", "UTF-16 without a mark", "comma and space", "quoted decimal commas", "lines above", "cut off",
         "cut off in quotes", "carriage returns", "closing commas", "zeros", "garbage", "names", "N/A"],
)  # fmt: skip
def test_is_read_and_written_again(tmp_path: Path, content: str | bytes, rows: int, said: str) -> None:
    """A replay's reader takes none of them as it is, so that the case needs a table of its own."""
    table = read(tmp_path / "dvl.csv", content)
    assert table.frame.shape == (rows, 3)
    assert tuple(table.frame.columns) == NAMES
    assert table.frame["vy"].unique().to_list() == ["-0.125"]
    assert table.frame["vx"][1] == "0.510"
    assert not table.plain
    assert said in table.remark
    assert bool(said) == bool(table.remark)


@pytest.mark.parametrize(
    "content", [PLAIN, "\ufeff" + PLAIN, PLAIN.replace("0.600,", "NaN,"), PLAIN.replace("-0.125", "")]
)
def test_is_taken_as_it_is(tmp_path: Path, content: str) -> None:
    table = read(tmp_path / "dvl.csv", content)
    assert table.plain
    assert not table.remark


def test_lines_without_their_last_cells_are_no_damage(tmp_path: Path) -> None:
    """A logger that writes no separator behind its last value does so in many lines."""
    rows = [line.rpartition(",")[0] if k % 5 == 2 else line for k, line in enumerate(PLAIN.splitlines())]
    table = read(tmp_path / "dvl.csv", "\n".join(rows))
    assert table.frame.height == 40
    assert table.frame["vy"].null_count() == 8
    assert not table.remark


def test_words_are_no_numbers_of_a_column_of_words(tmp_path: Path) -> None:
    text = "\n".join(f"{line},{'mode' if not k else 'AUTO'}" for k, line in enumerate(PLAIN.splitlines()))
    table = read(tmp_path / "dvl.csv", text)
    assert table.frame["mode"].unique().to_list() == ["AUTO"]
    assert table.plain


def test_no_line_of_names_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="names none of its 3 columns"):
        read(tmp_path / "dvl.csv", PLAIN.partition("\n")[2])


def test_rows_in_no_order_are_sorted_by_their_times(tmp_path: Path) -> None:
    head, *rows = PLAIN.splitlines() + [f"{1_764_000_010 + 0.25 * k:.2f},0.1,0.2" for k in range(40)]
    for order in (rows[::-1], np.random.default_rng(1).permutation(rows).tolist()):
        table = in_order(read(tmp_path / "dvl.csv", "\n".join([head, *order])))
        times = table_times(table, "dvl").time_ns
        assert times is not None
        assert (np.diff(times) > 0).all()
        assert not table.plain
        assert "all are sorted by it" in table.remark
    assert in_order(read(tmp_path / "dvl.csv", "\n".join([head, *rows]))).plain


def test_copies_of_rows_do_not_even_the_times(tmp_path: Path) -> None:
    """Of every row twice, or of every tenth: the stamps are the times, and a clock leaves the copies out."""
    table = pl.DataFrame(
        {"time_s": 1.764e9 + 0.04 * np.arange(400), "vx": np.arange(400.0), "vy": 0.0, "vz": 0.0}
    )
    for every in (1, 10):
        rows = np.sort(np.concatenate([np.arange(400), np.arange(0, 400, every)]))
        times = table_times(AnyTable(tmp_path, table[rows], plain=True, units={}), "dvl")
        assert times.rate_hz is None
        assert times.time_ns is not None
        assert np.unique(times.time_ns).tolist() == np.round(table["time_s"].to_numpy() * 1e9).tolist()


def test_days_are_refused(tmp_path: Path) -> None:
    table = pl.DataFrame({"time": 45985.5 + 0.25 / 86400.0 * np.arange(400), "vx": 0.1, "vy": 0.0, "vz": 0.0})
    with pytest.raises(DataError, match=r"column 'time' is 45985\.5 .*are these days"):
        find_streams(AnyTable(tmp_path / "dvl.csv", table, plain=True, units={}))


@pytest.mark.parametrize(("factor", "code", "unit"), [(1.0, 9999.0, "m/s"), (1e3, -32768.0, "mm/s")])
def test_codes_for_no_velocity_do_not_tell_its_unit(
    tmp_path: Path, factor: float, code: float, unit: str
) -> None:
    rng, lost = np.random.default_rng(2), np.arange(600) % 6 == 2
    velocity = {f"v{axis}": np.where(lost, code, factor * 0.4 * rng.normal(size=600)) for axis in "xyz"}
    table = pl.DataFrame({"time_s": 1.764e9 + 0.25 * np.arange(600)} | velocity)
    dvl = dvl_of_velocity(find_streams(AnyTable(tmp_path, table, plain=True, units={}))[0])
    assert dvl.unit.value == unit
    assert len(dvl.time_ns) == 500
    assert np.abs(dvl.velocity_p_mps).max() < 3.0


@pytest.mark.parametrize(("east_m", "first_m"), [(512_000.0, 0.0), (12.0, 12.0)])
def test_positions_on_a_grid_are_from_the_first_of_them(
    tmp_path: Path, east_m: float, first_m: float
) -> None:
    """UTM coordinates taken as metres from the dive's origin put it at the pole."""
    place = {"easting": east_m + 0.4 * np.arange(100.0), "northing": 10.0 * east_m + 0.3 * np.arange(100.0)}
    table = AnyTable(
        tmp_path, pl.DataFrame({"time_s": 1.764e9 + np.arange(100.0)} | place), plain=True, units={}
    )
    found = guess_positions(find_streams(table)[0], np.zeros(0, dtype=np.int64), NOTHING)
    assert found is not None
    assert found.north_east_m[:2] == pytest.approx(
        np.array([[10.0 * first_m, first_m], [10.0 * first_m + 0.3, first_m + 0.4]])
    )
    assert (found.columns is None) == bool(first_m)


def test_without_an_imu_the_attitude_is_the_start(tmp_path: Path) -> None:
    """Also one whose motion does not tell its frames: nothing else has a level."""
    seconds = 1.764e9 + 0.5 * np.arange(240)
    angles = {"roll_deg": 1.0, "pitch_deg": -2.0, "heading_deg": 30.0}
    still = pl.DataFrame({"time_s": seconds}).with_columns(
        **{name: pl.lit(of) for name, of in angles.items()}
    )
    velocity = {
        f"v{axis}": 0.3 + 0.01 * np.random.default_rng(k).normal(size=240) for k, axis in enumerate("xyz")
    }
    still.write_csv(tmp_path / "ahrs.csv")
    pl.DataFrame({"time_s": seconds} | velocity).write_csv(tmp_path / "dvl.csv")
    case = load_case(make_case([tmp_path / "ahrs.csv", tmp_path / "dvl.csv"], tmp_path / "case.toml").case)
    assert (case.start.level, case.start.heading) == ("attitude", "attitude")


def test_a_table_of_all_sensors_holds_a_dvl_beside_its_positions(tmp_path: Path) -> None:
    """Beside raw inertial readings a velocity is a sensor's; beside positions alone it is that of an estimate."""
    columns = ["time_s", "ax", "ay", "az", "gx", "gy", "gz", "vx", "vy", "vz", "latitude", "longitude"]
    frame = pl.DataFrame({name: np.arange(60.0) for name in columns})
    of_logger, of_estimate = (
        [one.kind for one in find_streams(AnyTable(tmp_path / "log.csv", table, plain=True, units={}))]
        for table in (frame, frame.drop("ax"))
    )
    assert of_logger == ["imu", "velocity", "geodetic"]
    assert of_estimate == ["geodetic"]


@pytest.mark.parametrize(("content", "rows"), [("", 0), ("time_s,latitude,longitude\n", 1)])
def test_a_file_without_rows_says_so(tmp_path: Path, content: str, rows: int) -> None:
    with pytest.raises(DataError, match="no rows") as caught:
        read(tmp_path / "gps.csv", content)
    assert f"{rows} lines" in str(caught.value)


def test_what_is_compressed_says_so(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="is compressed; unpack it"):
        read(tmp_path / "imu.csv.gz", gzip.compress(PLAIN.encode()))


def test_a_duration_is_a_time(tmp_path: Path) -> None:
    """A replay's reader takes numbers: the table is written again."""
    frame = pl.DataFrame({"time": pl.Series(range(60), dtype=pl.Duration("us")), "vx": np.zeros(60)})
    times = table_times(AnyTable(tmp_path / "dvl.parquet", frame, plain=True, units={}), "dvl")
    assert times.time_ns is not None
    assert times.time_ns[:3].tolist() == [0, 1000, 2000]
    assert not times.column
    assert not times.epoch


@pytest.mark.parametrize(
    ("name", "factor", "unit"),
    [("v{} [knots]", 3600.0 / 1852.0, "kn"), ("v{}_kn", 3600.0 / 1852.0, "kn"), ("v{} (ft/s)", 1.0 / 0.3048, "ft/s")],
)  # fmt: skip
def test_units_of_seamen(tmp_path: Path, name: str, factor: float, unit: str) -> None:
    velocity = {name.format(axis): factor * np.linspace(0.1, 0.5, 100) for axis in "xyz"}
    table = pl.DataFrame({"time_s": 1.764e9 + 0.25 * np.arange(100)} | velocity)
    dvl = dvl_of_velocity(find_streams(AnyTable(tmp_path, table, plain=True, units={}))[0])
    assert (dvl.unit.value, dvl.unit.known) == (unit, True)
    assert dvl.velocity_p_mps[-1] == pytest.approx([0.5] * 3)


def test_a_unit_that_is_not_known_is_a_question(tmp_path: Path) -> None:
    velocity = {f"v{axis} [furlongs]": np.linspace(0.1, 0.5, 100) for axis in "xyz"}
    table = pl.DataFrame({"time_s": 1.764e9 + 0.25 * np.arange(100)} | velocity)
    dvl = dvl_of_velocity(find_streams(AnyTable(tmp_path, table, plain=True, units={}))[0])
    assert not dvl.unit.known
    assert "furlongs" in dvl.unit.why


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_degrees_and_minutes_of_a_receiver(tmp_path: Path, sign: float) -> None:
    """45 degrees 7.5 minutes north, 10 degrees 30 minutes east or west, and no place in the Gulf of Guinea."""
    place = {"latitude": 4507.5 + 1e-4 * np.arange(50.0), "longitude": sign * 1030.0 + np.zeros(50)}
    frame = pl.DataFrame({"time_s": 1.764e9 + np.arange(50.0)} | place)
    found = guess_positions(
        find_streams(AnyTable(tmp_path, frame, plain=True, units={}))[0], np.zeros(0, dtype=np.int64), NOTHING
    )
    assert found is not None
    assert np.rad2deg([found.latitude_rad, found.longitude_rad]) == pytest.approx([45.125, sign * 10.5])


def test_hundredths_of_a_degree_are_refused(tmp_path: Path) -> None:
    angles = {
        "roll": 100.0 * np.sin(np.arange(80.0)),
        "pitch": np.full(80, 420.0),
        "yaw": np.arange(80.0) * 400.0,
    }
    frame = pl.DataFrame({"time_s": 1.764e9 + np.arange(80.0)} | angles)
    with pytest.raises(DataError, match=r"roll or pitch of 420,.*hundredths"):
        angles_of(find_streams(AnyTable(tmp_path / "ahrs.csv", frame, plain=True, units={}))[0])


def test_positions_with_letters_are_named(tmp_path: Path) -> None:
    frame = pl.DataFrame({"time_s": np.arange(9.0), "latitude": ["45.1N"] * 9, "longitude": ["10.2E"] * 9})
    frame.write_csv(tmp_path / "gps.csv")
    with pytest.raises(DataError, match=r"latitude, longitude hold no numbers \('45\.1N'\)"):
        read_sources([tmp_path / "gps.csv"])


def test_beams_alone_need_three_of_them_or_an_imu(tmp_path: Path) -> None:
    """The case would not run: nothing tells how the vehicle moves."""
    held = dict(tables(drawn_dive(3, seconds=60.0)))
    held["beams"] = held["beams"].with_columns(beam1_mps=pl.lit(None), beam2_mps=pl.lit(None))
    with pytest.raises(DataError, match=r"no file holds an IMU, and 0 pings have a velocity"):
        draft(write(held, tmp_path, "beams ahrs"))


def test_readings_that_a_table_holds_until_the_next_are_read_once(tmp_path: Path) -> None:
    """A logger that fills the rows of an IMU with the last reading of every other sensor."""
    dive = tables(drawn_dive(3, seconds=60.0))
    table = dive["imu"]
    for name in ("velocity", "ahrs"):
        table = table.join_asof(dive[name].drop_nulls(), on="time_s")
    found = {one.kind: one for one in find_streams(AnyTable(tmp_path, table, plain=True, units={}))}
    assert found["imu"].table.frame.height == table.height
    for name, kind in (("velocity", "velocity"), ("ahrs", "attitude")):
        assert found[kind].table.frame.height == pytest.approx(dive[name].drop_nulls().height, abs=2)
        assert "hold the reading before them" in found[kind].table.remark


def test_a_compass_that_stands_still_beside_inclinometers_is_left_out() -> None:
    dive = drawn_dive(3, seconds=120.0)
    rpy = dive.angles.copy()
    rpy[300:, 2] = rpy[300, 2]
    time_ns = (dive.slow_s * 1e9).astype(np.int64)
    inertial = Inertial((dive.imu_s * 1e9).astype(np.int64), dive.force, dive.omega)
    aiding = {"attitude": Attitudes(time_ns, Rotation.from_euler("ZYX", rpy[:, ::-1]))}
    (found,) = screened(aiding, inertial, made=False)
    assert found.why == "stands still"
    assert found.rows == len(rpy) - 301
    assert len(aiding["attitude"].time_ns) == 301


@pytest.mark.parametrize("name", ["velocity", "beams"])
def test_a_dvl_that_stands_still_is_left_out(tmp_path: Path, name: str) -> None:
    """Its driver repeats a report for a minute; the noise that `--init` finds is that of the other pings."""
    held, noise = dict(tables(drawn_dive(3, seconds=150.0))), []
    stands = pl.int_range(pl.len()).is_between(200, 440)
    frozen = held[name].with_columns(
        pl.when(stands).then(pl.col(one).get(200)).otherwise(pl.col(one)).alias(one)
        for one in held[name].columns[1:]
    )
    for table in (held[name], frozen):
        made = make_case(
            write(held | {name: table}, tmp_path, f"imu {name} ahrs"), tmp_path / "case.toml", force=True
        )
        case = load_case(made.case)
        assert isinstance(case.imu, ImuStream)
        noise.append(case.imu.errors.accel_noise_mps_per_rt_h)
    (left,) = read_streams(case).left_out
    assert (left.stream, left.why, left.rows) == ("dvl", "stands still", 240)
    assert noise[1] == pytest.approx(noise[0], rel=0.3)
