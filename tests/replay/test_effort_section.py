"""Forces of thrusters in a replay: what reaches the filter, how it fits, the section's keys."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bottomlock.errors import DataError, Note, ScenarioError
from bottomlock.files.replay_tables import ReplayTables
from bottomlock.kernel.models import ThrustModel
from bottomlock.recordings.drives import SpeedByForces
from bottomlock.recordings.readings import EffortReading
from bottomlock.recordings.streams import Floats
from bottomlock.replay.case import load_case
from bottomlock.replay.reading import read_streams
from bottomlock.replay.rerun import kernel_log, prepare
from bottomlock.replay.run import replay_case
from bottomlock.replay.tune.parameters import noise_of
from tests.dive import Dive, drawn_dive, gauss_markov
from tests.dive_logs import write_csv
from tests.replay.test_thrust_section import BARE, SLIP_MPS, SLIP_TIME_S
from tests.replay.test_water_track import CURRENT, write

MASS, LIGHT_N = np.array([20.0, 21.0, 32.0]), 2.4
LINEAR, QUADRATIC = np.array([14.0, 5.0, 33.0]), np.array([141.0, 217.0, 190.0])
NOISE_N = 1.0
SECTION = """[effort]
file = "thrusters.csv"
clock = { column = "time" }
force = ["x", "y", "z"]
mass_kg = [20.0, 21.0, 32.0]
linear_drag_kg_per_s = [14.0, 5.0, 33.0]
quadratic_drag_kg_per_m = [141.0, 217.0, 190.0]
buoyancy_n = 2.4
"""
CASE = BARE.replace("[reference]", f"{SECTION}[reference]")


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


def write_dive(folder: Path, dive: Dive, text: str = CASE, seed: int = 1) -> Path:
    """The tables of a dive with those of its thrusters; returns the case's path."""
    path = write(folder, dive)
    seconds, force_n = forces_of(dive, seed)
    columns = {"time": seconds, **dict(zip("xyz", force_n.T, strict=True))}
    spiked = np.where(np.arange(len(seconds)) == 20, 1e6, force_n[:, 0])
    others = {"still": 0.0 * seconds, "many": 1e4 * force_n[:, 0], "spiked": spiked}
    write_csv(folder / "thrusters.csv", columns | others)
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def case_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_dive(tmp_path_factory.mktemp("effort"), drawn_dive(7, seconds=210.0))


@pytest.fixture(scope="module")
def replayed(case_file: Path) -> ReplayTables:
    return replay_case(load_case(case_file))


def test_the_forces_given_are_those_of_the_section(case_file: Path) -> None:
    """On the clock of the case, as speeds; model and option are those of the keys."""
    path = case_file.with_name("keys.toml")
    keys = "uncertainty_percent = 5.0\nslip_mps = 0.03\nslip_time_s = 8.0\nnoise_mps = 0.02\n"
    keys += 'lever_arm_m = [0.1, 0.0, -0.2]\ncorrects = "all"\n'
    section = (SECTION + keys).replace('{ column = "time" }', '{ column = "time", offset_s = 2.5 }')
    path.write_text(CASE.replace(SECTION, section), encoding="utf-8")
    case = load_case(path)
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


def test_the_forces_fit_each_method(replayed: ReplayTables) -> None:
    """How the forces fit each method, of three rows a reading, and the current."""
    rows = [row for row in replayed.manifest["sensors"]["recorded"] if row["sensor"].startswith("thrust")]
    assert {row["method"] for row in rows} == {"tc", "sway_current"}
    tc = [row for row in rows if row["method"] == "tc"]
    assert [row["sensor"] for row in tc] == ["thrust_surge", "thrust_sway", "thrust_heave"]
    count = len(forces_of(drawn_dive(7, seconds=210.0), 1)[0])
    assert {(row["measured"], row["degrees"]) for row in tc} == {(count, 1.0)}
    assert sum(row["rejected"] for row in tc) < 0.02 * 3 * count
    # The noise of a force, 1 N, is less than 1 cm/s but near rest.
    assert 0.4 < np.mean([row["nis"] for row in tc]) < 1.0
    assert replayed.currents is not None
    assert set(replayed.currents["method"]) == {"tc", "sway_current"}


def test_revolutions_and_forces_are_one_or_the_other(case_file: Path) -> None:
    path = case_file.with_name("both.toml")
    thrust = '[thrust]\nfile = "thrusters.csv"\nclock = { column = "time" }\ncolumn = "x"\nunit = "Hz"\n'
    path.write_text(CASE.replace("[effort]", f"{thrust}advance_m = 0.1\n[effort]"), encoding="utf-8")
    with pytest.raises(ScenarioError, match=r"\[thrust\] and \[effort\] are given, expected one of them"):
        load_case(path)


def test_slip_and_noise_are_tuned_where_the_section_stands(case_file: Path) -> None:
    case = load_case(case_file)
    found = {
        one.key: one.start for one in noise_of(case, read_streams(case)) if one.key.startswith("effort.")
    }
    assert found == {"effort.slip_mps": 0.02, "effort.noise_mps": 0.01}


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('force = ["x", "y", "z"]', 'force = ["x", "y"]', r"effort\.force"),
        ('force = ["x", "y", "z"]', 'force = ["x", "y", "zed"]', "zed"),
        ('force = ["x", "y", "z"]', 'force = ["still", "still", "still"]', "are 0 in every row"),
        ('force = ["x", "y", "z"]', 'force = ["many", "y", "z"]', "check the unit of the forces"),
        (
            'force = ["x", "y", "z"]',
            'force = ["spiked", "y", "z"]',
            r"1e\+06 N, more .*, at 10\.550000 s, the first of 1 such",
        ),
        ("mass_kg = [20.0, 21.0, 32.0]", "mass_kg = [20.0, 0.0, 32.0]", "mass_kg of sway is 0"),
        ("mass_kg = [20.0, 21.0, 32.0]", "", r"effort\.mass_kg"),
        ("[14.0, 5.0, 33.0]", "[-14.0, 5.0, 33.0]", "expected >= 0"),
        ("buoyancy_n = 2.4", "buoyancy_kg = 2.4", "buoyancy_kg"),
        (
            "[14.0, 5.0, 33.0]\nquadratic_drag_kg_per_m = [141.0, 217.0, 190.0]",
            "[0.0, 0.0, 0.0]",
            "an axis needs one of them",
        ),
    ],
)
def test_mistakes_are_named(case_file: Path, tmp_path: Path, old: str, new: str, words: str) -> None:
    assert old in CASE
    path = tmp_path / "case.toml"
    for file in case_file.parent.iterdir():
        if file.suffix in (".csv", ".parquet"):
            (tmp_path / file.name).symlink_to(file)
    path.write_text(CASE.replace(old, new), encoding="utf-8")
    with pytest.raises((DataError, ScenarioError), match=words):
        read_streams(load_case(path))


def test_forces_of_another_time_are_told(case_file: Path) -> None:
    """A clock an hour off leaves no reading within the dive: the command and the page say so."""
    path = case_file.with_name("hour.toml")
    section = SECTION.replace('{ column = "time" }', '{ column = "time", offset_s = 3600.0 }')
    path.write_text(CASE.replace(SECTION, section), encoding="utf-8")
    with pytest.warns(Note, match="effort: no reading lies within the times of the IMU"):
        streams = read_streams(load_case(path))
    assert sum("check effort.clock" in one for one in streams.notes) == 1
