"""What can be seen before a command begins is refused before its progress bar, all of it at once."""

import shutil
from pathlib import Path

import pytest

from tests.cli.calls import command, refused

LONG = ("--runs", "2000000")
ROBOSUB = Path(__file__).resolve().parents[2] / "data" / "logs" / "robosub"


@pytest.mark.parametrize(
    ("changes", "added", "expected"),
    [
        (
            [("night2_depth.csv", "nope.csv"), ("night2_imu.csv", "gone.csv")],
            "",
            ["nope.csv: no such file, named in [depth]", "gone.csv: no such file, named in [imu]"],
        ),
        (
            [("dvl.toml", "other.toml"), ("night2_ahrs.csv", "none.csv")],
            "",
            [
                "none.csv: no such file, named in [attitude], [reference]",
                "other.toml' is neither a file nor packaged",
            ],
        ),
        ([('column = "data"', 'column = "dat"')], "", ["column 'dat' is missing"]),
        (
            [],
            '[[what_if]]\nname = "y"\nbeams_lost = [7]\n[[what_if]]\nname = "z"\nbeams_lost = [8]\n',
            ["what_if 'y': beam 7 does not exist", "what_if 'z': beam 8 does not exist"],
        ),
        ([("at_s = 1.0", "at_s = 400.0")], "", ["before the start at 400.000 s"]),
    ],
)
def test_a_replay_that_cannot_begin_shows_no_bar(
    tmp_path: Path, changes: list[tuple[str, str]], added: str, expected: list[str]
) -> None:
    """Exit code 2, a line for each fault, nothing else on the screen, and no directory."""
    folder = tmp_path / "case"
    shutil.copytree(ROBOSUB, folder)
    text = (folder / "case.toml").read_text("utf-8")
    for right, wrong in changes:
        assert right in text
        text = text.replace(right, wrong)
    (folder / "case.toml").write_text(f"{text}\n{added}", "utf-8")
    done = command("replay", folder / "case.toml", "--out", tmp_path / "out")
    assert done.returncode == 2
    assert not done.stdout
    lines = done.stderr.splitlines()
    assert len(lines) == len(expected)
    for words in expected:
        assert any(line.startswith("bottomlock: ") and words in line for line in lines), words
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "words", [("run", "straight"), ("run", "straight", "--set", "dvl.tilt_deg=20,30"), ("reproduce",)]
)
def test_a_directory_of_something_else_is_refused_before_anything_runs(
    tmp_path: Path, words: tuple[str, ...]
) -> None:
    """Nothing in it is touched."""
    (tmp_path / "mine.txt").write_text("mine")
    said = refused(*words, *LONG, "--out", tmp_path)
    assert "choose another directory" in said
    assert len(said.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
