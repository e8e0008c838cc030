"""The command `study` as a new user runs it, with mistakes."""

import json
from pathlib import Path

import polars as pl
import pytest

from tests.cli.calls import command

SHORT = ("straight", "--runs", "2", "--threads", "1", "--methods", "ins,weak_sway", "--masks", "1234,12")


def test_study_prints_writes_and_resumes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Tables of 80 columns, files on disk; the same command finds everything done, another one needs --force."""
    monkeypatch.setenv("COLUMNS", "80")
    done = command("study", *SHORT, "--out", "o", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "straight, beams 1,2, sensors as configured: RMS over runs at the end" in done.stdout
    assert max(len(line) for line in done.stdout.splitlines()) <= 80
    table = pl.read_parquet(tmp_path / "o" / "study.parquet")
    assert table.select("beams", "method").rows() == [
        ("1,2,3,4", "ins"),
        ("1,2,3,4", "weak_sway"),
        ("1,2", "weak_sway"),
    ]
    assert "--masks 1234,12" in (tmp_path / "o" / "study.html").read_text(encoding="utf-8")
    stamps = {path: path.stat().st_mtime_ns for path in (tmp_path / "o" / "cells").rglob("samples-*")}
    again = command("study", *SHORT, "--out", "o", "--json", cwd=tmp_path)
    assert json.loads(again.stdout)["cells"] == table.to_dicts()
    assert {path: path.stat().st_mtime_ns for path in stamps} == stamps
    other = command("study", *SHORT, "--out", "o", "--seed", "5", cwd=tmp_path)
    assert other.returncode == 2
    assert "differs in: command" in other.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["straight"], "--out"),
        (["--out", "o", "--masks", "1235"], "'1235' is no set of the beams 1 to 4"),
        (["--out", "o", "--world", "surve"], "did you mean 'survey'"),
    ],
)
def test_mistakes_end_with_code_2_and_one_line(arguments: list[str], words: str, tmp_path: Path) -> None:
    """The place named on one line, no traceback, nothing written."""
    done = command("study", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    (message,) = [line for line in done.stderr.splitlines() if line.startswith("bottomlock: ")]
    assert words in message
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())
