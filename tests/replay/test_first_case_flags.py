"""Flags and units of beams in a table: `replay --init`, `replay` and `convert` take the same, with the same values."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest
from numpy.typing import NDArray

import bottomlock
from bottomlock.io.beams import read_beams
from bottomlock.io.formats import read_recording
from bottomlock.replay.case import load_case
from bottomlock.replay.init.column_map import write_map
from bottomlock.replay.init.make import make_case
from bottomlock.replay.reading import read_streams

PINGS, HZ = 200, 5
WORDS = {
    "bool": (True, False), "number": (1, 0), "true": ("true", "false"), "True": ("True", "False"),
    "yes": ("yes", "no"), "valid": ("VALID", "invalid"), "good": ("good", "bad"),
}  # fmt: skip
UNITS = {"mps": 1.0, "cmps": 100.0, "mmps": 1000.0, "m_s": 1.0}


def beams() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Velocity (n, 3) and beams (n, 4), m/s, and which beams are valid: the second is lost for ten pings."""
    t = np.arange(PINGS) / HZ
    velocity = np.stack([1.0 + 0.2 * np.sin(t / 7.0), 0.05 * np.cos(t / 9.0), 0.0 * t], axis=1)
    noise = 0.01 * np.random.default_rng(1).standard_normal((PINGS, 4))
    valid = np.ones((PINGS, 4), dtype=np.bool_)
    valid[50:60, 1] = False
    return velocity, bottomlock.BeamGeometry.janus(np.deg2rad(20.0)).beam_velocities(velocity) + noise, valid


def write(folder: Path, words: str = "bool", unit: str = "mps", *, velocity: float | None = None) -> Path:
    """A table of beams with flags in some words and velocities in some unit; beside it readings of an IMU."""
    own, measured, valid = beams()
    yes, no = WORDS[words]
    columns: dict[str, object] = {"time_s": np.arange(PINGS) / HZ}
    if velocity is not None:
        columns |= {f"v{axis}": velocity * own[:, k] for k, axis in enumerate("xyz")}
    columns |= {f"beam{k + 1}_{unit}": UNITS[unit] * measured[:, k] for k in range(4)}
    columns |= {f"beam{k + 1}_valid": [yes if one else no for one in valid[:, k]] for k in range(4)}
    path = folder / "dvl.csv"
    pl.DataFrame(columns).write_csv(path)
    t = np.arange(20 * PINGS) / (20 * HZ)
    still = dict.fromkeys(("ax", "ay", "wx", "wy", "wz"), 0.0 * t)
    pl.DataFrame({"time_s": t, **still, "az": 0.0 * t - 9.81}).write_csv(folder / "imu.csv")
    return path


@pytest.mark.first_cases(7)
@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("words", WORDS)
def test_a_case_has_the_beams_of_the_table(tmp_path: Path, words: str, unit: str) -> None:
    path = write(tmp_path, words, unit)
    made = make_case([tmp_path / "imu.csv", path], tmp_path / "case.toml")
    _, measured, valid = beams()
    case = load_case(made.case)
    assert "dvl.geometry" in case.assumed
    read = read_streams(case).beams
    assert (np.asarray(read.valid) == valid).all()
    np.testing.assert_allclose(np.asarray(read.velocity_mps)[valid], measured[valid], atol=1e-9)


@pytest.mark.parametrize("words", WORDS)
def test_a_beam_table_takes_the_same_flags(tmp_path: Path, words: str) -> None:
    """`convert`, `fix` and `audit` read by the same words."""
    path = write(tmp_path, words)
    table = pl.read_csv(path).with_columns(time_ns=pl.int_range(PINGS) * (10**9 // HZ)).drop("time_s")
    table.write_csv(tmp_path / "documented.csv")
    _, _, valid = beams()
    assert (read_beams(tmp_path / "documented.csv", beams=4).valid == valid).all()
    converted = read_recording(tmp_path / "documented.csv").table
    assert (converted.valid == valid).all()


@pytest.mark.parametrize(("scale", "is_mapped"), [(1.0, True), (1000.0, False)])
def test_a_map_of_beams_keeps_the_velocity_beside_them(tmp_path: Path, scale: float, is_mapped: bool) -> None:
    """Or says that it is left out, where its unit is another one: a map has one."""
    path = write(tmp_path, velocity=scale)
    write_map(path, tmp_path / "map.toml", force=False)
    text = (tmp_path / "map.toml").read_text()
    assert ('instrument = ["vx", "vy", "vz"]' in text) == is_mapped
