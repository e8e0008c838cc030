"""A trajectory from a file: splines through it, what is refused of it, and a perfect IMU that returns it."""

import re
from collections.abc import Callable
from pathlib import Path as File

import numpy as np
import polars as pl
import pytest
from numpy.typing import NDArray

from bottomlock.config.scenario import Scenario, load_scenario, parse_scenario
from bottomlock.errors import BottomlockError, DataError, ScenarioError
from bottomlock.io.track import read_track
from bottomlock.simulation.build import Simulation, build_simulation, closure
from bottomlock.simulation.path import resolved, truth_from_path
from tests.analytic import analytic_simulation

Floats = NDArray[np.float64]
ROWS = 1001
TIME_S: Floats = np.linspace(0.0, 250.0, ROWS)
"""250 s at 4 Hz."""


def motion(time_s: Floats) -> dict[str, Floats]:
    """A vehicle that winds, dives and rolls; degrees and metres."""
    north, east = 60.0 * np.sin(0.03 * time_s), 40.0 * np.sin(0.06 * time_s)
    course = np.arctan2(2.4 * np.cos(0.06 * time_s), 1.8 * np.cos(0.03 * time_s))
    return {
        "time_s": time_s, "north_m": north, "east_m": east, "depth_m": 20.0 + 5.0 * np.sin(0.05 * time_s),
        "roll_deg": 8.0 * np.sin(0.2 * time_s), "pitch_deg": 4.0 * np.cos(0.07 * time_s),
        "heading_deg": np.rad2deg(course) + 5.0 * np.sin(0.1 * time_s),
    }  # fmt: skip


POSITION = ("time_s", "north_m", "east_m", "depth_m")


def written(folder: File, columns: dict[str, Floats], name: str = "nav.csv") -> File:
    path = folder / name
    table = pl.DataFrame(columns)
    table.write_parquet(path) if path.suffix == ".parquet" else table.write_csv(path)
    return path


def scenario_along(file: File, keys: str = "") -> Scenario:
    """The packaged straight scenario's sensors along a file."""
    text = f'name = "own"\n[trajectory]\nfile = "{file.name}"\n{keys}\n[dvl]\nrate_hz = 1.0\nbeam_noise_mps = 0.042\n'
    imu = load_scenario("straight").imu.model_dump(exclude={"limits"})
    text += "[imu]\n" + "\n".join(
        f"{key} = {value!r}".replace("'", '"') for key, value in imu.items() if value is not None
    )
    return parse_scenario(text, place="own.toml", folder=file.parent)


def simulation_along(file: File, keys: str = "") -> Simulation:
    """Its world."""
    return build_simulation(scenario_along(file, keys))


def position_only(time_s: Floats = TIME_S) -> dict[str, Floats]:
    """The motion without attitude."""
    whole = motion(time_s)
    return {name: whole[name] for name in POSITION}


def noisy() -> dict[str, Floats]:
    """The motion as a log has it: 2 cm of noise."""
    generator = np.random.default_rng(18)
    return {
        name: values + (0.02 * generator.standard_normal(ROWS) if name != "time_s" else 0.0)
        for name, values in position_only().items()
    }


@pytest.mark.parametrize("way", ["track", "attitude"])
def test_a_perfect_imu_returns_the_path(tmp_path: File, way: str) -> None:
    """Position within 1 cm and attitude within 1e-6 rad after 250 s, as for the packaged trajectories."""
    simulation = simulation_along(written(tmp_path, position_only() if way == "track" else motion(TIME_S)))
    truth = simulation.truth()
    assert truth.time_ns[-1] >= 250 * 10**9
    position_m, attitude_rad = closure(simulation, truth)
    assert position_m < 0.01
    assert attitude_rad < 1e-6


def test_a_flown_truth_comes_back_from_a_few_rows(tmp_path: File) -> None:
    """The analytic figure eight, read at 2 Hz with its quaternions: the splines give back what lay between the rows."""
    flown = analytic_simulation("figure_eight").truth()
    every = slice(None, None, 75)
    columns = {f"position_t_m_{axis}": flown.position_t_m[every, k] for k, axis in enumerate("xyz")}
    columns |= {f"attitude_t_p_{axis}": flown.attitude_t_p[every, k] for k, axis in enumerate("wxyz")}
    file = tmp_path / "truth.parquet"
    pl.DataFrame({"time_ns": flown.time_ns[every], **columns}).write_parquet(file)
    truth = truth_from_path(
        file, rate_hz=150.0, gravity_mps2=flown.gravity_mps2, latitude_rad=flown.latitude_rad
    )
    np.testing.assert_allclose(truth.position_t_m, flown.position_t_m, atol=1e-4)
    np.testing.assert_allclose(
        np.abs(np.sum(truth.attitude_t_p * flown.attitude_t_p, axis=1)), 1.0, atol=1e-8
    )
    np.testing.assert_allclose(truth.omega_p_radps, flown.omega_p_radps, atol=1e-4)
    np.testing.assert_allclose(truth.force_p_mps2, flown.force_p_mps2, atol=1e-3)


