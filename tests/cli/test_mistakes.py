"""A mistake per command: its error states place, key, expectation and hint, each where it has one."""

from pathlib import Path
from typing import NamedTuple

import pytest

from bottomlock.cli.app import COMMANDS, app
from bottomlock.errors import BottomlockError

BEAMS = ",".join(f"beam{k}_mps,beam{k}_valid" for k in (1, 2, 3, 4))
FILES = {
    "scenario.toml": "[imu]\ngyro_bias_deg_per_hour = 1.0\n",
    "case.toml": '[imu]\nfile = "imu.csv"\nrate = 100\n',
    "live.toml": '[dvl]\nadress = "tcp://127.0.0.1:16171"\n',
    "log.csv": f"time_ns,{BEAMS}\n0,fast,1,1,1,1,1,1,1\n5,1,1,1,1,1,1,1,1\n",
}


class Mistake(NamedTuple):
    """Arguments, and what the error states: words that each part holds, "" where it has none."""

    arguments: str
    place: str
    key: str
    expected: str
    hint: str


MISTAKES = {
    "convert": Mistake("log.csv", "log.csv: row 0", "beam1_mps", "a number", ""),
    "audit": Mistake("log.csv", "log.csv: row 0", "beam1_mps", "a number", ""),
    "fix": Mistake(
        "log.csv --geometry waterlinked_a51", "", "waterlinked_a51", "a file, or one of", "waterlinked_a50"
    ),
    "replay": Mistake("case.toml", "case.toml", "name", "text", ""),
    "tune": Mistake("log.csv", "log.csv", "", "", "replay --init"),
    "look": Mistake("log.csv", "", "", "", "a replay needs both"),
    "live": Mistake("live.toml", "live.toml", "dvl.geometry", "text", ""),
    "fly": Mistake("strait --dry-run", "", "strait", "a file, or one of", "did you mean 'straight'?"),
    "run": Mistake("strait", "", "strait", "a file, or one of", "did you mean 'straight'?"),
    "study": Mistake("strait --out o", "", "strait", "a file, or one of", "did you mean 'straight'?"),
    "observe": Mistake("strait", "", "strait", "a file, or one of", "did you mean 'straight'?"),
    "reproduce": Mistake("--runs 0 --out o", "scenario straight", "runs", ">= 1", ""),
    "report": Mistake("nowhere", "nowhere", "", "", "`bottomlock run` makes one"),
    "list": Mistake("scenarios --copy strait", "", "strait", "one of", "did you mean 'straight'?"),
    "simulate-dvl": Mistake("strait", "", "strait", "a file, or one of", "did you mean 'straight'?"),
}


@pytest.mark.parametrize("command", MISTAKES)
def test_a_mistake_is_named(command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a command refuses, by the attributes of its error; its text holds all of them."""
    monkeypatch.chdir(tmp_path)
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    wanted = MISTAKES[command]
    with pytest.raises(BottomlockError) as caught:
        app([command, *wanted.arguments.split()], exit_on_error=False)
    error = caught.value
    stated = (error.place, error.key, error.expected, error.hint)
    for part, (words, text) in zip(Mistake._fields[1:], zip(wanted[1:], stated, strict=True), strict=True):
        assert words in text, (part, str(error))
        assert bool(words) == bool(text), (part, str(error))
        assert text in str(error)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("live-setup here --port 99999", "--port is 99999, expected 0 to 65535"),
        ("live-setup here --host rov..local", "'rov..local' is no name of a host"),
        ("live-setup live.toml", "live.toml: is a file, expected a folder"),
        ("simulate-dvl straight --dvl file:out --run 99999999999999999999", "--run is 99999999999999999999"),
    ],
)
def test_what_no_system_takes_is_refused_at_once(
    arguments: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A port beyond 16 bits was another one, and a file in place of a folder was told at the first click."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "live.toml").write_text(FILES["live.toml"])
    with pytest.raises(BottomlockError) as caught:
        app(arguments.split(), exit_on_error=False)
    assert words in str(caught.value)


def test_every_command_that_reads_input_has_its_mistake() -> None:
    """Left out are those that only serve what runs: a demonstration and a page."""
    assert set(COMMANDS) - set(MISTAKES) == {"keys", "live-demo", "live-setup"}
