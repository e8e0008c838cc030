"""The commands `masks` and `consistency` as a new user runs them, with mistakes."""

import json
import re
from pathlib import Path

import polars as pl
import pytest

from tests.cli.calls import command

SHORT = ["--runs", "2", "--threads", "1", "--methods", "ins,weak_sway"]


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    """The straight line, cut to 80 s."""
    assert command("scenarios", "--copy", "straight", cwd=tmp_path).returncode == 0
    path = tmp_path / "straight.toml"
    text = path.read_text(encoding="utf-8").replace("duration_s = 250.0", "duration_s = 80.0")
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.long
def test_masks_prints_and_writes(tmp_path: Path, scenario: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Tables of 80 columns, files on disk, and the same command again finds everything done."""
    monkeypatch.setenv("COLUMNS", "80")
    done = command("masks", str(scenario), "--out", "o", *SHORT, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "straight, beams 1,4: RMS over runs at the end" in done.stdout
    assert "When the beams come back" in done.stdout
    assert max(len(line) for line in done.stdout.splitlines()) <= 80
    assert "…" not in done.stdout
    out = tmp_path / "o"
    assert pl.read_parquet(out / "masks.parquet").height == 17 * 2
    text = (out / "masks.md").read_text(encoding="utf-8")
    (figure,) = re.findall(
        r"<figure.*?<figcaption>(.*?)</figcaption>",
        (out / "masks.html").read_text(encoding="utf-8"),
        re.DOTALL,
    )
    assert figure.startswith("Straight: velocity error at the end by the beams that return")
    assert text.startswith("# Masks and recovery\n\n1. **Three beams or more**")
    assert f"- Command: `bottomlock masks {scenario} --out DIR --runs 2" in text
    assert text.count("| 1,2 |") == 1
    assert pl.read_parquet(out / "recovery.parquet").height == 6 * 2 * 5
    manifest = json.loads((out / "study.json").read_text(encoding="utf-8"))
    assert manifest["status"] == "complete"
    again = command("masks", str(scenario), "--out", "o", *SHORT, cwd=tmp_path)
    assert again.stdout == done.stdout
    other = command("masks", str(scenario), "--out", "o", *SHORT, "--seed", "5", cwd=tmp_path)
    assert other.returncode == 2
    assert "another configuration" in other.stderr


def test_consistency_exit_codes(tmp_path: Path, scenario: Path) -> None:
    """0 with whatever verdicts; with --assert 0 if they are as expected, 1 with the cells named if not."""
    call = ["consistency", str(scenario), "--out", "o", *SHORT, "--masks", "1234,12"]
    plain = command(*call, cwd=tmp_path)
    assert plain.returncode == 0, plain.stderr
    assert (
        (tmp_path / "o" / "consistency.md")
        .read_text(encoding="utf-8")
        .startswith("# Consistency of the methods")
    )
    assert pl.read_parquet(tmp_path / "o" / "consistency.parquet").height == 2 + 3 + 3
    page = (tmp_path / "o" / "consistency.html").read_text(encoding="utf-8")
    counts = re.search(r"</svg>weak_sway</span></th><td[^>]*>(\d)</td><td[^>]*>(\d)</td>", page)
    assert counts is not None
    assert counts[1] == "2"
    assert page.count("<h2") == 9
    for verdict, code in (("not overconfident", 0), ("overconfident", 1)):
        text = f'[[expect]]\nmethods = ["weak_sway"]\nbeams = ["1,2"]\nverdict = "{verdict}"\n'
        (tmp_path / "expected.toml").write_text(text, encoding="utf-8")
        done = command(*call, "--assert", "expected.toml", cwd=tmp_path)
        assert done.returncode == code
        assert ("straight, beams 1,2, weak_sway" in done.stderr) is (code == 1)


def test_consistency_in_another_world(tmp_path: Path, scenario: Path) -> None:
    """The page states the sensors and the command; in the same directory the paper's world is another study."""
    call = ["consistency", str(scenario), "--out", "o", *SHORT, "--masks", "1234"]
    done = command(*call, "--world", "survey_table2", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "o" / "consistency.md").read_text(encoding="utf-8")
    assert "2.7 % of the readings of each beam are outliers" in text
    assert "--out DIR --world survey_table2 --runs 2" in text
    other = command(*call, cwd=tmp_path)
    assert other.returncode == 2
    assert "another configuration" in other.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["masks", "--out", "o"], "no scenario is named"),
        (["masks", "straight"], "--out"),
        (["masks", "strait", "--out", "o"], "did you mean 'straight'"),
        (["masks", "straight", "straight", "--out", "o"], "different names"),
        (["masks", "straight", "--out", "o", "--cases", "12,15"], "unknown case '15'"),
        (["masks", "straight", "--out", "o", "--methods", "tcc"], "unknown method 'tcc'"),
        (["masks", "straight", "--out", "o", "--threads", "-1"], "--threads is -1"),
        (["masks", "straight", "--out", "/proc/nowhere", "--cases", "12"], "cannot be written"),
        (["masks", "straight", "--out", "o", "--world", "surve"], "did you mean 'survey'"),
        (["consistency"], "--out"),
        (["consistency", "--out", "o", "--world", "moon.toml"], "neither a file nor a packaged scenario"),
        (["consistency", "--out", "o", "--masks", "1235"], "no set of the beams 1 to 4"),
        (["consistency", "--out", "o", "--masks", ","], "no mask is named"),
        (["consistency", "--out", "o", "--runs", "0"], "'runs' is 0"),
        (["consistency", "--out", "o", "--assert", "none.toml"], "no such file of expected verdicts"),
    ],
)
def test_mistakes_end_with_code_2_and_one_line(arguments: list[str], words: str, tmp_path: Path) -> None:
    """Exit code 2, the place named on one line, no traceback, nothing written."""
    done = command(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    message = [line for line in done.stderr.splitlines() if line.startswith("bottomlock: ")]
    assert len(message) == 1
    assert words in message[0]
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())


def test_a_typo_in_expectations_shows_before_anything_flies(tmp_path: Path) -> None:
    (tmp_path / "expected.toml").write_text(
        '[[expect]]\nmethods = ["weak_sway"]\nbeams = ["12"]\nverdict = "consistent"\n', encoding="utf-8"
    )
    done = command("consistency", "--out", "o", "--assert", "expected.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert "beams '12' is not in the consistency study" in done.stderr
    assert not (tmp_path / "o").exists()


def test_masks_without_room_for_an_outage(tmp_path: Path, scenario: Path) -> None:
    """A scenario too short for a minute of two beams still has its masks, and the reason is told."""
    text = scenario.read_text(encoding="utf-8").replace("duration_s = 80.0", "duration_s = 10.0")
    scenario.write_text(text, encoding="utf-8")
    done = command("masks", str(scenario), "--out", "o", *SHORT, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "recovery is not run: scenario straight: lasts 10 s, expected 70 s or more" in done.stderr
    assert (tmp_path / "o" / "masks.parquet").exists()
    assert not (tmp_path / "o" / "recovery.parquet").exists()