def test_attitude_without_columns_is_that_of_the_track(tmp_path: File) -> None:
    """The velocity lies along the platform's x axis; a column of heading alone leaves sway."""
    truth = simulation_along(written(tmp_path, position_only())).truth()
    np.testing.assert_allclose(truth.velocity_p_mps[:, 1:], 0.0, atol=1e-12)
    columns = position_only() | {"heading_deg": np.full(ROWS, 30.0)}
    sideways = simulation_along(written(tmp_path, columns)).truth()
    assert np.abs(sideways.velocity_p_mps[:, 1]).max() > 1.0


def with_row(name: str, row: int, value: float) -> dict[str, Floats]:
    """The motion without attitude, with one number changed."""
    columns = position_only()
    columns[name] = columns[name].copy()
    columns[name][row] = value
    return columns


def without(keep: NDArray[np.bool_]) -> dict[str, Floats]:
    """The motion without attitude, without some rows."""
    return {name: values[keep] for name, values in position_only().items()}


def scaled(**factors: float) -> dict[str, Floats]:
    """The motion without attitude in other units."""
    return {name: values * factors.get(name, 1.0) for name, values in position_only().items()}


def renamed(**names: str) -> dict[str, Floats]:
    """The whole motion under other names of columns."""
    return {names.get(name, name): values for name, values in motion(TIME_S).items()}


KM = {"north_m": 1e-3, "east_m": 1e-3, "depth_m": 1e-3}
MISTAKES: list[tuple[Callable[[], dict[str, Floats]], str, str]] = [
    (lambda: with_row("north_m", 200, 500.0), "", r"row 200 is .* m from row 199.*: a jump in the file"),
    (
        lambda: with_row("north_m", 200, motion(TIME_S)["north_m"][200] + 0.5),
        "",
        r"row (199|200): .*: acceleration .*a jump in the file",
    ),
    (
        lambda: with_row("time_s", 200, 2.0),
        "",
        "row 200: time is .* after that of row 199, expected it to rise",
    ),
    (lambda: with_row("time_s", 200, TIME_S[199]), "", "row 200: time is 0 s .* there twice"),
    (lambda: with_row("east_m", 7, np.nan), "", "row 7: column 'east_m' is empty or no finite number"),
    (lambda: without(np.abs(np.arange(ROWS) - 300) > 20), "", "row 280 is 10.5 s after row 279.*: a gap"),
    (lambda: scaled(**KM), "", "are positions in km"),
    (lambda: scaled(time_s=1e3), "", "is the time in ms"),
    (lambda: scaled(time_s=1e-3), "", "is the time in ms|positions in mm"),
    (lambda: renamed(heading_deg="heading_rad"), "", "call the column heading_deg"),
    (lambda: renamed(pitch_deg="pitch_rad"), "", "row 0: pitch 4 rad.*call the column pitch_deg"),
    (
        lambda: renamed(north_m="latitude_deg", east_m="longitude_deg"),
        "",
        "is 6.* km from|no latitude|km from the",
    ),
    (lambda: renamed(north_m="x"), "", "no position, expected columns north_m and east_m"),
    (lambda: renamed(time_s="t"), "", "has no times, expected a column time_s .* waypoints are flown with"),
    (position_only, "speed_mps = 2.0", "trajectory.speed_mps is given, but the times of .* state the speed"),
    (position_only, "duration_s = 251.0", "lasts 250.000 s, expected at least the 251 s"),
    (position_only, "limits = { turn_deg_per_s = 2.0 }", "turn rate .* deg/s, expected at most 2"),
    (position_only, 'columns = { north_m = "x" }', "column 'x' is missing"),
    (position_only, 'columns = { north = "north_m" }', "trajectory.columns has no key 'north'"),
    (noisy, "", "acceleration .* noise of a log, expected samples of a smooth motion"),
    (lambda: without(np.arange(ROWS) < 4), "", "4 rows, expected at least 6; waypoints are flown"),
    (lambda: without(np.arange(ROWS) < 1), "", "1 rows, expected at least 6"),
]


@pytest.mark.parametrize(("columns", "keys", "message"), MISTAKES)
def test_what_is_no_path_is_named(
    tmp_path: File, columns: Callable[[], dict[str, Floats]], keys: str, message: str
) -> None:
    """One line with file, row or key, and the likely mistake."""
    file = written(tmp_path, columns())
    with pytest.raises(BottomlockError, match=message) as caught:
        simulation_along(file, keys).truth()
    assert "\n" not in str(caught.value)
    assert "nav.csv" in str(caught.value)


