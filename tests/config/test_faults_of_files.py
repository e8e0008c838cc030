"""Every missing and every unknown key of each kind of file is named in one go, with what was expected."""

from collections.abc import Callable
from importlib import resources
from pathlib import Path

import pytest

from bottomlock.config.scenario import load_scenario, parse_scenario
from bottomlock.errors import ScenarioError
from bottomlock.io.beams import read_instrument_file
from bottomlock.io.table import read_map
from bottomlock.live.config import parse_config
from bottomlock.plant import load_vehicle
from bottomlock.replay.case import load_case

ROOT = Path(__file__).resolve().parents[2]
PACKAGED = resources.files("bottomlock.config")
LIVE = """
name = "rov"
mode = "navigation"
[dvl]
geometry = "x_janus_20"
[[source]]
name = "dvl"
address = "tcp:127.0.0.1:16171"
format = "waterlinked-json"
rate_hz = 4.0
[[source]]
name = "imu"
address = "udpin:127.0.0.1:15000"
format = "imu-csv"
rate_hz = 100.0
[imu]
rate_hz = 100.0
accel_bias_mg = 1.0
gyro_bias_deg_per_h = 1.0
accel_noise_mps_per_rt_h = 0.1
gyro_noise_deg_per_rt_h = 0.1
[origin]
latitude_deg = 40.0
[start]
heading_deg = 0.0
heading_sd_deg = 2.0
"""
TEXTS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "scenario": ((PACKAGED / "scenarios" / "slope.toml").read_text("utf-8"), load_scenario),
    "case": ((ROOT / "data/logs/robosub/case.toml").read_text("utf-8"), load_case),
    "geometry": (
        'configuration = "+"\ntilt_deg = 20.0\nbeam_noise_mps = 0.02\nsound_speed_scale = 1.0\n',
        read_instrument_file,
    ),
    "vehicle": ((PACKAGED / "vehicles" / "tauv.toml").read_text("utf-8"), load_vehicle),
    "columns": ('time = "t"\ntime_unit = "s"\nvelocity = ["b"]\nvalid = ["v"]\n', read_map),
    "live": (LIVE, lambda path: parse_config(path.read_text("utf-8"), place=str(path))),
}
FAULTS: dict[str, list[tuple[str, str, list[str]]]] = {
    "scenario": [
        ("accel_bias_mg = 0.5", "", ["'imu.accel_bias_mg' is missing, expected number in mg, ≥ 0"]),
        ("beam_noise_mps = 0.042", "", ["'dvl.beam_noise_mps' is missing, expected number in m/s, > 0"]),
        ('kind = "plane"', "", ["'seabed.kind' is None"]),
        ("leg_m = 80.0", "lag_m = 80.0", ["unknown key 'mission.lag_m', did you mean 'leg_m'?"]),
        ("gate_probability", "gyro_bias_deg_per_h", ["'gyro_bias_deg_per_h' is a key of [imu]"]),
    ],
    "case": [
        ("force = [", "forse = [", ["'imu.force' is missing, expected 3 texts", "did you mean 'force'?"]),
        ("sd_m = 0.02", "", ["'depth.sd_m' is missing, expected number in m, > 0: white noise, 1 sigma"]),
        ('geometry = "dvl.toml"', "", ["'dvl.geometry' is missing, expected text"]),
        ("every = 25", "evry = 25", ["unknown key 'reference.evry', did you mean 'every'?"]),
    ],
    "geometry": [
        ("configuration", "configration", ["'configuration' is missing", "did you mean 'configuration'?"]),
        ("beam_noise_mps", "beam_nois_mps", ["'beam_noise_mps' is missing", "did you mean 'beam_noise_mps'?"]),
    ],
    "vehicle": [
        ("mass = {", "mas = {", ["'rigid_body.mass' is missing, expected", "did you mean 'mass'?"]),
        ("x_udot", "x_udott", ["'added_mass.x_udot' is missing", "did you mean 'x_udot'?"]),
        ("cruise_speed", "#", ["'limits.cruise_speed' is missing, expected { value, unit, source } in m/s, > 0"]),
    ],
    "columns": [
        ("time_unit", "tme_unit", ["unknown key 'tme_unit', did you mean 'time_unit'?"]),
        ("velocity", "velocty", ["unknown key 'velocty', did you mean 'velocity'?"]),
        ('valid = ["v"]', "velocity_scale = 0", ["'velocity_scale' is 0, expected > 0"]),
    ],
    "live": [
        ("geometry", "geometri", ["'dvl.geometry' is missing", "did you mean 'geometry'?"]),
        ("accel_bias_mg = 1.0", "", ["'imu.accel_bias_mg' is missing, expected number in mg"]),
        ("heading_sd_deg = 2.0", "", ["'start.heading_sd_deg' is missing, expected number in deg, > 0"]),
        ("latitude_deg", "lattitude_deg", ["did you mean 'latitude_deg'?", "'origin.latitude_deg' is missing"]),
    ],
}  # fmt: skip


@pytest.mark.parametrize("kind", TEXTS)
def test_every_fault_of_a_file_is_named_in_one_go(kind: str, tmp_path: Path) -> None:
    """Each fault has a line that begins with the file, and the file without faults is read."""
    text, read = TEXTS[kind]
    expected = []
    for right, wrong, words in FAULTS[kind]:
        assert right in text
        text = text.replace(right, wrong, 1)
        expected += words
    path = tmp_path / "file.toml"
    path.write_text(text, "utf-8")
    with pytest.raises(ScenarioError) as caught:
        read(path)
    lines = str(caught.value).splitlines()
    for fault in expected:
        assert any(fault in line for line in lines), fault
    assert all("file.toml: " in line for line in lines)
    assert len(lines) == len(expected)


def test_a_changed_mission_is_checked_at_once() -> None:
    """Not only when the mission is built."""
    with pytest.raises(ScenarioError, match=r"unknown key 'mission\.leg_mm', did you mean 'leg_m'"):
        load_scenario("lawn_mower").replace({"mission.leg_mm": 40.0})


@pytest.mark.parametrize("value", ["true", '"2"'])
def test_what_is_no_number_is_not_made_one(value: str) -> None:
    """Neither true, which would be 1, nor a text that looks like a number."""
    text = (PACKAGED / "scenarios" / "slope.toml").read_text("utf-8")
    with pytest.raises(ScenarioError, match=r"'thrust.rate_hz' is .*, expected number in Hz"):
        parse_scenario(f"{text}\n[thrust]\nrate_hz = {value}\n", place="slope")
