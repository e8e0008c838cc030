"""Interruptions of the hard kind, and directories that somebody has spoilt."""

import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import polars as pl
import pytest

from bottomlock.campaign import partition
from bottomlock.campaign.directory import MANIFEST
from bottomlock.campaign.run import CampaignProgress, run_campaign
from bottomlock.errors import DataError, OutputError
from tests.unit.small_campaign import STEPS_OF_TWO_RUNS, same_bits, short

RUNS = 300
"""A hundred and fifty chunks: some seconds."""

FLY = f"""
import sys
from pathlib import Path
from bottomlock.campaign import partition
from bottomlock.campaign.run import run_campaign
from tests.unit.small_campaign import STEPS_OF_TWO_RUNS, short
partition.CHUNK_STEPS = STEPS_OF_TWO_RUNS
run_campaign([short({RUNS})], Path(sys.argv[1]), threads=1)
"""


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two runs a chunk."""
    monkeypatch.setattr(partition, "CHUNK_STEPS", STEPS_OF_TWO_RUNS)


def finished(out: Path) -> dict[Path, int]:
    """The files of finished chunks, with the time of their writing."""
    counts = out.glob("chunks/straight/counts-*")
    return {
        path: path.stat().st_mtime_ns
        for count in counts
        for path in (count, count.with_name(count.name.replace("counts", "samples")))
    }


ANYWHERE, IN_A_CHUNK = True, False


@pytest.mark.slow
@pytest.mark.parametrize(
    "moments",
    [
        [ANYWHERE, IN_A_CHUNK],
        pytest.param([ANYWHERE] * 2 + [IN_A_CHUNK] * 4, marks=pytest.mark.long),
    ],
    ids=["two", "six"],
)
def test_killed_at_any_moment(tmp_path: Path, root: Path, moments: list[bool]) -> None:
    """SIGKILL at moments nobody chose: no finished chunk is lost or run again; the same bits."""
    out, chance = tmp_path / "killed", random.SystemRandom()
    killed = 0
    for anywhere in moments:
        before = finished(out)
        process = subprocess.Popen([sys.executable, "-c", FLY, str(out)], cwd=root)
        # Anywhere from the start of the process, or in the middle of its chunks, however long the start takes.
        while not anywhere and len(finished(out)) == len(before) and process.poll() is None:
            time.sleep(0.001)
        time.sleep(chance.uniform(0.0, 1.2 if anywhere else 0.2))
        process.send_signal(signal.SIGKILL)
        killed += process.wait() == -signal.SIGKILL
        after = finished(out)
        assert {path: after.get(path) for path in before} == before
    assert killed >= (len(moments) + 1) // 2, "the campaign is too short to be killed"
    before = finished(out)
    assert before
    subprocess.run([sys.executable, "-c", FLY, str(out)], cwd=root, check=True)
    after = finished(out)
    assert {path: after[path] for path in before} == before
    run_campaign([short(RUNS)], tmp_path / "whole", threads=2)
    same_bits(tmp_path / "whole", out)
    assert not [path for path in out.rglob(".*") if path.is_file()], "nothing half-written stays behind"


def test_ended_before_the_manifest_was_there(tmp_path: Path) -> None:
    """All that is left is a manifest that was never finished: the directory is as good as empty."""
    out = tmp_path / "o"
    out.mkdir()
    (out / f".{MANIFEST}.4711.part").write_text("{", encoding="utf-8")
    run_campaign([short()], out, threads=1)
    assert [path.name for path in out.glob(".*")] == []


def test_a_stranger_s_hidden_files_stay(tmp_path: Path) -> None:
    """Nothing is swept up in a directory that is not ours, whatever its files are called."""
    theirs = tmp_path / ".runs.parquet.4711.part"
    theirs.write_text("not ours", encoding="utf-8")
    with pytest.raises(OutputError, match="holds no campaign of ours"):
        run_campaign([short()], tmp_path, threads=1, force=True)
    assert theirs.exists()


def test_what_is_found_is_told_apart(tmp_path: Path) -> None:
    """A bar has to know which runs were there before, or it promises too much."""
    heard: list[CampaignProgress] = []
    run_campaign([short(4)], tmp_path / "o", threads=1)
    (tmp_path / "o" / "chunks" / "straight" / "counts-00000000-00000001.parquet").unlink()
    run_campaign([short(4)], tmp_path / "o", threads=1, progress=heard.append)
    assert heard == [CampaignProgress("straight", 2, 4, 4, found=True), CampaignProgress("straight", 4, 4, 4)]


@pytest.mark.parametrize("which", ["samples", "counts"])
def test_a_missing_file_is_a_missing_chunk(tmp_path: Path, which: str) -> None:
    """It is run again, whichever of its files is gone."""
    run_campaign([short()], tmp_path / "whole", threads=1)
    run_campaign([short()], tmp_path / "o", threads=1)
    (tmp_path / "o" / "chunks" / "straight" / f"{which}-00000002-00000003.parquet").unlink()
    run_campaign([short()], tmp_path / "o", threads=1)
    same_bits(tmp_path / "whole", tmp_path / "o")


@pytest.mark.parametrize("which", ["samples", "counts"])
def test_a_damaged_chunk_is_named(tmp_path: Path, which: str) -> None:
    """The message says which file and what to do, and the tables that were there stay."""
    out = tmp_path / "o"
    run_campaign([short()], out, threads=1)
    path = out / "chunks" / "straight" / f"{which}-00000002-00000003.parquet"
    before = (out / "runs.parquet").read_bytes()
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(DataError, match=rf"{path.name}: cannot be read .* delete the file and run the same"):
        run_campaign([short()], out, threads=1)
    assert (out / "runs.parquet").read_bytes() == before
    path.unlink()
    run_campaign([short()], out, threads=1)
    assert (out / "runs.parquet").read_bytes() == before


def test_a_chunk_of_other_runs_is_named(tmp_path: Path) -> None:
    """A file under another's name is not taken for it."""
    out = tmp_path / "o"
    run_campaign([short()], out, threads=1)
    folder = out / "chunks" / "straight"
    (folder / "samples-00000002-00000003.parquet").replace(folder / "samples-00000000-00000001.parquet")
    with pytest.raises(DataError, match=r"samples-00000000-00000001.parquet: expected the runs 0 to 1"):
        run_campaign([short()], out, threads=1)
    foreign = folder / "samples-00000000-00000001.parquet"
    pl.DataFrame({"a": [1]}).write_parquet(foreign)
    with pytest.raises(DataError, match="column 'trajectory' is missing"):
        run_campaign([short()], out, threads=1)


def test_another_version_and_a_broken_manifest(tmp_path: Path) -> None:
    """Both are rejected, and nothing is written over."""
    out = tmp_path / "o"
    run_campaign([short()], out, threads=1)
    before = (out / "runs.parquet").read_bytes()
    manifest = (out / MANIFEST).read_text(encoding="utf-8")
    (out / MANIFEST).write_text(manifest.replace('"version": "', '"version": "0.'), encoding="utf-8")
    with pytest.raises(OutputError, match=r"holds a campaign of version 0\..* or use --force"):
        run_campaign([short()], out, threads=1)
    (out / MANIFEST).write_text(manifest[:100], encoding="utf-8")
    with pytest.raises(DataError, match=r"manifest.json: cannot be read as JSON"):
        run_campaign([short()], out, threads=1, force=True)
    assert (out / "runs.parquet").read_bytes() == before
