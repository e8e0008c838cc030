"""Case files: what is rejected, in which words, and what follows from what is said."""

from pathlib import Path

import pytest

from bottomlock.errors import ScenarioError
from bottomlock.replay.case import load_case, parse_case
from tests.toml_text import toml

LEAST = toml({
    "": {"name": "dive"},
    "imu": {"file": "imu.csv", "clock": {"column": "t"}, "force": ["ax", "ay", "az"], "omega": ["wx", "wy", "wz"]},
    "imu.errors": {
        "accel_bias_mg": 0.5, "gyro_bias_deg_per_h": 3.0, "accel_noise_mps_per_rt_h": 0.07,
        "gyro_noise_deg_per_rt_h": 0.3,
    },
    "dvl": {"file": "beams.parquet", "geometry": "x_janus_20"},
    "start": {"heading": "gyrocompass", "position_sd_m": [1.0] * 3},
})  # fmt: skip


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("force =", "forces =", "unknown key 'imu.forces', did you mean 'force'"),
        ('heading = "gyrocompass"', "", "'start.heading' is missing"),
        ('heading = "gyrocompass"', 'heading = "attitude"', r"needs the section \[attitude\]"),
        ('heading = "gyrocompass"', 'heading = "reference"\nheading_sd_deg = 1.0', r"needs the section \[reference\]"),
        ('clock = { column = "t" }', "clock = { offset_s = 1.0 }", "a clock needs 'column'"),
        ('clock = { column = "t" }', 'clock = { column = "t", start_s = 1.0 }', "'start_s' is given beside 'column'"),
        ('omega = ["wx", "wy", "wz"]', 'omega = ["wx", "wy", "wz"]\naxes = ["x", "x", "z"]', "each of x, y, z once"),
        ('omega = ["wx", "wy", "wz"]', 'omega = ["wx", "wy", "wz"]\nomega_unit = "rad"', "increments: give 'interval'"),
        ('omega = ["wx", "wy", "wz"]', 'omega = ["wx", "wy", "wz"]\ninterval = "d"', "no unit is that of an increment"),
        ('geometry = "x_janus_20"', 'geometry = "x_janus_20"\nsource = "velocity"', "'velocity'"),
        ('geometry = "x_janus_20"', 'geometry = "x_janus_20"\nvelocity_scale = 1.1', "recorded beams are used as"),
        ('geometry = "x_janus_20"', 'geometry = "x_janus_20"\nmounting_yaw_deg = 45.0', "in the geometry file"),
        ("[start]", '[[what_if]]\nname = "nothing"\n[start]', "loses no beam"),
        ("[start]", '[[what_if]]\nname = "recorded"\nbeams_lost = [1]\n[start]', "the name 'recorded' is reserved"),
        (
            "[start]",
            '[[what_if]]\nname = "a"\nbeams_lost = [1]\n[[what_if]]\nname = "a"\nbeams_lost = [2]\n[start]',
            "'a' is defined twice",
        ),
        (
            "[start]",
            '[[what_if]]\nname = "a"\noutages = [{ beams = [1], from_s = 9.0, to_s = 3.0 }]\n[start]',
            "expected after its start",
        ),
        ("position_sd_m = [1.0, 1.0, 1.0]", "", "needs 'position_sd_m', 1 sigma of north, east, down"),
        ('heading = "gyrocompass"', 'heading = "given"', "needs 'heading_deg'; heading = .* needs 'heading_sd_deg'"),
        ("[start]", '[gps]\nfile = "g.csv"\nclock = { column = "t" }\n[start]', "no position"),
    ],
)  # fmt: skip
def test_faults_name_key_and_expectation(old: str, new: str, message: str) -> None:
    assert old in LEAST
    with pytest.raises(ScenarioError, match=message) as caught:
        parse_case(LEAST.replace(old, new, 1), place="case.toml")
    assert str(caught.value).startswith("case.toml: ")


def test_files_are_looked_for_from_the_case(tmp_path: Path) -> None:
    path = tmp_path / "case.toml"
    path.write_text(LEAST.replace('"x_janus_20"', '"own.toml"'), encoding="utf-8")
    case = load_case(path)
    assert case.readings.file == tmp_path / "imu.csv"
    assert case.dvl.geometry == str(tmp_path / "own.toml")


def test_hash_is_of_what_decides_the_numbers() -> None:
    case = parse_case(LEAST, place="case")
    worded = parse_case(
        LEAST.replace('name = "dive"', 'name = "dive"\ndescription = "other words"'), place="case"
    )
    assert worded.content_hash() == case.content_hash()
    assert case.with_methods(["tc"]).content_hash() != case.content_hash()
