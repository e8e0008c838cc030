"""The simulated dive that ships: its files are what the script makes, and its case and that of `--init` run."""

import hashlib
import tomllib
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from bottomlock.config.scenario import Scenario
from tests.cli.calls import command
from tools.example_dive import FOLDER, START_SD, made, scenario, start

pytestmark = pytest.mark.usefixtures("undrawn")
STEP = 1.1e-2
"""The coarsest step of a file: ranges of PD0 (1 cm), angles of the compass (0.01 deg)."""
METHODS = ("lc", "tc", "info", "weak_sway", "sway_current")


def shortened(duration_s: float) -> Scenario:
    """The same flight with an earlier end."""
    flown = scenario()
    return flown.with_trajectory(duration_s=duration_s)


def test_files_are_those_of_the_digests() -> None:
    lines = (FOLDER / "SHA256SUMS").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 9
    for line in lines:
        digest, name = line.split("  ")
        assert hashlib.sha256((FOLDER / name).read_bytes()).hexdigest() == digest, name


def test_the_script_makes_the_start_of_the_files(tmp_path: Path) -> None:
    """Twenty seconds of it, to a step of each file: a number between two steps may round either way."""
    for name in made(tmp_path, shortened(20.0)):
        ours, theirs = tmp_path / name, FOLDER / name
        if name == "dvl.pd0":
            sent = np.frombuffer(ours.read_bytes(), dtype=np.uint8)
            kept_bytes = np.frombuffer(theirs.read_bytes(), dtype=np.uint8)[: sent.size]
            assert np.mean(sent != kept_bytes) < 0.005
            continue
        read = pl.read_parquet if name.endswith(".parquet") else pl.read_csv
        table = read(ours)
        for column in table.columns:
            kept, found = read(theirs)[column].head(table.height), table[column]
            if found.dtype.is_float():
                np.testing.assert_allclose(found.to_numpy(), kept.to_numpy(), rtol=0, atol=STEP)
            else:
                assert found.to_list() == kept.to_list(), (name, column)


@pytest.mark.long
def test_the_case_runs_and_has_all_its_columns(tmp_path: Path) -> None:
    done = command("replay", FOLDER / "case.toml", "--out", tmp_path / "r")
    assert done.returncode == 0, done.stderr
    said = " ".join(done.stdout.split())
    assert "fault" not in said
    assert "warning" not in said
    runs = pl.read_parquet(tmp_path / "r" / "runs.parquet")
    for column in ("position_final_m", "position_final_percent", "velocity_rms_over_time_mps"):
        assert runs[column].null_count() == 0, column
    kept = runs.filter(pl.col("method").is_in(METHODS), pl.col("what_if") == "recorded")
    # 20 minutes after the last acoustic position: 3 sigma of the 2 m claimed; a centimetre a second of beams of 2 cm/s.
    assert kept["position_final_m"].max() < 6.0  # type: ignore[operator]
    assert kept["velocity_rms_over_time_mps"].max() < 0.03  # type: ignore[operator]
    # With two beams metres against hundreds of metres: claimed are 4.6 m and 270 m.
    ends = dict(
        runs.filter(pl.col("what_if") == "lost_34", pl.col("pass") == "forward")
        .select("method", "position_final_m")
        .iter_rows()
    )
    assert max(ends[method] for method in METHODS[1:]) < 14.0
    assert min(ends[method] for method in ("ins", "lc", "dead_reckoning")) > 100.0


def test_the_start_of_the_case_is_drawn_from_its_claims() -> None:
    """The numbers that the script prints, and the deviations that they were drawn with."""
    given = tomllib.loads((FOLDER / "case.toml").read_text(encoding="utf-8"))["start"]
    for key, value in start(pl.read_csv(FOLDER / "truth.csv")).items():
        assert given[key] == value, key
    claims = {key: given[f"{key.removesuffix('_deg')}_sd_deg"] for key in ("level_deg", "heading_deg")}
    claims |= {key: max(given[key.replace("_m", "_sd_m")]) for key in ("position_m", "velocity_mps")}
    assert claims == START_SD


def test_an_audit_of_its_files_has_no_fault(tmp_path: Path) -> None:
    done = command("audit", FOLDER / "beams.parquet", "--geometry", "teledyne_30", "--out", tmp_path / "a")
    assert done.returncode == 0, done.stderr
    assert "fault" not in done.stdout
