"""`bottomlock replay` as a new user runs it: the worked example, and a directory of something else."""

import json
import shutil
from pathlib import Path

import polars as pl
import pytest

from tests.cli.calls import command, refused
from tests.undrawn import figures_undrawn

EXAMPLE = "data/logs/robosub"


@pytest.fixture(scope="module")
def out(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The worked example of docs/replay.md, run as it stands there."""
    folder = tmp_path_factory.mktemp("replay") / "robosub"
    with figures_undrawn():
        done = command("replay", f"{EXAMPLE}/case.toml", "--out", str(folder), cwd=root)
    assert done.returncode == 0, done.stderr
    assert "Beams 3, 4 lost throughout." in done.stdout
    assert "Lost 34 (semi-synthetic)" in done.stdout
    assert "Semi-synthetic: beams projected from the instrument's velocity." in done.stdout
    return folder


def test_example_writes_tables_report_and_manifest(out: Path) -> None:
    runs = pl.read_parquet(out / "runs.parquet")
    assert runs["what_if"].unique(maintain_order=True).to_list() == ["recorded", "lost_34", "outage"]
    assert runs["position_final_m"].null_count() == runs.height  # there is no position to compare with
    manifest = json.loads((out / "manifest.json").read_text(encoding="utf-8"))
    assert manifest["files"]["imu"]["sha256"].startswith("078e9723")
    assert 0.01 < manifest["clocks"]["imu"]["max_stamp_deviation_s"] < 0.015  # the host's jitter, told
    pings = pl.read_parquet(out / "pings.parquet").filter(pl.col("what_if") == "lost_34")
    assert not pings["beam3_valid"].any()
    assert "semi-synthetic" in (out / "report.html").read_text(encoding="utf-8")


def test_directory_of_something_else(out: Path, root: Path, tmp_path: Path) -> None:
    """Another case's directory is kept unless `--force`; a foreign one is kept in any case."""
    case = str(root / EXAMPLE / "case.toml")
    mine = tmp_path / "copy"
    shutil.copytree(out, mine)
    said = refused("replay", case, "--out", str(mine), "--methods", "lc")
    assert "holds a replay of another configuration" in said
    assert (mine / "runs.parquet").read_bytes() == (out / "runs.parquet").read_bytes()
    foreign = tmp_path / "foreign"
    foreign.mkdir()
    (foreign / "note.txt").write_text("mine", encoding="utf-8")
    done = command("replay", case, "--out", str(foreign), "--force")
    assert done.returncode == 2
    assert "is not empty and holds no replay" in done.stderr
