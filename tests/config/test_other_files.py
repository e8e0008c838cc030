"""A file of another kind than is expected is named as what it is, with the command that takes it."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import polars as pl
import pytest

import bottomlock
from bottomlock.config import toml_file
from bottomlock.config.packaged import copy_packaged
from bottomlock.config.scenario import packaged_scenarios
from bottomlock.errors import BottomlockError, Note, ScenarioError
from bottomlock.live.config import load_config
from bottomlock.live.templates import template
from bottomlock.plant import load_vehicle
from bottomlock.replay.case import load_case

PACKAGED = Path(bottomlock.__file__).parent / "config"
CASE = Path(__file__).resolve().parents[2] / "data" / "logs" / "survey_dive" / "case.toml"
LOADERS: dict[str, Callable[[Path], Any]] = {
    "scenario": bottomlock.load_scenario,
    "replay case": load_case,
    "live configuration": load_config,
    "DVL geometry": bottomlock.read_geometry,
    "vehicle": load_vehicle,
}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A file of each kind."""
    folder = tmp_path_factory.mktemp("kinds")
    live = folder / "live.toml"
    live.write_text(template("a50", "text"), encoding="utf-8")
    return {
        "scenario": copy_packaged("scenarios", "survey", folder / "mine.toml"),
        "replay case": CASE,
        "live configuration": live,
        "DVL geometry": PACKAGED / "geometries" / "teledyne_20.toml",
        "vehicle": PACKAGED / "vehicles" / "bluerov2_heavy.toml",
    }


@pytest.mark.parametrize("given", LOADERS)
@pytest.mark.parametrize("expected", LOADERS)
def test_every_kind_for_every_other(given: str, expected: str, files: dict[str, Path]) -> None:
    """Each loads as itself, and is named where another is expected."""
    if given == expected:
        assert LOADERS[expected](files[given]) is not None
        return
    with pytest.raises(ScenarioError, match=f"is a {given}, expected a {expected}; .* takes? it"):
        LOADERS[expected](files[given])


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "is a Parquet table, expected a TOML file; `bottomlock fix`"),
        (b"\x00\x01\xff\xfe", "is binary, expected a TOML file; `bottomlock convert`"),
        ("name = 'Straße'".encode("latin-1"), "cannot be read as text in UTF-8 .*position 12"),
        ('name = "a"'.encode("utf-16"), "is text in UTF-16, expected UTF-8"),
        (b"time,vx\n1,2\n", "not valid TOML: .*looks like readings: `bottomlock convert`"),
        (b'{"type": "velocity"}\n', "not valid TOML: .*looks like readings"),
        (b"$PNORBT,1,2\n", "not valid TOML: .*looks like readings"),
        (b"a = [1, 2\nb = 3\n", r"not valid TOML: [^;]*$"),
    ],
)
@pytest.mark.parametrize("load", LOADERS.values(), ids=list(LOADERS))
def test_what_is_no_toml(
    load: Callable[[Path], Any], content: bytes | None, said: str, tmp_path: Path
) -> None:
    """Also under the name of a TOML file; what is TOML with a slip keeps its line alone."""
    file = tmp_path / "given.toml"
    if content is None:
        pl.DataFrame({"time_ns": [1]}).write_parquet(file)
    else:
        file.write_bytes(content)
    with pytest.raises(ScenarioError, match=said):
        load(file)


def test_a_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(BottomlockError, match=r"is a folder, expected a scenario .*bottomlock report"):
        bottomlock.load_scenario(tmp_path)


def test_lines_of_windows_are_lines(tmp_path: Path) -> None:
    """As Python reads text: line ends and the byte order mark are not part of it."""
    file = tmp_path / "a.toml"
    file.write_bytes(b"\xef\xbb\xbfa = 1\r\nb = 2\r\n")
    assert toml_file.read_text(file) == "a = 1\nb = 2\n"


def test_a_packaged_name_beside_a_file_of_that_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The packaged one is taken, as without the file, and that is said once; a list of names says nothing."""
    monkeypatch.chdir(tmp_path)
    alone = bottomlock.load_scenario("straight")
    Path("straight.toml").write_text("edited", encoding="utf-8")
    shutil.copy(PACKAGED / "geometries" / "teledyne_20.toml", tmp_path)
    with pytest.warns(Note, match=r"scenario 'straight' is the packaged one; .* write straight\.toml"):
        assert bottomlock.load_scenario("straight") == alone
    # A second note would be an error here.
    assert bottomlock.load_scenario("straight") == alone
    with pytest.warns(Note, match=r"geometry 'teledyne_20' is the packaged one"):
        bottomlock.read_geometry("teledyne_20")
    assert "straight" in packaged_scenarios()
    bottomlock.read_geometry("teledyne_20.toml")
