"""What every command shares: short options, quiet and verbose, JSON, examples, completion, exit codes, no colours."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import pytest

from bottomlock.cli import console
from bottomlock.cli.app import COMMANDS, JOBS, app
from bottomlock.cli.examples import EXAMPLES
from bottomlock.errors import EXIT_INTERRUPTED
from bottomlock.kernel import METHODS
from tests.cli.calls import command, process

SHORT = ("run", "straight", "-n", "2", "-s", "3", "-j", "1", "-m", "ins,tc")


@pytest.fixture
def short(tmp_path: Path) -> tuple[str, ...]:
    """A campaign of a second, by short options."""
    text = command("list", "scenarios", "--copy", "straight", "--to", tmp_path / "s.toml")
    assert text.returncode == 0
    own = tmp_path / "s.toml"
    own.write_text(own.read_text().replace("duration_s = 250.0", "duration_s = 10.0"))
    return ("run", str(own), *SHORT[2:])


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


@pytest.mark.parametrize("name", COMMANDS)
def test_every_help_names_its_arguments(name: str) -> None:
    """The usage has the names of the panel below it; a default that is empty is not shown."""
    shown = command(name, "--help").stdout
    usage = shown.splitlines()[0]
    assert "ARGS" not in usage
    assert "[default: ()]" not in shown
    assert '[default: ""]' not in shown
    arguments = re.findall(r"^│ (?:\* )? *([A-Z]+) ", shown, re.MULTILINE)
    assert [name for name in arguments if name not in usage] == []


@pytest.mark.parametrize("name", COMMANDS)
def test_where_a_result_goes_is_named_alike(name: str) -> None:
    """--out has its short form wherever it stands, and nothing else names a place to write to."""
    shown = command(name, "--help").stdout
    named = re.findall(r"^│ (?:\* )? *(?:[A-Z]+ )?(--(?:out|to)\b.*)", shown, re.MULTILINE)
    assert [words for words in named if not re.match(r"--out (?:--to )?-o ", words)] == []


def test_commands_stand_by_job() -> None:
    """Every command once, under the heading of its job."""
    shown = command("--help").stdout
    places = [shown.index(f" {job} ──") for job in JOBS]
    assert places == sorted(places)
    for job, commands in JOBS.items():
        panel = shown[shown.index(f" {job} ──") :]
        panel = panel[: panel.index("╰")]
        assert [name for name in commands if not re.search(rf"^│ {name} ", panel, re.MULTILINE)] == []
    assert sum(map(len, JOBS.values())) == len(COMMANDS)


@pytest.mark.parametrize("name", ["run", "study"])
def test_methods_are_listed_where_one_is_chosen(name: str) -> None:
    shown = command(name, "--help").stdout
    assert {method for method in METHODS if re.search(rf"\b{method}\b", shown)} == set(METHODS)


def test_short_options_are_the_long_ones(short: tuple[str, ...], tmp_path: Path) -> None:
    """The manifest has what they said."""
    assert command(*short, "-o", tmp_path / "o").returncode == 0
    manifest = json.loads((tmp_path / "o" / "manifest.json").read_text())
    stated = manifest["scenarios"]["straight"]
    assert (stated["runs"], stated["seed"], stated["methods"]) == (2, 3, ["ins", "tc"])
    assert manifest["threads"] == 1


def test_quiet_prints_errors_alone(short: tuple[str, ...], tmp_path: Path) -> None:
    done = command(*short, "-q", "-o", tmp_path / "o")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    failed = command("run", "nowhere.toml", "--quiet", "-o", tmp_path / "p")
    assert failed.returncode == 2
    assert "nowhere.toml" in failed.stderr
    assert command("list", "scenarios").stdout


def test_no_progress_leaves_the_tables(short: tuple[str, ...], tmp_path: Path) -> None:
    with_bar = command(*short, "-o", tmp_path / "o")
    without = command(*short, "--no-progress", "-o", tmp_path / "p")
    assert "runs/s" in with_bar.stderr
    assert without.stderr == ""
    assert "v m/s" in without.stdout


def test_verbose_says_the_time_and_where_an_error_is_from(tmp_path: Path) -> None:
    assert re.search(r"[\d.]+ s, \d+ MB at most", command("list", "scenarios", "-v").stderr)
    failed = command("run", "nowhere.toml", "-v", "-o", tmp_path / "p")
    assert failed.returncode == 2
    assert "Traceback" in failed.stderr
    assert "Traceback" not in command("run", "nowhere.toml", "-o", tmp_path / "p").stderr


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
    coloured = re.compile("\x1b\\[[0-9;]*3[0-9]")
    assert coloured.search(process("run", "--help").stdout)
    monkeypatch.setenv("NO_COLOR", "1")
    assert not coloured.search(process("run", "--help").stdout)


def test_the_page_has_every_exit_code(root: Path) -> None:
    page = (root / "docs" / "command_line.md").read_text(encoding="utf-8")
    section = page.split("## Exit codes")[1].split("\n## ")[0]
    codes = {int(code) for code in re.findall(r"^\| (\d+) \|", section, flags=re.MULTILINE)}
    ours = {value for name, value in vars(console).items() if name.startswith("EXIT_")}
    assert codes == {0, *ours, EXIT_INTERRUPTED}
