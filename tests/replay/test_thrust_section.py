"""Drives in a replay, by revolutions or forces: what reaches the filter, how it fits, the sections' keys."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bottomlock.errors import DataError, Note, ScenarioError
from bottomlock.kernel.models import ThrustModel
from bottomlock.recordings.drives import SpeedByForces
from bottomlock.recordings.readings import EffortReading
from bottomlock.recordings.streams import Floats
from bottomlock.replay.case import load_case
from bottomlock.replay.reading import read_streams
from bottomlock.replay.rerun import kernel_log, prepare
from bottomlock.replay.run import replay_case
from bottomlock.replay.tune.parameters import noise_of, with_values
from tests.dive import Dive, drawn_dive, gauss_markov
from tests.dive_logs import write_csv
from tests.replay.test_water_track import CASE as WATER_CASE
from tests.replay.test_water_track import CURRENT, end_m, write
from tests.replay.undiagnosed import replay_undiagnosed

ADVANCE_M, SLIP_MPS, SLIP_TIME_S, NOISE_MPS = 0.1, 0.02, 5.0, 0.01
MASS, LIGHT_N = np.array([20.0, 21.0, 32.0]), 2.4
LINEAR, QUADRATIC = np.array([14.0, 5.0, 33.0]), np.array([141.0, 217.0, 190.0])
NOISE_N = 1.0
THRUST = """[thrust]
file = "shaft.csv"
clock = { column = "time" }
column = "rpm"
unit = "rpm"
advance_m = 0.1
"""
EFFORT = """[effort]
file = "thrusters.csv"
clock = { column = "time" }
force = ["x", "y", "z"]
mass_kg = [20.0, 21.0, 32.0]
linear_drag_kg_per_s = [14.0, 5.0, 33.0]
quadratic_drag_kg_per_m = [141.0, 217.0, 190.0]
buoyancy_n = 2.4
"""
BARE = WATER_CASE.replace("[water_track]\nnoise_mps = 0.02\n", "").replace('"ins", "tc"', '"tc"')
SEEDS = tuple(range(1, 11))


def with_section(section: str) -> str:
    """The case with a section of a drive."""
    return BARE.replace("[reference]", f"{section}[reference]")


def revolutions_of(dive: Dive, seed: int = 1) -> tuple[Floats, Floats]:
    """Times, s, and revolutions a second of the true speed through the water, with slip and noise of their own."""
    rng = np.random.default_rng(seed)
    seconds = np.arange(0.55, dive.imu_s[-1] - 0.5, 1.0)
    turned = Rotation.from_euler("ZYX", dive.at(seconds, np.unwrap(dive.rpy, axis=0))[:, ::-1])
    through = (dive.at(seconds, dive.velocity) - turned.inv().apply(CURRENT))[:, 0]
    slip = gauss_markov(SLIP_MPS * rng.normal(size=len(seconds)), 1.0, SLIP_TIME_S)
    return seconds, (through - slip - NOISE_MPS * rng.normal(size=len(seconds))) / ADVANCE_M


def forces_of(dive: Dive, seed: int) -> tuple[Floats, Floats]:
    """Times, s, and forces, N, that the true motion takes, axis by axis, with slip and noise of their own."""
    t, rng = dive.imu_s, np.random.default_rng(seed)
    turned = Rotation.from_euler("ZYX", np.unwrap(dive.rpy, axis=0)[:, ::-1])
    u = dive.velocity - turned.inv().apply(CURRENT)
    rate = np.gradient(np.unwrap(dive.rpy, axis=0), t, axis=0)
    roll, pitch, _ = dive.rpy.T
    # Angular rate of Euler angles (Groves 2013, Eq. 2.58).
    omega = np.stack(
        [
            rate[:, 0] - np.sin(pitch) * rate[:, 2],
            np.cos(roll) * rate[:, 1] + np.sin(roll) * np.cos(pitch) * rate[:, 2],
            -np.sin(roll) * rate[:, 1] + np.cos(roll) * np.cos(pitch) * rate[:, 2],
        ],
        axis=1,
    )
    accelerating = MASS * np.gradient(u, t, axis=0) + np.cross(omega, MASS * u)
    seconds = np.arange(0.55, t[-1] - 0.5, 0.5)
    count = len(seconds)
    slip = gauss_markov(SLIP_MPS * rng.normal(size=(count, 3)), 0.5, SLIP_TIME_S)
    by_thrusters = dive.at(seconds, u) - slip
    drag = LINEAR * by_thrusters + QUADRATIC * np.abs(by_thrusters) * by_thrusters
    down_p = turned.inv().apply([0.0, 0.0, 1.0])
    held = dive.at(seconds, accelerating + LIGHT_N * down_p)
    return seconds, drag + held + NOISE_N * rng.normal(size=(count, 3))


def write_dive(folder: Path, dive: Dive, seed: int = 1) -> Path:
    """The tables of a dive with those of its shaft and its thrusters; returns the case's path."""
    path = write(folder, dive)
    seconds, turns = revolutions_of(dive, seed)
    columns = {"time": seconds, "rpm": 60.0 * turns, "hz": turns, "rad_s": 2.0 * np.pi * turns}
    spiked = np.where(np.arange(len(turns)) == 19, 1e9, columns["rpm"])
    write_csv(folder / "shaft.csv", columns | {"still": 0.0 * turns, "spiked": spiked})
    seconds, force_n = forces_of(dive, seed)
    columns = {"time": seconds, **dict(zip("xyz", force_n.T, strict=True))}
    spiked = np.where(np.arange(len(seconds)) == 20, 1e6, force_n[:, 0])
    others = {"still": 0.0 * seconds, "many": 1e4 * force_n[:, 0], "spiked": spiked}
    write_csv(folder / "thrusters.csv", columns | others)
    return path


