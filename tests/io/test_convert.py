"""The command `bottomlock convert`: what it writes, what it says, and how it rejects."""

import functools
import json
import re
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import polars as pl
import pytest

from bottomlock.io.beam_table import read_account, read_beam_table
from bottomlock.io.beams import read_beams
from bottomlock.io.table import read_map
from tests.cli import calls
from tests.io import bags
from tools import reader_seeds as seeds

Run = Callable[..., CompletedProcess[str]]


@pytest.fixture
def command() -> Run:
    """Runs `bottomlock` with arguments, in this process."""
    return calls.command


@pytest.fixture
def convert(command: Run) -> Run:
    return functools.partial(command, "convert")


def test_a_log_becomes_a_table_that_fix_reads(tmp_path: Path, command: Run) -> None:
    """Convert, then fix by the packaged geometry that the account names: velocity as the beams were made."""
    log, to, fixes = tmp_path / "log.txt", tmp_path / "out" / "beams.parquet", tmp_path / "fixes.parquet"
    log.write_bytes(b"".join(seeds.a50_report(k, version="json_v3") for k in range(5)) + b'{"time":')
    done = command("convert", log, "--to", to)
    assert done.returncode == 0, done.stderr
    assert "waterlinked-json: 6 records read, 5 pings kept, 1 skipped" in done.stdout
    assert "truncated" in done.stdout
    assert read_beam_table(to).rows == 5
    account = read_account(to)
    assert account["source"] == "log.txt"
    assert account["skipped"]["truncated"] == {"count": 1, "first": '{"time":', "first_line": 6}
    fixed = command("fix", to, "--geometry", account["geometry"], "--method", "lc", "--out", fixes)
    assert fixed.returncode == 0, fixed.stderr
    assert (pl.read_parquet(fixes)["status"] == "fix").all()


def test_the_examples_of_the_documentation(
    tmp_path: Path, root: Path, command: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The commands of docs/formats.md run as they stand, and the first says what the page says."""
    page = (root / "docs" / "formats.md").read_text(encoding="utf-8")
    (tmp_path / "data").symlink_to(root / "data")
    monkeypatch.chdir(tmp_path)
    blocks = page.split("```")
    first, second = blocks[1].strip().splitlines()
    (third,) = re.findall(r"`(bottomlock convert data/logs/robosub[^`]*)`", page)
    done = [command(*line.split()[1:]) for line in (first, second, third)]
    assert [one.returncode for one in done] == [0, 0, 0], [one.stderr for one in done]
    assert (
        done[0].stdout == blocks[3].lstrip() + "wrote out/beams.parquet, beams_water.parquet and beams.json\n"
    )


def test_a_bag_that_is_a_folder(tmp_path: Path, convert: Run) -> None:
    """A ROS 2 bag is a folder: its hash is that of its files."""
    pytest.importorskip("rosbags", reason="bags need the extra .[ros]")
    bag, to = bags.write_ros2(tmp_path / "dive", 3), tmp_path / "beams.parquet"
    done = convert(bag, "--to", to)
    assert done.returncode == 0, done.stderr
    assert len(read_account(to)["source_sha256"]) == 64
    table = read_beam_table(to)
    assert table.rows == 3
    assert table.arrival_ns is not None


TABLE = "t,u1,u2,u3,g1,g2,g3,r1,r2,r3\n1.5,100,200,300,1,1,0,5,6,\n2.5,110,210,,1,1,0,5,6,7\n"
MAP = """
[columns]
time = "t"
time_unit = "s"
velocity = ["u1", "u2", "u3"]
valid = ["g1", "g2", "g3"]
range = ["r1", "r2", "r3"]
velocity_scale = 0.001
"""


def test_a_table_with_a_column_map(tmp_path: Path, convert: Run) -> None:
    """Plain CSV: names, units and scale from a map; ranges are kept."""
    log, columns, to = tmp_path / "log.csv", tmp_path / "map.toml", tmp_path / "beams.parquet"
    log.write_text(TABLE)
    columns.write_text(MAP)
    done = convert(log, "--to", to, "--columns", columns)
    assert done.returncode == 0, done.stderr
    frame = pl.read_parquet(to)
    assert frame["time_ns"].to_list() == [1_500_000_000, 2_500_000_000]
    assert frame["beam1_mps"].to_list() == pytest.approx([0.1, 0.11])
    assert frame["beam3_mps"].to_list() == [pytest.approx(0.3), None]
    assert frame["beam3_range_m"].to_list() == [None, 7.0]
    assert frame["beam3_valid"].to_list() == [False, False]
    # What convert wrote is itself a table that it reads.
    again = convert(to, "--to", tmp_path / "again.parquet")
    assert again.returncode == 0, again.stderr
    assert json.loads((tmp_path / "again.json").read_text())["format"] == "table"


@pytest.mark.parametrize("code", ["-32768", "88888", "9.97e36", "0"])
def test_a_code_for_no_reading_is_no_velocity(code: str, tmp_path: Path, convert: Run) -> None:
    """Flagged valid or not, in a table that convert reads and in one that `fix` reads; the account counts it.

    The 0 of a beam is one where its range is 0 or less; another 0 is a reading.
    """
    log, columns = tmp_path / "log.csv", tmp_path / "map.toml"
    log.write_text(
        f"t,u1,u2,u3,r1,r2,r3,g1,g2,g3\n1.5,{code},200,300,-1,5,6,1,1,1\n2.5,110,0,310,5,6,7,1,1,1\n"
    )
    columns.write_text(MAP)
    done = convert(log, "--to", tmp_path / "beams.parquet", "--columns", columns)
    assert done.returncode == 0, done.stderr
    frame = pl.read_parquet(tmp_path / "beams.parquet")
    assert frame["beam1_valid"].to_list() == [False, True]
    assert frame["beam2_valid"].to_list() == [True, True]
    account = json.loads((tmp_path / "beams.json").read_text())
    assert account["flagged"]["velocity is a code for no reading"]["count"] == 1
    pings = read_beams(log, beams=3, columns=read_map(columns))
    assert pings.valid.tolist() == [[False, True, True], [True, True, True]]
