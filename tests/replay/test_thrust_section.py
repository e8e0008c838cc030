"""Revolutions of the propeller in a replay: dives in a current with the bottom hidden, the section's keys, the page."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bottomlock.errors import DataError
from bottomlock.files.replay_tables import ReplayTables
from bottomlock.kernel.models import ThrustModel
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
SECTION = """[thrust]
file = "shaft.csv"
clock = { column = "time" }
column = "rpm"
unit = "rpm"
advance_m = 0.1
"""
BARE = WATER_CASE.replace("[water_track]\nnoise_mps = 0.02\n", "").replace('"ins", "tc"', '"tc"')
CASE = BARE.replace("[reference]", f"{SECTION}[reference]")
SEEDS = tuple(range(1, 11))


def revolutions_of(dive: Dive, seed: int = 1) -> tuple[Floats, Floats]:
    """Times, s, and revolutions a second of the true speed through the water, with slip and noise of their own."""
    rng = np.random.default_rng(seed)
    seconds = np.arange(0.55, dive.imu_s[-1] - 0.5, 1.0)
    turned = Rotation.from_euler("ZYX", dive.at(seconds, np.unwrap(dive.rpy, axis=0))[:, ::-1])
    through = (dive.at(seconds, dive.velocity) - turned.inv().apply(CURRENT))[:, 0]
    slip = gauss_markov(SLIP_MPS * rng.normal(size=len(seconds)), 1.0, SLIP_TIME_S)
    return seconds, (through - slip - NOISE_MPS * rng.normal(size=len(seconds))) / ADVANCE_M


def write_dive(folder: Path, dive: Dive, text: str = CASE, seed: int = 1) -> Path:
    """The tables of a dive with those of its shaft; returns the case's path."""
    path = write(folder, dive)
    seconds, turns = revolutions_of(dive, seed)
    columns = {"time": seconds, "rpm": 60.0 * turns, "hz": turns, "rad_s": 2.0 * np.pi * turns}
    spiked = np.where(np.arange(len(turns)) == 19, 1e9, columns["rpm"])
    write_csv(folder / "shaft.csv", columns | {"still": 0.0 * turns, "spiked": spiked})
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def case_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_dive(tmp_path_factory.mktemp("thrust"), drawn_dive(7, seconds=210.0))


@pytest.fixture(scope="module")
def replayed(case_file: Path) -> ReplayTables:
    return replay_case(load_case(case_file))


@pytest.fixture(scope="module")
def ends(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Floats]:
    """(10, 2) errors of `tc` and their sigma, m, after 140 s without the bottom, of ten dives."""
    sections = {
        "without": "",
        "velocity": SECTION,
        "all": f'{SECTION}corrects = "all"\n',
    }
    folder = tmp_path_factory.mktemp("dives")
    errors: dict[str, list[tuple[float, float]]] = {name: [] for name in sections}
    for seed in SEEDS:
        path = write_dive(folder, drawn_dive(seed, seconds=210.0), seed=seed)
        for name, section in sections.items():
            text = BARE.replace('"tc", "sway_current"', '"tc"')
            path.write_text(text.replace("[reference]", f"{section}[reference]"), encoding="utf-8")
            result = replay_undiagnosed(load_case(path))
            last = result.samples.filter(what_if="hidden").tail(1)
            sd = last.select("sd_position_north_m", "sd_position_east_m").to_numpy()
            errors[name].append((end_m(result, "hidden", "tc"), float(np.linalg.norm(sd))))
    return {name: np.array(of) for name, of in errors.items()}


@pytest.mark.long
@pytest.mark.parametrize(
    ("corrects", "factor", "least", "over_sigma"), [("velocity", 3.3, 1.5, 0.89), ("all", 5.7, 2.0, 0.99)]
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
    path = case_file.with_name(f"{column}.toml")
    section = SECTION.replace('"rpm"\nunit = "rpm"', f'"{column}"\nunit = "{unit}"\nevery = 2')
    section = section.replace('{ column = "time" }', '{ column = "time", offset_s = 2.5 }')
    path.write_text(CASE.replace(SECTION, section), encoding="utf-8")
    case = load_case(path)
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


def test_model_and_option_are_those_of_the_section(case_file: Path) -> None:
    path = case_file.with_name("keys.toml")
    keys = (
        'uncertainty_percent = 5.0\nslip_mps = 0.03\nslip_time_s = 8.0\nnoise_mps = 0.04\ncorrects = "all"\n'
    )
    path.write_text(CASE.replace(SECTION, SECTION + keys), encoding="utf-8")
    case = load_case(path)
    prepared = prepare(case, read_streams(case))
    assert prepared.model.thrust == ThrustModel(
        scale_sd=(0.05, 0.0, 0.0), slip_sd_mps=(0.03, 0.0, 0.0), slip_time_s=8.0, noise_sd_mps=0.04
    )
    assert prepared.options.thrust == "all"


def test_the_revolutions_fit_each_method(replayed: ReplayTables) -> None:
    assert replayed.currents is not None
    assert set(replayed.currents["method"]) == {"tc", "sway_current"}
    assert set(replayed.manifest["files"]) == {"imu", "dvl", "thrust", "reference"}
    sensors = replayed.manifest["sensors"]
    assert set(sensors) == {"recorded", "hidden"}
    row = next(row for row in sensors["recorded"] if (row["method"], row["sensor"]) == ("tc", "thrust_surge"))
    # Every reading from the start to the last inertial one; chi-squared of 209 single rows, to 4 sigma.
    assert row["measured"] == len(revolutions_of(drawn_dive(7, seconds=210.0))[0])
    assert row["degrees"] == 1.0
    assert abs(row["nis"] - 1.0) < 4.0 * np.sqrt(2.0 / 209.0)
    assert row["rejected"] < 10


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('column = "rpm"', 'column = "rmp"', r"shaft.csv: .*'rmp'"),
        ('"rpm"\nunit = "rpm"', '"rpm"\nunit = "Hz"',
         "shaft.csv: column 'rpm' in Hz and thrust.advance_m = 0.1 m are .* m/s in the median, expected at most 20"),
        ('column = "rpm"', 'column = "still"', "column 'still' is 0 in every row, expected revolutions"),
        ('column = "rpm"', 'column = "spiked"',
         r"shaft.csv: column 'spiked' is 1e\+09 rpm, .*, at 19\.550000 s, the first of 1 such readings; empty"),
        ("shaft.csv", "none.csv", "none.csv: no such file"),
    ],
)  # fmt: skip
def test_faults_of_the_table_name_file_and_column(case_file: Path, old: str, new: str, message: str) -> None:
    assert old in CASE
    path = case_file.with_name("faulty_table.toml")
    path.write_text(CASE.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(DataError, match=message):
        replay_case(load_case(path))


def test_slip_and_noise_are_tuned_where_the_section_stands(case_file: Path) -> None:
    case = load_case(case_file)
    streams = read_streams(case)
    found = {one.key: one.start for one in noise_of(case, streams) if one.key.startswith("thrust.")}
    assert found == {"thrust.slip_mps": 0.02, "thrust.noise_mps": 0.01}
    other = with_values(case, {"thrust.slip_mps": 0.05})
    assert case.thrust is not None
    assert other.thrust == case.thrust.model_copy(update={"slip_mps": 0.05})
    without: Any = case.model_copy(update={"thrust": None})
    assert not [one for one in noise_of(without, read_streams(without)) if one.key.startswith("thrust.")]
