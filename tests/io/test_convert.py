"""The command `bottomlock convert`: what it writes, what it says, and how it rejects."""

from __future__ import annotations

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
from bottomlock.io.formats import read_recording
from bottomlock.io.progress import progress_to
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
    """Runs `bottomlock convert`."""
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


def test_nothing_is_overwritten_in_silence(tmp_path: Path, convert: Run) -> None:
    """A table or an account that is there stays, until --force."""
    log, to = tmp_path / "log.txt", tmp_path / "beams.parquet"
    log.write_bytes(seeds.SERIAL)
    assert convert(log, "--to", to).returncode == 0
    again = convert(log, "--to", to)
    assert again.returncode == 2
    assert again.stderr.splitlines() == [
        f"bottomlock: {to}: is there already; choose another name, or use --force to replace it"
    ]
    to.unlink()
    assert "beams.json: is there already" in convert(log, "--to", to).stderr
    assert convert(log, "--to", to, "--force").returncode == 0


@pytest.mark.parametrize(
    ("content", "arguments", "message"),
    [
        (b"hello\n", (), "format not recognised from the content"),
        (b"a,b\n1,2\n", (), "names no documented columns"),
        (b"", (), "format not recognised from the content"),
        (
            seeds.SERIAL,
            ("--format", "pd7"),
            "--format is 'pd7', did you mean 'pd6'? expected one of linkquest-csv",
        ),
        (seeds.SERIAL, ("--format", "pd0"), "no ensemble with bottom track could be read"),
        (seeds.PD6, (), "PD6 holds no beam velocities"),
        (seeds.pd4(), (), "PD3, PD4 and PD5 hold no beam velocities"),
        (seeds.pd0_ensemble(1, frame=3), (), "set the instrument to beam coordinates (EX00000)"),
        (seeds.SERIAL, ("--format", "ros"), "cannot be read as a bag"),
    ],
    ids=["text", "csv", "empty", "no such format", "another format", "pd6", "pd4", "earth", "no bag"],
)
def test_refusals_are_one_line(
    tmp_path: Path, content: bytes, arguments: tuple[str, ...], message: str, convert: Run
) -> None:
    """Exit code 2, a line that names the file, no table."""
    log, to = tmp_path / "log.bin", tmp_path / "beams.parquet"
    if content.startswith(b"a,b"):
        log = log.with_suffix(".csv")
    log.write_bytes(content)
    done = convert(log, "--to", to, *arguments)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == [log]


def test_places_that_are_wrong(tmp_path: Path, convert: Run) -> None:
    """A missing file, a folder that is no bag, a name that is not Parquet's."""
    assert "none.bin: no such file" in convert(tmp_path / "none.bin", "--to", tmp_path / "b.parquet").stderr
    assert "is a folder without the metadata.yaml" in convert(tmp_path, "--to", tmp_path / "b.parquet").stderr
    folder = convert(tmp_path, "--to", tmp_path / "b.parquet", "--format", "pd0")
    assert "is a folder, expected a file" in folder.stderr
    assert "expected a name that ends in .parquet" in convert(tmp_path, "--to", tmp_path / "b.csv").stderr


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


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (MAP.replace('"u3"', '"u9"'), "column 'u9' is missing"),
        (MAP.replace('range = ["r1", "r2", "r3"]', 'range = ["r1"]'), "names r1, expected 3 columns"),
        (MAP.replace('"g3"]', '"g3", "g1"]'), "columns.valid names 4 columns, expected 3"),
        (MAP.replace("velocity_scale", "velocity_skale"), "unknown key 'velocity_skale', did you mean"),
        ("[columns", "not valid TOML"),
        (MAP.replace('"g2"', '"g1"').replace('["u1", "u2", "u3"]', '["u1", "u2", "u3"]').replace('"g3"', '"g1"'),
         "row 1, column 'u3' is not finite, but beam 3 is flagged valid"),
    ],
)  # fmt: skip
def test_faults_of_a_map(tmp_path: Path, text: str, message: str, convert: Run) -> None:
    """Named by file, key, row and column."""
    log, columns = tmp_path / "log.csv", tmp_path / "map.toml"
    log.write_text(TABLE)
    columns.write_text(text)
    done = convert(log, "--to", tmp_path / "beams.parquet", "--columns", columns)
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize("name", ["nortek-ascii", "nortek-dvl"])
def test_a_long_log_shows_a_bar(
    tmp_path: Path, name: str, convert: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Bytes read, rate and time left, on the standard error; none for a short log. Text and binary readers report."""
    log, to = tmp_path / "log.bin", tmp_path / "beams.parquet"
    log.write_bytes(seeds.seeds()[name][1] * 3000)
    assert "left" not in convert(log, "--to", to).stderr
    told: list[int] = []
    with progress_to(told.append):
        read_recording(log)
    assert told == sorted(told)
    assert 0 < told[0] < told[-1] < log.stat().st_size
    monkeypatch.setattr("bottomlock.cli.convert.BAR_FROM_BYTES", 1000)
    done = convert(log, "--to", to, "--force")
    assert re.search(r"reading .*(MB|kB).*/s.* left ", done.stderr)
