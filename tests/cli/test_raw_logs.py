"""Logs given where tables are expected, logs without a valid beam, pipes and devices: one line each, and no hang."""

import math
import os
import tomllib
from pathlib import Path

import numpy as np
import pytest

from bottomlock.io.beam_table import read_beam_table
from tests.cli.calls import command as bottomlock
from tests.cli.calls import refused, succeeded
from tools import reader_seeds as seeds

GEOMETRY = ("--geometry", "waterlinked_a50")
RAW = seeds.seeds()


@pytest.mark.parametrize("name", sorted(RAW))
@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".log"])
def test_fix_of_a_raw_log_says_to_convert_it(tmp_path: Path, name: str, suffix: str) -> None:
    """Every format is known by its own mark, whatever the name of the file."""
    log = tmp_path / f"dive{suffix}"
    log.write_bytes(RAW[name][0])
    said = refused("fix", log, *GEOMETRY, "--method", "lc", "--out", tmp_path / "fixes.parquet")
    (line,) = said.splitlines()
    assert f"is a log of format {name}, not a table; convert it first: bottomlock convert {log}" in line
    assert list(tmp_path.iterdir()) == [log]


@pytest.mark.parametrize("kept", [0, 1])
def test_a_log_without_one_valid_beam_is_no_success(tmp_path: Path, kept: int) -> None:
    """The table is written, and the command ends with exit code 1 and says why."""
    log, to = tmp_path / "air.txt", tmp_path / "beams.parquet"
    log.write_bytes(b"".join(seeds.a50_report(k, lost=range(kept, 4)) for k in range(3)))
    done = bottomlock("convert", log, "--to", to)
    assert read_beam_table(to).rows == 3
    assert done.returncode == (0 if kept else 1)
    assert ("none of its 3 pings has a valid beam" in done.stderr) == (not kept)


def test_pipes_and_devices_are_rejected_at_once(tmp_path: Path) -> None:
    """Reading them would wait for a writer, or never end."""
    pipe, to = tmp_path / "pipe.csv", tmp_path / "beams.parquet"
    os.mkfifo(pipe)
    for place in (pipe, Path("/dev/zero")):
        for command in (
            ("convert", place, "--to", to),
            ("convert", place, "--to", to, "--format", "pd0"),
            ("convert", place, "--to", to, "--format", "ros"),
            ("convert", place, "--to", to, "--columns", place),
            ("fix", place, *GEOMETRY, "--method", "lc", "--out", to),
            ("audit", place, "--out", tmp_path / "out"),
        ):
            said = refused(*command)
            (line,) = said.splitlines()
            assert "is a pipe or a device, expected a file" in line


def _noisy(path: Path, pings: int, noise: int) -> None:
    """PD0 beams that close, of a vertical velocity that grows, with noise of so many mm/s."""
    rng = np.random.default_rng(5)
    velocity = rng.integers(-noise, noise + 1, (pings, 4)) + np.array([100, -100, 150, -150])
    velocity += np.arange(pings)[:, None]
    path.write_bytes(b"".join(seeds.pd0_ensemble(k + 1, velocity=v.tolist()) for k, v in enumerate(velocity)))


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(
    ("pings", "noise", "message"),
    [(3, 5, "3 full pings, expected 40 or more to measure the beam noise"), (60, 0, ""), (60, 5, "")],
)
def test_beam_noise_of_a_geometry_file(tmp_path: Path, pings: int, noise: int, message: str) -> None:
    """Not from three pings; not less than what rounding to 1 mm/s alone makes."""
    log, beams, toml = tmp_path / "log.pd0", tmp_path / "beams.parquet", tmp_path / "found.toml"
    _noisy(log, pings, noise)
    succeeded("convert", log, "--to", beams)
    done = bottomlock("audit", beams, "--geometry", "teledyne_20", "--out", tmp_path / "out", "--write", toml)
    if message:
        assert done.returncode == 2
        assert message in done.stderr
        assert not toml.exists()
        return
    assert done.returncode == 0, done.stderr
    found = tomllib.loads(toml.read_text())["beam_noise_mps"]
    least = 1e-3 / math.sqrt(12.0)
    if noise:
        assert 3 * least < found < 6e-3
    else:
        assert found == pytest.approx(least, rel=1e-3)
