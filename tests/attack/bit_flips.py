"""Flips single bits in every kind of file that is read back, and demands an error of one line or the same tables.

`attack(seed, count)` flips `count` bits in each kind of directory, one at a time, and returns a line per fault.
"""

from __future__ import annotations

import hashlib
import io
import os
import random
import shutil
import signal
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from unittest.mock import patch

import polars as pl

from bottomlock.audit.logs import read_log
from bottomlock.campaign import chunk
from bottomlock.campaign.run import Results, run_campaign
from bottomlock.errors import BottomlockError, Note
from bottomlock.files.records import DIGESTS, OWN_DIGEST
from bottomlock.io.beam_table import read_beam_table, write_recording
from bottomlock.io.formats import read_recording
from bottomlock.plant import fly, load_vehicle, straight
from bottomlock.replay.report import read_replay
from bottomlock.replay.run import KIND, TABLES, ReplayResult, write_replay
from bottomlock.tables.results import read_campaign_tables, read_samples
from tests.campaign.small_campaign import STEPS_OF_TWO_RUNS, short

LIMIT_S = 60
"""A reader that takes longer hangs; resuming runs chunks again, on a machine that may be busy."""

RUNS = 3


@dataclass(frozen=True)
class Kind:
    """A kind of directory: how it is made, and what is read from it (one digest of all that it says)."""

    make: Callable[[Path], object]
    read: Callable[[Path], str]


def _digest(*frames: pl.DataFrame) -> str:
    """SHA-256 of tables: columns, types and every value."""
    digest = hashlib.sha256()
    for frame in frames:
        content = io.BytesIO()
        frame.write_ipc(content)
        digest.update(content.getvalue())
    return digest.hexdigest()


def _results(results: Results, out: Path) -> str:
    """What a campaign returns, and what it leaves on the disk."""
    files = sorted([*out.glob("*.parquet"), *out.glob("chunks/*/*")])
    on_disk = hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()
    return _digest(results.runs, results.ensemble, results.consistency) + on_disk


def _campaign(folder: Path) -> Results:
    return run_campaign([short(RUNS)], folder, threads=1)


def _resume(folder: Path) -> str:
    return _results(_campaign(folder), folder)


def _report(folder: Path) -> str:
    tables = read_campaign_tables(folder)
    samples = [frame for frame, _ in read_samples(tables, "straight")]
    others = [table for table in (tables.paths, tables.choices) if table is not None]
    stated = pl.DataFrame({"manifest": [repr(sorted(tables.manifest.items()))]})
    return _digest(tables.runs, tables.ensemble, tables.consistency, stated, *others, *samples)


def _part() -> pl.DataFrame:
    return pl.DataFrame({"run": range(20), "error_m": [0.1 * k for k in range(20)]})


def _truth(folder: Path) -> str:
    with patch.dict(os.environ, {"BOTTOMLOCK_CACHE": str(folder)}):
        flight = fly(load_vehicle("tauv"), straight(duration_s=1.0), latitude_rad=0.57, gravity_mps2=9.795)
    arrays = flight.truth.kernel_arrays().values()
    return hashlib.sha256(b"".join(values.tobytes() for values in arrays)).hexdigest()


def _write_replay(folder: Path) -> None:
    frames = {name: _part().with_columns(table=pl.lit(name)) for name in (*TABLES, "path")}
    manifest = {"kind": KIND, "status": "complete", "configuration_hash": "a" * 64, "wall_time_s": 1.5}
    write_replay(ReplayResult(**frames, manifest=manifest), folder)


def _replay(folder: Path) -> str:
    tables = read_replay(folder)
    stated = pl.DataFrame({"manifest": [repr(sorted(tables.manifest.items()))]})
    frames = [getattr(tables, name) for name in (*TABLES, "path")]
    return _digest(stated, *frames)


def _convert(folder: Path) -> None:
    log = folder / "log.csv"
    rows = [f"{10**9 * k},{0.1 * k},1" for k in range(20)]
    log.write_text("\n".join(["time_ns,beam1_mps,beam1_valid", *rows]), encoding="utf-8")
    write_recording(read_recording(log), folder / "log.parquet", source=log)
    log.unlink()


def _converted(folder: Path) -> str:
    """What fix and replay read, and what an audit reads."""
    log = read_log(folder / "log.parquet")
    account = {key: value for key, value in log.beside.items() if key not in {DIGESTS, OWN_DIGEST}}
    stated = pl.DataFrame({"account": [repr(sorted(account.items()))]})
    return _digest(read_beam_table(folder / "log.parquet").to_frame(), stated, pl.DataFrame(log.velocity_mps))


KINDS: Mapping[str, Kind] = {
    "resumed campaign": Kind(_campaign, _resume),
    "campaign to report": Kind(_campaign, _report),
    "truth cache": Kind(_truth, _truth),
    "replay": Kind(_write_replay, _replay),
    "converted log": Kind(_convert, _converted),
}


def attack(seed: int, count: int, kinds: Mapping[str, Kind] = KINDS) -> list[str]:
    """Flips `count` single bits in files of each kind, one at a time.

    Returns:
        A line per fault: tables that differ without an error, any exception but an error of one line, a hang.
    """
    rng = random.Random(seed)
    faults: list[str] = []
    with tempfile.TemporaryDirectory() as folder, _quiet():
        for name, kind in kinds.items():
            whole = Path(folder) / "whole" / name
            whole.mkdir(parents=True)
            kind.make(whole)
            expected = _of_copy(kind, whole, Path(folder) / "copy")[0]
            files = sorted(path for path in whole.rglob("*") if path.is_file())
            for _ in range(count):
                path = rng.choice(files)
                bit = rng.randrange(8 * path.stat().st_size)
                place = f"{name}: bit {bit} of {path.relative_to(whole)}"
                found, fault = _of_copy(kind, whole, Path(folder) / "copy", (path, bit))
                if fault:
                    faults.append(f"{place}: {fault}")
                elif found not in {expected, None}:
                    faults.append(f"{place}: other tables, without an error")
    return faults


def _of_copy(
    kind: Kind, whole: Path, copy: Path, flip: tuple[Path, int] | None = None
) -> tuple[str | None, str | None]:
    """What is read from a copy with a bit flipped, None for an error of one line; and the fault, if there is one."""
    shutil.copytree(whole, copy)
    try:
        if flip is not None:
            path, bit = copy / flip[0].relative_to(whole), flip[1]
            content = bytearray(path.read_bytes())
            content[bit // 8] ^= 1 << bit % 8
            path.write_bytes(content)
        with _limited():
            return kind.read(copy), None
    except BottomlockError as error:
        words = str(error)
        return None, f"an error of several lines: {words}" if "\n" in words else None
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        return None, f"{type(error).__name__}: {error}"
    finally:
        shutil.rmtree(copy)


@contextmanager
def _quiet() -> Iterator[None]:
    """Chunks of two runs; notes, which are allowed, are not printed."""
    with patch.object(chunk, "CHUNK_STEPS", STEPS_OF_TWO_RUNS), warnings.catch_warnings():
        warnings.simplefilter("ignore", Note)
        yield


@contextmanager
def _limited() -> Iterator[None]:
    def stop(_signal: int, _frame: FrameType | None) -> None:
        raise TimeoutError(f"no end after {LIMIT_S} s")

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(LIMIT_S)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
