"""What a command writes over: nothing unasked, nothing that it reads, and with --force what is of ours alone."""

import os
import shutil
from pathlib import Path

import polars as pl
import pytest

from bottomlock.errors import OutputError
from bottomlock.replay.init.entries import Beside, Entry, placed
from tests.audit.synthetic import make_log, table
from tests.cli.calls import command, refused, shortened, succeeded
from tests.live.world import text_of

RUN = ("run", "straight.toml", "--methods", "lc,tc", "--threads", "1", "--out", "o")


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two logs and a geometry file."""
    folder = tmp_path_factory.mktemp("logs")
    for seed, name in ((1, "a"), (2, "b")):
        table(make_log(seed)).write_parquet(folder / f"{name}.parquet")
    (folder / "dvl.toml").write_text("beams = 4\ntilt_deg = 22.0\n", encoding="utf-8")
    return folder


@pytest.fixture
def here(logs: Path, tmp_path: Path) -> Path:
    """A folder of one's own with the logs."""
    return Path(shutil.copytree(logs, tmp_path / "here"))


def contents(folder: Path) -> dict[str, bytes]:
    """Every file below a folder."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


FIX = ("fix", "a.parquet", "--geometry", "x_janus_20", "--method", "lc", "--out")
LEAVE_OUT = ("fix", "a.parquet", "--geometry", "x_janus_20", "--leave-out", "1", "--out")


@pytest.mark.parametrize("words", [FIX, LEAVE_OUT], ids=["fix", "leave_out"])
def test_a_file_is_replaced_with_force_alone(here: Path, words: tuple[str, ...]) -> None:
    (here / "f.parquet").write_bytes(b"years of work")
    said = refused(*words, "f.parquet", cwd=here)
    assert said == (
        "bottomlock: f.parquet: is there already; choose another name, or use --force to replace it\n"
    )
    assert (here / "f.parquet").read_bytes() == b"years of work"
    succeeded(*words, "f.parquet", "--force", cwd=here)
    assert pl.read_parquet(here / "f.parquet").height > 0


def test_the_log_is_never_written_over(here: Path) -> None:
    """By whatever name, and not even with --force."""
    (here / "link.parquet").symlink_to("a.parquet")
    os.link(here / "a.parquet", here / "hard.parquet")
    before = contents(here)
    for words, out in ((FIX, "link.parquet"), (LEAVE_OUT, "hard.parquet")):
        said = refused(*words, out, "--force", cwd=here)
        assert said.startswith(f"bottomlock: {out}: is read by this command (a.parquet)")
        assert contents(here) == before


@pytest.mark.parametrize(
    ("words", "file"),
    [
        (("audit", "a.parquet", "--geometry", "dvl.toml", "--out", "o", "--write", "dvl.toml"), "dvl.toml"),
        (("convert", "--init", "map.toml", "--to", "map.toml"), "map.toml"),
        (("convert", "raw.json", "--to", "raw.parquet"), "raw.json"),
        (("convert", "a.parquet", "--to", "a.parquet"), "a.parquet"),
        (("simulate-dvl", "a.parquet", "--geometry", "dvl.toml", "--truth", "a.parquet"), "a.parquet"),
        (("simulate-dvl", "a.parquet", "--geometry", "dvl.toml", "--dvl", "file:dvl.toml"), "dvl.toml"),
    ],
)
def test_no_command_writes_over_what_it_reads(here: Path, words: tuple[str, ...], file: str) -> None:
    for name in ("map.toml", "raw.json"):
        (here / name).write_text("{}", encoding="utf-8")
    before = contents(here)
    said = refused(*words, "--force", cwd=here)
    assert said.startswith(f"bottomlock: {file}: is ")
    assert contents(here) == before


def test_a_first_case_leaves_the_log_that_has_the_name_of_its_table(here: Path) -> None:
    (here / "case_beams.parquet").symlink_to("a.parquet")
    beams = Entry("dvl.file", Beside("beams", Path.touch))
    with pytest.raises(OutputError, match=r"case_beams\.parquet: is read by this command"):
        placed([beams], here / "case.toml", [here / "a.parquet"], force=True)


@pytest.mark.parametrize(
    ("to", "checkpoint"),
    [("file:link.toml", "last"), ("udpout:127.0.0.1:9", "live.toml")],
    ids=["port", "checkpoint"],
)
def test_live_does_not_write_over_its_configuration(tmp_path: Path, to: str, checkpoint: str) -> None:
    """A port that appends to it through a link, and a checkpoint that would replace it every second."""
    known = text_of("navigation", to=to).replace("probe", "sentence")
    text = f'{known}[checkpoint]\nfile = "{checkpoint}"\n'
    (tmp_path / "live.toml").write_text(text, encoding="utf-8")
    (tmp_path / "link.toml").symlink_to("live.toml")
    said = refused("live", "live.toml", cwd=tmp_path)
    assert "toml: is read by this command (live.toml); choose another name" in said
    assert (tmp_path / "live.toml").read_text(encoding="utf-8") == text


def test_a_log_in_json_needs_a_table_of_another_name(here: Path) -> None:
    """The account of `dive.parquet` would be `dive.json`: said at once, without advice that destroys the log."""
    (here / "dive.json").write_text('{"type": "velocity"}\n', encoding="utf-8")
    done = command("convert", "dive.json", "--to", "dive.parquet", cwd=here)
    assert done.returncode == 2
    assert done.stderr == (
        "bottomlock: dive.json: is the log, and the account of dive.parquet has the same name; choose another name for "
        "--out, such as dive_beams.parquet\n"
    )


AUDIT = ("--geometry", "x_janus_20", "--out", "o")


@pytest.mark.first_cases(1)
@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(
    ("first", "second"),
    [
        (("audit", "a.parquet", *AUDIT), ("audit", "b.parquet", *AUDIT)),
        (("fly", "short.toml", "--out", "o"), ("fly", "short.toml", "--sensors", "1", "--out", "o")),
        (("observe", "short.toml", "--out", "o"), ("observe", "other.toml", "--out", "o")),
    ],
    ids=["audit", "fly", "observe"],
)
def test_a_folder_holds_one_result(here: Path, first: tuple[str, ...], second: tuple[str, ...]) -> None:
    """The same again is the same; another one, or one that was changed, needs --force; what is not of ours stays."""
    shortened("straight", here / "short.toml")
    shortened("straight", here / "other.toml", 21.0)
    (here / "o").mkdir()
    (here / "o" / "thesis.tex").write_text("years of work", encoding="utf-8")
    for force in ((), ("--force",)):
        done = command(*first, *force, cwd=here)
        assert done.returncode == 2
        assert done.stderr.startswith(
            f"bottomlock: o: is not empty and holds no result of `bottomlock {first[0]}`"
        )
        assert "--force" in done.stderr
        assert [one.name for one in (here / "o").iterdir()] == ["thesis.tex"]
    (here / "o" / "thesis.tex").unlink()
    for _ in range(2):
        succeeded(*first, cwd=here)
    (here / "o" / "thesis.tex").write_text("years of work", encoding="utf-8")
    before = contents(here / "o")
    said = refused(*second, cwd=here)
    assert said.startswith(f"bottomlock: o: holds a result of `bottomlock {first[0]}` that differs in: ")
    assert said.endswith("use --force to replace it\n")
    assert contents(here / "o") == before
    pages = ("audit.html", "straight_truth.parquet", "observability.parquet")
    (edited,) = (here / "o" / name for name in pages if (here / "o" / name).exists())
    edited.write_bytes(b"with my remarks")
    done = command(*first, cwd=here)
    assert done.returncode == 2
    assert done.stderr.startswith(f"bottomlock: o/{edited.name}: has changed since it was written")
    succeeded(*second, "--force", cwd=here)
    assert (here / "o" / "thesis.tex").read_text(encoding="utf-8") == "years of work"
    assert not (here / "o" / edited.name).exists() or edited.read_bytes() != b"with my remarks"


@pytest.mark.first_cases(1)
@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(
    "changed", [("--runs", "3"), ("--runs", "2", "--seed", "5", "--force")], ids=["resume", "force"]
)
def test_a_report_does_not_outlive_its_tables(tmp_path: Path, changed: tuple[str, ...]) -> None:
    """The same run again keeps it; other tables remove it with its figures, with a note, and the rest stays."""
    shortened("straight", tmp_path / "straight.toml")
    succeeded(*RUN, "--runs", "2", cwd=tmp_path)
    out = tmp_path / "o"
    plain = contents(out).keys()
    succeeded("report", "o", cwd=tmp_path)
    assert len(list((out / "figures").iterdir())) > 4
    page = (out / "report.html").read_bytes()
    succeeded(*RUN, "--runs", "2", cwd=tmp_path)
    assert (out / "report.html").read_bytes() == page
    (out / "figures" / "mine.png").touch()
    done = command(*RUN, *changed, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert not (out / "report.html").exists()
    assert [one.name for one in (out / "figures").iterdir()] == ["mine.png"]
    (out / "figures" / "mine.png").unlink()
    if "--force" not in changed:
        assert "bottomlock: note: o: its report was made from other tables and is removed\n" in done.stderr
        assert contents(out).keys() - {"figures"} >= plain


def test_a_campaign_does_not_remove_its_own_path(root: Path, tmp_path: Path) -> None:
    """A trajectory from a file of the name of a table that the run with --force is about to replace."""
    shortened("straight", tmp_path / "straight.toml")
    succeeded(*RUN, "--runs", "2", cwd=tmp_path)
    example = root / "examples" / "own_trajectory"
    text = (example / "scenario.toml").read_text(encoding="utf-8")
    assert "nav.csv" in text
    (tmp_path / "s.toml").write_text(text.replace("nav.csv", "link.csv"), encoding="utf-8")
    shutil.copy(example / "nav.csv", tmp_path / "o" / "truth.parquet")
    (tmp_path / "link.csv").symlink_to("o/truth.parquet")
    before = contents(tmp_path / "o")
    said = refused("run", "s.toml", "--out", "o", "--force", cwd=tmp_path)
    assert said.startswith("bottomlock: o/truth.parquet: is read by this command (link.csv)")
    assert contents(tmp_path / "o") == before