@pytest.fixture(scope="module")
def case_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_dive(tmp_path_factory.mktemp("drives"), drawn_dive(7, seconds=210.0))


def saved(case_file: Path, text: str) -> Path:
    """Another case of the same tables."""
    path = case_file.with_name("other.toml")
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def ends(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Floats]:
    """(10, 2) errors of `tc` and their sigma, m, after 140 s without the bottom, of ten dives."""
    sections = {"without": "", "velocity": THRUST, "all": f'{THRUST}corrects = "all"\n'}
    folder = tmp_path_factory.mktemp("dives")
    errors: dict[str, list[tuple[float, float]]] = {name: [] for name in sections}
    for seed in SEEDS:
        path = write_dive(folder, drawn_dive(seed, seconds=210.0), seed)
        for name, section in sections.items():
            path.write_text(with_section(section).replace('"tc", "sway_current"', '"tc"'), encoding="utf-8")
            result = replay_undiagnosed(load_case(path))
            last = result.samples.filter(what_if="hidden").tail(1)
            sd = last.select("sd_position_north_m", "sd_position_east_m").to_numpy()
            errors[name].append((end_m(result, "hidden", "tc"), float(np.linalg.norm(sd))))
    return {name: np.array(of) for name, of in errors.items()}


@pytest.mark.long
@pytest.mark.parametrize(
    ("corrects", "factor", "least", "over_sigma"), [("velocity", 2.33, 1.64, 0.95), ("all", 5.4, 3.4, 0.83)]
)
def test_factors_of_the_page(
    ends: dict[str, Floats], corrects: str, factor: float, least: float, over_sigma: float
) -> None:
    """docs/howto/thrust.md: how much nearer the dives end, and the RMS of error over sigma."""
    factors = ends["without"][:, 0] / ends[corrects][:, 0]
    assert np.median(factors) == pytest.approx(factor, rel=0.05)
    assert factors.min() == pytest.approx(least, rel=0.05)
    ratio = np.sqrt(np.mean((ends[corrects][:, 0] / ends[corrects][:, 1]) ** 2))
    assert ratio == pytest.approx(over_sigma, rel=0.05)


@pytest.mark.parametrize(("unit", "column"), [("rpm", "rpm"), ("Hz", "hz"), ("rad/s", "rad_s")])
def test_the_revolutions_given_are_those_of_the_section(case_file: Path, unit: str, column: str) -> None:
    """A second, on the clock of the case, in every unit; every second row where the section says so."""
    section = THRUST.replace('"rpm"\nunit = "rpm"', f'"{column}"\nunit = "{unit}"\nevery = 2')
    section = section.replace('{ column = "time" }', '{ column = "time", offset_s = 2.5 }')
    case = load_case(saved(case_file, with_section(section)))
    streams = read_streams(case)
    seconds, turns = revolutions_of(drawn_dive(7, seconds=210.0))
    assert "thrust" in streams.aiding
    np.testing.assert_allclose(streams.aiding["thrust"].revolutions_hz, turns[::2], atol=1e-8)
    np.testing.assert_allclose(streams.aiding["thrust"].time_ns * 1e-9, seconds[::2] + 2.5, atol=1e-9)
    prepared = prepare(case, streams)
    log = kernel_log(case, prepared, streams.beams.valid[prepared.pings])
    end = int(np.searchsorted(streams.aiding["thrust"].time_ns, log["imu_time_ns"][-1] + 1))
    assert end < len(seconds[::2])
    np.testing.assert_array_equal(log["thrust_time_ns"], streams.aiding["thrust"].time_ns[:end])
    ahead_mps = 0.1 * streams.aiding["thrust"].revolutions_hz[:end]
    np.testing.assert_array_equal(log["thrust_speed_p_mps"].T, [ahead_mps, 0.0 * ahead_mps, 0.0 * ahead_mps])


