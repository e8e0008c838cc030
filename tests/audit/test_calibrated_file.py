"""A DVL's file with a calibration: what is written is read back, and all else stays."""

from pathlib import Path

import numpy as np
import pytest

from bottomlock.audit.geometry_file import known
from bottomlock.audit.mounting import Mounting
from bottomlock.config.dvl import CalibrationSection, StatedCalibration
from bottomlock.errors import OutputError, ScenarioError
from bottomlock.io.beams import read_geometry
from bottomlock.io.calibrated_file import Calibrated, calibrated_text, require_toml

FILE = """# bench of 3 March
name = "dvl"  # the new one
configuration = "x"
tilt_deg = 30.0
mounting_yaw_deg = 45.0  # as drawn
beam_noise_mps = 0.01

[calibration]
clock_offset_s = 1.0  # old

[columns]
time = "t"  # seconds
time_unit = "s"
"""
FOUND = Calibrated(
    source="a dive",
    mounting_rpy_rad=np.deg2rad([0.5, -1.0, 44.0]),
    mounting_sd_rad=np.deg2rad([0.1, 0.2, 0.3]),
    scale=0.004,
    scale_sd=0.001,
    clock_offset_s=0.25,
    clock_sd_s=0.02,
)


def test_written_and_read_back(tmp_path: Path) -> None:
    text = calibrated_text(FILE, FOUND)
    assert calibrated_text(text, FOUND) == text
    for kept in ("# bench of 3 March", "# the new one", 'time = "t"  # seconds'):
        assert kept in text
    assert "old" not in text
    (tmp_path / "dvl.toml").write_text(text, encoding="utf-8")
    read = read_geometry(tmp_path / "dvl.toml")
    np.testing.assert_allclose(np.rad2deg(read.mounting_rpy_rad), [0.5, -1.0, 44.0])
    assert read.stated.mounting_sd_deg == (0.1, 0.2, 0.3)
    assert (read.stated.clock_offset_s, read.stated.clock_sd_s) == (0.25, 0.02)
    assert read.geometry.sound_speed_scale == pytest.approx(1.004)
    assert read.columns.time == "t"


def test_an_audit_is_a_prior(tmp_path: Path) -> None:
    """What the audit sees is written as the prior of a replay; what it does not see is not written."""
    values = {
        "misalignment": np.zeros(3), "lever_arm": np.zeros(3),
        "clock_offset": np.array([0.35]), "velocity_scale": np.array([0.01]),
    }  # fmt: skip
    sds = {
        "misalignment": np.deg2rad([0.1, 0.2, 0.3]), "lever_arm": np.ones(3),
        "clock_offset": np.array([0.01]), "velocity_scale": np.array([0.1]),
    }  # fmt: skip
    mounting = Mounting(
        values, sds, mirrored=False, residual_mps=np.zeros(3), explained=0.9, instants=500, blocks=50,
        rate_rms_radps=np.ones(3),
    )  # fmt: skip
    (tmp_path / "dvl.toml").write_text(calibrated_text(FILE, known(mounting, "log")), encoding="utf-8")
    stated = read_geometry(tmp_path / "dvl.toml").stated
    assert (stated.clock_offset_s, stated.clock_sd_s) == (0.35, 0.01)
    assert stated.mounting_sd_deg == (0.1, 0.2, 0.3)
    assert (stated.scale_percent, stated.scale_sd_percent) == (0.0, None)
    assert known(None, "log").clock_sd_s is None


def test_what_is_not_known_is_not_written() -> None:
    nothing = Calibrated("", None, None, None, None, None, None)
    text = calibrated_text(FILE, nothing)
    assert "mounting_yaw_deg = 45.0  # as drawn" in text
    assert "[calibration]" not in text


def test_the_case_has_the_last_word() -> None:
    stated = StatedCalibration(mounting_sd_deg=(1.0, 2.0, 3.0), clock_sd_s=0.1)
    assert CalibrationSection().prior(None).as_dict() == {
        "mounting_sd_rad": (0.0, 0.0, 0.0),
        "clock_sd_s": 0.0,
    }
    np.testing.assert_allclose(CalibrationSection().prior(stated).mounting_sd_rad, np.deg2rad([1, 2, 3]))
    own = CalibrationSection(mounting_sd_deg=(0.5, 0.5, 0.5)).prior(stated)
    np.testing.assert_allclose(own.mounting_sd_rad, np.deg2rad([0.5] * 3))
    assert own.clock_sd_s == 0.1
    assert CalibrationSection(enabled=False).prior(stated).clock_sd_s == 0.0


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("mounting_sd_deg = [1, 1]", "mounting_sd_deg"),
        ("mounting_sd = 1.0", "mounting_sd"),
        ("clock_sd_s = 5.0", "clock_sd_s"),
    ],
)
def test_bad_keys_are_named(tmp_path: Path, line: str, words: str) -> None:
    (tmp_path / "dvl.toml").write_text(FILE.replace("clock_offset_s = 1.0  # old", line), encoding="utf-8")
    with pytest.raises(ScenarioError, match=words):
        read_geometry(tmp_path / "dvl.toml")


def test_a_name_that_is_none_of_a_toml_file() -> None:
    require_toml(Path("dvl.toml"))
    with pytest.raises(OutputError, match="toml"):
        require_toml(Path("dvl.json"))
