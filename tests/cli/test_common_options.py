"""What every command shares: short options, quiet and verbose, JSON, examples, completion, exit codes, no colours."""

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from bottomlock.cli.app import COMMANDS, app
from bottomlock.cli.examples import EXAMPLES
from tests.cli.calls import command, refused, shortened, succeeded

SHORT = ("run", "straight", "-n", "2", "-s", "3", "-j", "1", "-m", "ins,tc")


@pytest.fixture
def short(tmp_path: Path) -> tuple[str, ...]:
    """A campaign of a second, by short options."""
    return ("run", str(shortened("straight", tmp_path / "s.toml", 10.0)), *SHORT[2:])


def test_version_is_short_too() -> None:
    assert command("-V").stdout == command("--version").stdout != ""


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_every_help_has_examples_that_are_right(name: str) -> None:
    """Each is shown whole, and its words are options that the command has."""
    shown = " ".join(command(name, "--help").stdout.split())
    assert EXAMPLES[name]
    for example in EXAMPLES[name]:
        assert f"bottomlock {example}" in shown
        words = shlex.split(example)
        assert words[0] == name
        called, _, ignored = app.parse_args(words, exit_on_error=False, print_error=False)
        assert callable(called)
        assert not ignored


def test_short_options_are_the_long_ones(short: tuple[str, ...], tmp_path: Path) -> None:
    """The manifest has what they said."""
    succeeded(*short, "-o", tmp_path / "o")
    manifest = json.loads((tmp_path / "o" / "manifest.json").read_text())
    stated = manifest["scenarios"]["straight"]
    assert (stated["runs"], stated["seed"], stated["methods"]) == (2, 3, ["ins", "tc"])
    assert manifest["threads"] == 1


def test_quiet_prints_errors_alone(short: tuple[str, ...], tmp_path: Path) -> None:
    done = command(*short, "-q", "-o", tmp_path / "o")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    said = refused("run", "nowhere.toml", "--quiet", "-o", tmp_path / "p")
    assert "nowhere.toml" in said
    assert command("list", "scenarios").stdout


def test_no_progress_leaves_the_tables(short: tuple[str, ...], tmp_path: Path) -> None:
    with_bar = command(*short, "-o", tmp_path / "o")
    without = command(*short, "--no-progress", "-o", tmp_path / "p")
    assert "runs/s" in with_bar.stderr
    assert without.stderr == ""
    assert "v m/s" in without.stdout


def test_json_is_what_the_tables_have(short: tuple[str, ...], tmp_path: Path) -> None:
    """Nothing else on the standard output; no NaN, which JSON does not have."""
    done = command(*short, "--json", "-o", tmp_path / "o")
    content = json.loads(done.stdout, parse_constant=pytest.fail)
    assert [(row["trajectory"], row["method"]) for row in content["results"]] == [
        ("straight", "ins"),
        ("straight", "tc"),
    ]
    assert "straight" in json.loads(command("list", "scenarios", "--json").stdout)


def test_no_color_is_honoured(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where colours are forced, as in CI; without it they are there."""
    monkeypatch.setenv("FORCE_COLOR", "1")
    code = "from bottomlock.cli.console import console, errors, help_console as of_help\n"
    code += "for one in (console, errors, of_help): one.print('words', style='red')"
    for count in (3, 0):
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        assert len(re.findall("\x1b\\[[0-9;]*3[0-9]", done.stdout + done.stderr)) == count
        monkeypatch.setenv("NO_COLOR", "1")
