"""`replay --init`, `convert --init` and `geometries` on the logs that ship, and the mistakes of a first user."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.calls import command

pytestmark = pytest.mark.usefixtures("undrawn")


def test_two_commands_from_a_shipped_log_to_a_report(root: Path, tmp_path: Path) -> None:
    log = root / "data" / "logs" / "robosub"
    files = [log / f"night2_{name}.csv" for name in ("imu", "dvl", "ahrs", "depth")]
    done = command("replay", "--init", *files, "--out", tmp_path / "case.toml")
    assert done.returncode == 0, done.stderr
    assert "questions (# ?)" in done.stdout
    assert [path.name for path in tmp_path.glob("*.toml")] == ["case.toml"]
    done = command("replay", tmp_path / "case.toml", "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "Method tc: " in done.stdout
    assert 'id="findings"' in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_a_column_map(root: Path, tmp_path: Path) -> None:
    log = root / "data" / "logs" / "robosub" / "night2_dvl.csv"
    done = command("convert", log, "--init", "--to", tmp_path / "map.toml")
    assert done.returncode == 0, done.stderr
    done = command(
        "convert",
        log,
        "--to",
        tmp_path / "v.parquet",
        "--columns",
        tmp_path / "map.toml",
        "--instrument-only",
    )
    assert done.returncode == 0, done.stderr
    assert "436" in done.stdout


def test_geometries() -> None:
    done = command("list", "geometries")
    assert done.returncode == 0, done.stderr
    assert "waterlinked_a50: Water Linked A50" in done.stdout


def test_no_file_and_a_log_in_place_of_a_case(root: Path) -> None:
    done = command("replay", "--init")
    assert (done.returncode, "no file is named" in done.stderr) == (2, True)
    done = command("replay", root / "data" / "logs" / "robosub" / "night2_imu.csv", "--out", "x")
    assert (done.returncode, "bottomlock replay --init" in done.stderr) == (2, True)
