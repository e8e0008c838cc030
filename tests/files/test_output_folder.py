"""Who holds an output directory, and what is removed from it."""

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from bottomlock.campaign.run import run_campaign
from bottomlock.errors import DataError, OutputError
from bottomlock.files import atomic_write
from bottomlock.files.output_folder import LOCK, is_occupied, locked
from bottomlock.files.overwriting import Result, remove_named
from bottomlock.files.records import read_record, write_record
from tests.campaign.small_campaign import short

HOLD = """
import sys, time
from pathlib import Path
from bottomlock.files.output_folder import locked
with locked(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


def holder(out: Path) -> subprocess.Popen[str]:
    """A process that holds a directory."""
    process = subprocess.Popen([sys.executable, "-c", HOLD, str(out)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    return process


def test_two_processes_on_one_directory(tmp_path: Path) -> None:
    """The second gets an error; when the first is killed, the next one goes on."""
    out = tmp_path / "o"
    run_campaign([short(2)], out, threads=1)
    process = holder(out)
    try:
        before = {path: path.stat().st_mtime_ns for path in out.rglob("*") if path.is_file()}
        for force in (False, True):
            with pytest.raises(OutputError, match=r"o: is in use by another process; wait until it ends"):
                run_campaign([short(2)], out, threads=1, force=force)
        assert {path: path.stat().st_mtime_ns for path in out.rglob("*") if path.is_file()} == before
    finally:
        process.send_signal(signal.SIGKILL)
        process.communicate()
    run_campaign([short(2)], out, threads=1)
    assert not (out / LOCK).exists()


def test_one_thread_may_hold_it_twice_and_two_may_not(tmp_path: Path) -> None:
    refused: list[str] = []

    def other() -> None:
        try:
            with locked(tmp_path):
                pass
        except OutputError as error:
            refused.append(str(error))

    with locked(tmp_path), locked(tmp_path / "." / "x" / ".."):
        thread = threading.Thread(target=other)
        thread.start()
        thread.join()
    assert len(refused) == 1
    assert "is in use by another process" in refused[0]
    with locked(tmp_path):
        pass


def test_a_directory_that_stays_empty_goes_again(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), locked(tmp_path / "a" / "b"):
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []
    with locked(tmp_path / "a" / "b"):
        (tmp_path / "a" / "b" / "table").touch()
    assert (tmp_path / "a" / "b" / "table").exists()


def test_a_lock_that_is_a_link_is_not_written_through(tmp_path: Path) -> None:
    thesis = tmp_path / "thesis.tex"
    thesis.write_text("years of work")
    (tmp_path / "o").mkdir()
    (tmp_path / "o" / LOCK).symlink_to(thesis)
    assert is_occupied(tmp_path / "o")
    with pytest.raises(OutputError, match="cannot be written"), locked(tmp_path / "o"):
        pass
    assert thesis.read_text() == "years of work"


def test_all_parts_are_removed_or_none(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "x").touch()
    (tmp_path / "b").symlink_to(tmp_path / "a")
    with pytest.raises(OutputError, match="b: is a symbolic link"):
        remove_named(tmp_path, ["a", "b"])
    assert (tmp_path / "a" / "x").exists()
    with pytest.raises(OutputError, match="b: is a symbolic link"):
        remove_named(tmp_path, ["a/x", "b/x"])
    assert (tmp_path / "a" / "x").exists()
    (tmp_path / "b").unlink()
    remove_named(tmp_path, ["a/x", "b/x"])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["../thesis", "a/../../thesis", "{absolute}", ""])
def test_a_name_in_a_record_leads_nowhere_else(tmp_path: Path, name: str) -> None:
    """A record that came with a folder of others names what it likes."""
    thesis = tmp_path / "thesis"
    thesis.touch()
    (tmp_path / "o" / "a").mkdir(parents=True)
    with pytest.raises(OutputError, match="which is no file below its folder; nothing was changed"):
        remove_named(tmp_path / "o", [name.format(absolute=thesis)])
    assert thesis.exists()


def test_a_file_is_replaced_and_never_changed_in_place(tmp_path: Path) -> None:
    """Who has the old file open, or has linked it, keeps the old content: it is renamed over, not copied into."""
    table, link = tmp_path / "table", tmp_path / "link"
    atomic_write.write_bytes(table, b"old")
    link.hardlink_to(table)
    with table.open("rb") as held:
        atomic_write.write_bytes(table, b"new content")
        assert held.read() == b"old"
    assert (table.read_bytes(), link.read_bytes()) == (b"new content", b"old")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link", "table"]


def test_a_file_is_on_the_disk_before_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """First the content is forced to the disk, then it is renamed, then the folder is forced to the disk."""
    steps: list[str] = []
    fsync, replace = os.fsync, Path.replace

    def flush(handle: int) -> None:
        steps.append("folder" if Path(f"/proc/self/fd/{handle}").resolve().is_dir() else "file")
        fsync(handle)

    def rename(path: Path, target: Path) -> Path:
        steps.append("rename")
        return replace(path, target)

    monkeypatch.setattr(os, "fsync", flush)
    monkeypatch.setattr(Path, "replace", rename)
    atomic_write.write_bytes(tmp_path / "table", b"content")
    assert steps == ["file", "rename", "folder"]
    steps.clear()
    atomic_write.write_bytes(tmp_path / "a" / "b" / "table", b"content")
    assert steps == ["folder", "folder", "file", "rename", "folder"]


def test_a_result_whose_record_is_of_others(tmp_path: Path) -> None:
    """One that names a file elsewhere changes nothing, one that is damaged says what to do, a cut result goes on."""
    thesis = tmp_path / "thesis"
    thesis.write_text("years of work", encoding="utf-8")
    result = Result(tmp_path / "o", "audit", "audit", {"log": "a"})
    result.write({"a.txt": "ours"})
    record = read_record(result.record)
    assert record is not None
    write_record(result.record, record, {"../thesis": "0" * 64})
    with pytest.raises(OutputError, match=r"names '../thesis', which is no file below its folder"):
        result.write({"b.txt": "ours"}, force=True)
    assert thesis.exists()
    assert sorted(path.name for path in result.out.iterdir()) == ["a.txt", "audit.record.json"]
    result.record.write_text("{", encoding="utf-8")
    with pytest.raises(DataError, match="remove it and the files of that result"):
        result.check(force=True)
    write_record(result.record, record | {"status": "running"}, {"a.txt": "0" * 64, "b.txt": "1" * 64})
    assert result.write({"b.txt": "ours"}) == [result.out / "b.txt"]
    assert sorted(path.name for path in result.out.iterdir()) == ["audit.record.json", "b.txt"]