def test_the_forces_given_are_those_of_the_section(case_file: Path) -> None:
    """On the clock of the case, as speeds; model and option are those of the keys."""
    keys = "uncertainty_percent = 5.0\nslip_mps = 0.03\nslip_time_s = 8.0\nnoise_mps = 0.02\n"
    keys += 'lever_arm_m = [0.1, 0.0, -0.2]\ncorrects = "all"\n'
    section = (EFFORT + keys).replace('{ column = "time" }', '{ column = "time", offset_s = 2.5 }')
    case = load_case(saved(case_file, with_section(section)))
    streams = read_streams(case)
    seconds, force_n = forces_of(drawn_dive(7, seconds=210.0), 1)
    stream = streams.aiding["effort"]
    np.testing.assert_allclose(stream.force_p_n, force_n, atol=1e-8)
    np.testing.assert_allclose(stream.time_ns * 1e-9, seconds + 2.5, atol=1e-9)
    prepared = prepare(case, streams)
    log = kernel_log(case, prepared, streams.beams.valid[prepared.pings])
    end = int(np.searchsorted(stream.time_ns, log["imu_time_ns"][-1] + 1))
    np.testing.assert_array_equal(log["thrust_time_ns"], stream.time_ns[:end])
    assert case.effort is not None
    hull = SpeedByForces(case.effort)
    last = np.searchsorted(log["imu_time_ns"], stream.time_ns[:end], side="right") - 1
    rows = zip(stream.time_ns.tolist(), stream.force_p_n.tolist(), log["omega_p_radps"][last], strict=False)
    speeds = [hull(EffortReading(time_ns, tuple(force)), omega).speed_p_mps for time_ns, force, omega in rows]
    np.testing.assert_array_equal(log["thrust_speed_p_mps"], speeds)
    assert prepared.model.thrust == ThrustModel(
        scale_sd=(0.05,) * 3, slip_sd_mps=(0.03,) * 3, slip_time_s=8.0, noise_sd_mps=0.02
    )
    assert prepared.options.thrust == "all"
    assert tuple(prepared.options.levers.thrust_p_m) == (0.1, 0.0, -0.2)


@pytest.mark.parametrize(
    ("section", "axes", "low", "high"),
    [
        # Chi-squared of 209 single rows, to 4 sigma.
        (THRUST, ["surge"], 1.0 - 4.0 * np.sqrt(2.0 / 209.0), 1.0 + 4.0 * np.sqrt(2.0 / 209.0)),
        # The noise of a force, 1 N, is less than 1 cm/s but near rest.
        (EFFORT, ["surge", "sway", "heave"], 0.4, 1.0),
    ],
    ids=["thrust", "effort"],
)
def test_the_readings_fit_each_method(
    case_file: Path, section: str, axes: list[str], low: float, high: float
) -> None:
    """Every reading from the start to the last inertial one, each axis a row, and the current."""
    replayed = replay_case(load_case(saved(case_file, with_section(section))))
    assert replayed.currents is not None
    assert set(replayed.currents["method"]) == {"tc", "sway_current"}
    assert set(replayed.manifest["files"]) == {"imu", "dvl", section[1:7], "reference"}
    sensors = replayed.manifest["sensors"]
    assert set(sensors) == {"recorded", "hidden"}
    rows = [row for row in sensors["recorded"] if row["sensor"].startswith("thrust")]
    assert {row["method"] for row in rows} == {"tc", "sway_current"}
    tc = [row for row in rows if row["method"] == "tc"]
    assert [row["sensor"] for row in tc] == [f"thrust_{axis}" for axis in axes]
    count = len((revolutions_of if section is THRUST else forces_of)(drawn_dive(7, seconds=210.0), 1)[0])
    assert {(row["measured"], row["degrees"]) for row in tc} == {(count, 1.0)}
    assert sum(row["rejected"] for row in tc) < 0.04 * len(axes) * count
    assert low < np.mean([row["nis"] for row in tc]) < high


