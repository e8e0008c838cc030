"""The command as a new user runs it, with mistakes."""

import json
from pathlib import Path

import polars as pl
import pytest

from tests.cli.calls import command, process, refused, shortened, succeeded

DASK = ["run", "straight", "--out", "o", "--engine", "dask", "--scheduler"]
RUN = ["run", "straight", "--runs", "2", "--methods", "lc,tc", "--threads", "1"]


def test_run_writes_tables_and_prints_one(tmp_path: Path) -> None:
    """The whole way in a process of its own: scenario name to tables on disk and a table on the screen."""
    short = ["run", str(shortened("straight", tmp_path / "s.toml")), *RUN[2:], "--out", str(tmp_path / "o")]
    done = process(*short)
    assert done.returncode == 0, done.stderr
    assert "straight: RMS over runs at the end" in done.stdout
    assert pl.read_parquet(tmp_path / "o" / "runs.parquet").height == 4
    assert json.loads((tmp_path / "o" / "manifest.json").read_text(encoding="utf-8"))["status"] == "complete"
    again = command(*short)
    assert again.returncode == 0
    assert (
        again.stdout.split("s; tables")[0].rsplit("\n", 1)[0]
        == done.stdout.split("s; tables")[0].rsplit("\n", 1)[0]
    )


@pytest.mark.parametrize(
    ("kind", "known"),
    [
        ("scenarios", "slope"), ("vehicles", "tauv"), ("geometries", "waterlinked_a50"), ("grades", "imu/mti"),
        ("methods", "dead_reckoning"), ("formats", "pd0"),
    ],
)  # fmt: skip
def test_what_ships_is_listed(tmp_path: Path, kind: str, known: str) -> None:
    """By name, for a reader and as JSON; of these, files can be copied."""
    assert known in json.loads(command("list", kind, "--json").stdout)
    assert known.rpartition("/")[2] in command("list", kind).stdout
    copied = command("list", kind, "--copy", known, cwd=tmp_path)
    assert (copied.returncode == 0) == (kind in {"scenarios", "vehicles", "geometries"}), copied.stderr
    assert [path.name for path in tmp_path.iterdir()] == ([] if copied.returncode else [f"{known}.toml"])


def test_without_out_results_go_beside_the_scenario(tmp_path: Path) -> None:
    """A folder named as the scenarios; of packaged ones in the current directory."""
    (tmp_path / "own").mkdir()
    succeeded("list", "scenarios", "--copy", "straight", "--to", "own/s.toml", cwd=tmp_path)
    for words, folder in ((["own/s.toml"], "own/s"), (["straight"], "straight")):
        done = command("run", *words, *RUN[2:], cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert f"tables in {folder}" in " ".join(done.stdout.split())
        assert (tmp_path / folder / "runs.parquet").is_file()


def test_fly_swims_a_scenario(tmp_path: Path) -> None:
    """Truth, telemetry and a figure; and the campaign uses the vehicle if the scenario says so."""
    shortened("straight", tmp_path / "straight.toml")
    done = command("fly", "straight.toml", "--out", "o", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "straight: 2.000 m/s" in done.stdout
    for name in ("straight_path", "straight_motion"):
        assert (tmp_path / "o" / f"{name}.png").stat().st_size > 10_000
        assert (tmp_path / "o" / f"{name}.svg").is_file()
    truth = pl.read_parquet(tmp_path / "o" / "straight_truth.parquet")
    assert truth.height == 3001
    assert "attitude_t_p_w" in truth.columns
    campaign = command("run", "straight.toml", "--out", "c", "--runs", "2", "--methods", "tc", cwd=tmp_path)
    assert campaign.returncode == 0, campaign.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "--out", "o"], "no scenario is named"),
        (["run", "straight", "--out", "o", "--runs", "0"], "'campaign.runs' is 0, expected >= 1"),
        (["run", "straight", "--out", "o", "--runs", "many"], "many"),
        (["run", "straight", "--out", "o", "--threads", "-1"], "--threads is -1"),
        (["run", "straight", "--out", "/proc/nowhere"], "cannot be written"),
        (["run", "straight", "--out", "o", "--runz", "3"], "--runz"),
        (["run", "straight", "--out", "o", "--scheduler", "tcp://a:1"], "only dask has schedulers"),
        ([*DASK, "a"], "such as tcp://host:8786"),
        ([*DASK, "tcp://a:1", "--threads", "2"], "whose workers bring their own"),
        (["fix", "none.csv", "--geometry", "x_janus_20", "--method", "lc", "--out", "f.parquet"], "no such file"),
        (["fix", "none.csv", "--geometry", "x_janus_20", "--method", "lc", "--out", "f.csv"], "ends in .parquet"),
        (["swim"], "swim"),
        (["run", "straight", "--out", "o", "--set", "imu.gyro_bias_deg_per_h=1,-2"], "is -2, expected >= 0"),
        (["run", "straight", "--out", "o", "--set", "dvl.tilt_deg=2", "--set", "dvl.tilt_deg=3"], "is given twice"),
        (["run", "straight", "--out", "o", "--set", "imu.gyro_bais_deg_per_h=1,2"], "did you mean"),
        (["study", "straight"], "--out"),
        (["study", "--out", "o", "--masks", "1235"], "'1235' is no set of the beams 1 to 4"),
        (["study", "--out", "o", "--world", "surve"], "did you mean 'survey'"),
        (["simulate-dvl", "straight", "--format", "nucleus"], "holds 3 beams, the geometry has 4"),
        (["simulate-dvl", "straight", "--faults", "drop=1"], "did you mean 'drops'"),
        (["simulate-dvl", "straight", "--dvl", "tcp:16171"], "did you mean tcpin:HOST:PORT"),
        (["simulate-dvl", "straight", "--clock", "noon"], "--clock is 'noon', expected a date"),
    ],
)  # fmt: skip
def test_mistakes_end_with_code_2_and_one_line(arguments: list[str], words: str, tmp_path: Path) -> None:
    """Exit code 2, the place named on one line, no traceback, nothing written."""
    said = refused(*arguments, cwd=tmp_path)
    message = [line for line in said.splitlines() if line.startswith("bottomlock: ")]
    assert len(message) == 1
    assert words in message[0]
    assert "Traceback" not in said
    assert not list(tmp_path.iterdir())


def test_control_characters_are_printed_as_codes(tmp_path: Path) -> None:
    """In a file name, in what was typed and in what a file holds: none clears a screen or turns a name round."""
    name, shown = (
        "o\x1b[2J\x1b]0;root\x07\r\x08\x9b31m\u202egpj",
        r"o\x1b[2J\x1b]0;root\x07\r\x08\x9b31m\u202egpj",
    )
    done = command(*RUN, "--out", name, cwd=tmp_path)
    assert done.returncode == 0
    assert f"tables in {shown}\n" in done.stdout
    done = command(*RUN, "--seed", "7", "--out", name, cwd=tmp_path)
    assert done.stderr.startswith(f"bottomlock: {shown}: holds a campaign of another configuration")
    done = command("run", name, "--out", "p", cwd=tmp_path)
    assert done.stderr.startswith(f"bottomlock: {shown}: is a folder, expected a scenario")
    pl.DataFrame({f"v{name}": [1.0], "time": [name]}).write_csv(tmp_path / "log.csv")
    done = command(
        "fix", "log.csv", "--geometry", "x_janus_20", "--method", "lc", "--out", "f.parquet", cwd=tmp_path
    )
    assert done.returncode == 2
    assert not set(done.stdout + done.stderr) & {"\x1b", "\x07", "\x08", "\x9b", "\r", "\u202e"}
