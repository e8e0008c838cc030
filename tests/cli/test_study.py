"""The command `study` as a new user runs it, with mistakes."""

import json
from pathlib import Path

import polars as pl
import pytest

from tests.cli.calls import command, refused

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
    stamps = {path: path.stat().st_mtime_ns for path in (tmp_path / "o" / "cells").rglob("samples-*")}
    again = command("study", *SHORT, "--out", "o", "--json", cwd=tmp_path)
    assert json.loads(again.stdout)["cells"] == table.to_dicts()
    assert {path: path.stat().st_mtime_ns for path in stamps} == stamps
    said = refused("study", *SHORT, "--out", "o", "--seed", "5", cwd=tmp_path)
    assert "differs in: command" in said