def test_revolutions_and_forces_are_one_or_the_other(case_file: Path) -> None:
    with pytest.raises(ScenarioError, match=r"\[thrust\] and \[effort\] are given, expected one of them"):
        load_case(saved(case_file, with_section(THRUST + EFFORT)))


@pytest.mark.parametrize(("name", "section"), [("thrust", THRUST), ("effort", EFFORT)])
def test_slip_and_noise_are_tuned_where_the_section_stands(case_file: Path, name: str, section: str) -> None:
    case = load_case(saved(case_file, with_section(section)))
    streams = read_streams(case)
    found = {one.key: one.start for one in noise_of(case, streams) if one.key.startswith(f"{name}.")}
    assert found == {f"{name}.slip_mps": 0.02, f"{name}.noise_mps": 0.01}
    other = with_values(case, {f"{name}.slip_mps": 0.05})
    assert getattr(other, name) == getattr(case, name).model_copy(update={"slip_mps": 0.05})
    without: Any = case.model_copy(update={name: None})
    assert not [one for one in noise_of(without, read_streams(without)) if one.key.startswith(f"{name}.")]


@pytest.mark.parametrize(
    ("section", "old", "new", "words"),
    [
        (THRUST, 'column = "rpm"', 'column = "rmp"', r"shaft.csv: .*'rmp'"),
        (THRUST, '"rpm"\nunit = "rpm"', '"rpm"\nunit = "Hz"',
         "shaft.csv: column 'rpm' in Hz and thrust.advance_m = 0.1 m are .* m/s in the median, expected at most 20"),
        (THRUST, 'column = "rpm"', 'column = "still"', "column 'still' is 0 in every row, expected revolutions"),
        (THRUST, 'column = "rpm"', 'column = "spiked"',
         r"shaft.csv: column 'spiked' is 1e\+09 rpm, .*, at 19\.550000 s, the first of 1 such readings; empty"),
        (THRUST, "shaft.csv", "none.csv", "none.csv: no such file"),
        (EFFORT, 'force = ["x", "y", "z"]', 'force = ["x", "y"]', r"effort\.force"),
        (EFFORT, 'force = ["x", "y", "z"]', 'force = ["x", "y", "zed"]', "zed"),
        (EFFORT, 'force = ["x", "y", "z"]', 'force = ["still", "still", "still"]', "are 0 in every row"),
        (EFFORT, 'force = ["x", "y", "z"]', 'force = ["many", "y", "z"]', "check the unit of the forces"),
        (EFFORT, 'force = ["x", "y", "z"]', 'force = ["spiked", "y", "z"]',
         r"1e\+06 N, more .*, at 10\.550000 s, the first of 1 such"),
        (EFFORT, "mass_kg = [20.0, 21.0, 32.0]", "mass_kg = [20.0, 0.0, 32.0]", "mass_kg of sway is 0"),
        (EFFORT, "mass_kg = [20.0, 21.0, 32.0]", "", r"effort\.mass_kg"),
        (EFFORT, "[14.0, 5.0, 33.0]", "[-14.0, 5.0, 33.0]", "expected >= 0"),
        (EFFORT, "buoyancy_n = 2.4", "buoyancy_kg = 2.4", "buoyancy_kg"),
        (EFFORT, "[14.0, 5.0, 33.0]\nquadratic_drag_kg_per_m = [141.0, 217.0, 190.0]",
         "[0.0, 0.0, 0.0]", "an axis needs one of them"),
    ],
)  # fmt: skip
def test_mistakes_are_named(case_file: Path, section: str, old: str, new: str, words: str) -> None:
    assert old in section
    path = saved(case_file, with_section(section.replace(old, new, 1)))
    with pytest.raises((DataError, ScenarioError), match=words):
        read_streams(load_case(path))


def test_forces_of_another_time_are_told(case_file: Path) -> None:
    """A clock an hour off leaves no reading within the dive: the command and the page say so."""
    section = EFFORT.replace('{ column = "time" }', '{ column = "time", offset_s = 3600.0 }')
    with pytest.warns(Note, match="effort: no reading lies within the times of the IMU"):
        streams = read_streams(load_case(saved(case_file, with_section(section))))
    assert sum("check effort.clock" in one for one in streams.notes) == 1
