"""`replay --init`, `convert --init` and `geometries` on the logs that ship, and the mistakes of a first user."""

import shutil
from pathlib import Path

import pytest

from tests.cli.calls import command, refused, succeeded

pytestmark = pytest.mark.usefixtures("undrawn")


def test_one_command_from_a_shipped_log_to_a_page(
    root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`look` writes a case beside the log, replays it and opens the page; nothing is tuned."""
    opened: list[str] = []

    def show(uri: str) -> bool:
        opened.append(uri)
        return True

    monkeypatch.setattr("webbrowser.open", show)
    log = root / "data" / "logs" / "robosub"
    files = [tmp_path / f"night2_{name}.csv" for name in ("imu", "dvl", "ahrs", "depth")]
    for file in files:
        rows = (log / file.name).read_text(encoding="utf-8").splitlines(keepends=True)
        file.write_text("".join(rows[: len(rows) // 2]), encoding="utf-8")
    done = command("look", *files)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "night2_imu_look"
    assert opened == [(folder / "replay" / "report.html").as_uri()]
    assert "questions (# ?)" in done.stdout
    assert sorted(path.name for path in folder.iterdir()) == ["case.toml", "replay"]
    again = command("look", *files, "--no-open")
    assert (again.returncode, len(opened)) == (2, 1)
    assert f"{folder / 'case.toml'}: is there already" in again.stderr


def test_results_go_beside_the_log_by_default(root: Path, tmp_path: Path) -> None:
    """The geometry is the one that `convert` noted."""
    log = Path(shutil.copy(root / "data" / "logs" / "survey_dive" / "dvl.pd0", tmp_path))
    succeeded("convert", log)
    beams = tmp_path / "dvl_beams.parquet"
    for words, out in ((("fix", beams), "dvl_beams_fixes.parquet"), (("audit", beams), "dvl_beams_audit")):
        done = command(*words)
        assert done.returncode == 0, done.stderr
        assert (tmp_path / out).exists()
        assert out in done.stdout
        assert "geometry: teledyne_30" in done.stdout
    beams.with_suffix(".json").unlink()
    said = refused("fix", beams)
    assert "--geometry is missing" in said
    done = command("fix", log)
    assert done.returncode == 2
    assert "is a log of format pd0, not a table; convert it first" in done.stderr
