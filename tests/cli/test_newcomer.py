"""The mistakes of a first hour: a table of one's own, a method of the wrong kind, a terminal that is too narrow."""

from pathlib import Path

import polars as pl
import pytest

from bottomlock.audit.logs import read_log
from bottomlock.errors import DataError, ScenarioError
from bottomlock.io.beams import Columns, read_beams
from bottomlock.io.table import read_map
from tests.cli.calls import command, succeeded

OWN = """Time (s),B1,B2,B3,B4,quality
0.0,510,-490,500,-500,80
0.2,520,-480,510,-510,80
0.4,500,-500,490,-490,80
0.6,,-500,490,-490,80
"""


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """Beams in mm/s without flags, under names of one's own."""
    path = tmp_path / "own.csv"
    path.write_text(OWN, encoding="utf-8")
    return path


def test_the_first_message_leads_to_a_table(own: Path, tmp_path: Path) -> None:
    """What convert says of an unknown header is followed to the letter; units and lost beams are right."""
    beams = tmp_path / "beams.parquet"
    refused = command("convert", own, "--to", beams)
    assert f"`bottomlock convert {own} --init --out MAP.toml`" in refused.stderr
    succeeded("convert", own, "--init", "--to", tmp_path / "map.toml")
    done = command("convert", own, "--columns", tmp_path / "map.toml", "--to", beams)
    assert done.returncode == 0, done.stderr
    assert "a beam counts as lost where its cell is empty" in done.stdout
    table = pl.read_parquet(beams)
    assert table["beam1_valid"].to_list() == [True, True, True, False]
    assert table["beam2_mps"].to_list() == [-0.49, -0.48, -0.5, -0.5]


def test_no_flags_and_no_word_of_it(own: Path, tmp_path: Path) -> None:
    """Without flags, and without the map's word that an empty cell is a lost beam, nothing is assumed."""
    names = ("B1", "B2", "B3", "B4")
    columns = Columns(time="Time (s)", time_unit="s", velocity=names, velocity_scale=1e-3)
    for read in (lambda: read_beams(own, beams=4, columns=columns), lambda: read_log(own, columns)):
        with pytest.raises(DataError, match=r"no column says which beams are valid.*lost_when_empty = true"):
            read()
    stated = columns.model_copy(update={"lost_when_empty": True})
    for valid in (read_beams(own, beams=4, columns=stated).valid, read_log(own, stated).valid):
        assert valid.sum(axis=1).tolist() == [4, 4, 4, 3]
    both = tmp_path / "both.toml"
    both.write_text("lost_when_empty = true\nvalid = ['a', 'b']", encoding="utf-8")
    with pytest.raises(ScenarioError, match=r"state one of them"):
        read_map(both)