def test_latitudes_in_radians_are_noticed(tmp_path: File) -> None:
    """Radians under a name of degrees make a vehicle 57 times as slow."""
    whole = motion(TIME_S)
    latitude, longitude = 1.04 + whole["north_m"] / 6.36e6, 0.43 + whole["east_m"] / 3.2e6
    columns = {"time_s": TIME_S, "latitude_deg": latitude, "longitude_deg": longitude}
    with pytest.raises(ScenarioError, match="latitude and longitude in rad"):
        simulation_along(written(tmp_path, columns))
    right = {"time_s": TIME_S, "latitude_rad": latitude, "longitude_rad": longitude}
    assert simulation_along(written(tmp_path, right)).truth().position_t_m[0] == pytest.approx(
        [0.0, 0.0, 0.0]
    )


def test_a_file_in_degrees_gives_the_place(tmp_path: File) -> None:
    """Latitude and longitude of the scenario are the file's, unless they are stated; a contradiction is refused."""
    metres = motion(TIME_S)
    file = written(
        tmp_path,
        {
            "time_s": TIME_S,
            "latitude_deg": 59.45 + metres["north_m"] / 111_400.0,
            "longitude_deg": 24.70 + metres["east_m"] / 56_800.0,
        },
    )
    scenario = resolved(scenario_along(file))
    assert scenario.environment.latitude_deg == pytest.approx(59.45)
    assert scenario.environment.longitude_deg == pytest.approx(24.70)
    assert scenario.trajectory.duration_s == pytest.approx(250.0)
    stated = scenario_along(file, "[environment]\nlatitude_deg = 32.8")
    with pytest.raises(ScenarioError, match=r"latitude_deg is 32.8, but .*nav.csv begins at 59.4500"):
        build_simulation(stated)


@pytest.mark.parametrize("name", ["plan.kml", "plan.geojson", "plan.kmz", "plan.gpx"])
def test_a_file_that_is_no_table_is_refused(tmp_path: File, name: str) -> None:
    with pytest.raises(DataError, match=r"is no trajectory, expected a table with times, one of \.csv"):
        read_track(tmp_path / name)


def test_the_fingerprint_follows_the_file(tmp_path: File) -> None:
    """Another number in the file is another campaign; what a scenario dumps can be read again."""
    first = simulation_along(written(tmp_path, position_only()))
    second = simulation_along(written(tmp_path, with_row("depth_m", 5, 20.61)))
    assert first.scenario.content_hash() == second.scenario.content_hash()
    assert first.fingerprint() != second.fingerprint()
    again = Scenario.model_validate(first.scenario.model_dump())
    assert again.content_hash() == first.scenario.content_hash()


def test_iso_times_and_other_names(tmp_path: File) -> None:
    """Text times, with and without zone, and a map of columns."""
    columns = motion(TIME_S[:41])
    text = [f"2026-05-01T10:00:{t:06.3f}" + ("Z" if t % 2 else "") for t in columns["time_s"]]
    table = pl.DataFrame({"stamp": text, "x": columns["north_m"], "y": columns["east_m"]})
    table.write_csv(tmp_path / "nav.csv")
    track = read_track(tmp_path / "nav.csv", {"time": "stamp", "north_m": "x", "east_m": "y"})
    assert track.time_s == pytest.approx(columns["time_s"], abs=1e-9)
    assert not track.has_depth
    table.with_columns(pl.lit("ten").alias("stamp")).write_csv(tmp_path / "bad.csv")
    with pytest.raises(DataError, match=re.escape("row 0: time 'ten' is no ISO 8601 time")):
        read_track(tmp_path / "bad.csv", {"time": "stamp", "north_m": "x", "east_m": "y"})


def test_two_hundred_metres_of_latitude_are_that(tmp_path: File) -> None:
    """North and east are arcs of the ellipsoid: a minute at 45 degrees is 1852.2 m north, 1314 m east."""
    angles = np.array([0.0, 1.0 / 60.0])
    columns = {
        "time_s": 60.0 * np.arange(2.0),
        "latitude_deg": 45.0 + angles,
        "longitude_deg": angles - 180.0,
    }
    track = read_track(written(tmp_path, columns))
    assert track.position_t_m[1, :2] == pytest.approx([1852.2, 1314.2], abs=0.3)
    columns["longitude_deg"] = np.array([179.99, -179.99])
    across = read_track(written(tmp_path, columns))
    assert across.position_t_m[1, 1] == pytest.approx(1577.0, abs=1.0)


@pytest.mark.parametrize(
    ("section", "message"),
    [
        ('file = "a.csv"\nkind = "straight"', "kind 'file' and source 'file' exist together"),
        ('kind = "file"\nsource = "file"', "needs the key file"),
    ],
)
def test_a_file_and_its_kind_belong_together(section: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        parse_scenario(f'name = "own"\n[trajectory]\n{section}\n[dvl]\n[imu]\n', place="own.toml")
