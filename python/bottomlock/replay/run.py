"""Replays a case: every question and draw, tables, manifest; nothing half-written, the same bits on repeat."""

import hashlib
import shutil
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import polars as pl

from bottomlock import kernel
from bottomlock.atomic_write import read_json, write_json, write_parquet
from bottomlock.errors import DataError, OutputError
from bottomlock.replay import compare, rerun
from bottomlock.replay.case import Case
from bottomlock.replay.clock import ClockReport
from bottomlock.replay.dive import Dive
from bottomlock.replay.model import kernel_options
from bottomlock.replay.reading import read_dive
from bottomlock.statistics.replay import ensemble_table, runs_table
from bottomlock.tables.replay import RECORDED
from bottomlock.tables.versions import library_versions

MANIFEST = "manifest.json"
TABLES = ("runs", "ensemble", "samples", "innovations", "pings")
KIND = "replay"


@dataclass(frozen=True, eq=False)
class Replayed:
    """What a replay yields: its tables and its manifest."""

    runs: pl.DataFrame
    ensemble: pl.DataFrame
    samples: pl.DataFrame
    innovations: pl.DataFrame
    pings: pl.DataFrame
    path: pl.DataFrame | None
    manifest: dict[str, Any]


def draws_of(case: Case) -> int:
    """How many draws a case is flown with: one where nothing is drawn."""
    return case.replay.runs if case.drawn else 1


def replay_case(
    case: Case, *, threads: int = 1, tell: Callable[[int], None] = lambda _: None, dive: Dive | None = None
) -> Replayed:
    """Every method of a case, for every question and draw, with the tables that come of it.

    Args:
        case: the case.
        threads: for the methods of a flight; 0 for as many as there are cores. The bits do not depend on it.
        tell: hears the number of flights done.
        dive: the recording of the case, where it has been read already.

    Raises:
        DataError, ScenarioError: as `read_dive` and `align`.
        KernelError: naming field, row and time.
    """
    started = time.perf_counter()
    dive = read_dive(case) if dive is None else dive
    residuals = rerun.noise_residuals(case)
    parts: dict[str, list[pl.DataFrame]] = {name: [] for name in ("samples", "innovations", "pings")}
    alignments: list[dict[str, str]] = []
    start_ns, done = 0, 0
    for run in range(draws_of(case)):
        prepared = rerun.prepare(case, dive, run, residuals)
        alignments.append(prepared.alignment.words)
        start_ns = prepared.alignment.time_ns
        for name, asked in [(RECORDED, None), *((asked.name, asked) for asked in case.what_if)]:
            flown = rerun.fly(case, prepared, asked, threads=threads)
            parts["samples"].append(compare.samples_table(case, name, flown))
            parts["innovations"].append(compare.innovations_table(case, name, flown))
            parts["pings"].append(compare.pings_table(case, name, flown))
            done += 1
            tell(done)
    tables = {name: pl.concat(frames) for name, frames in parts.items()}
    path = compare.path_table(dive)
    return Replayed(
        runs=runs_table(tables["samples"], tables["innovations"], tables["pings"], path, start_ns),
        ensemble=ensemble_table(tables["samples"], start_ns),
        path=path,
        manifest=describe(case, dive, alignments, threads=threads, wall_s=time.perf_counter() - started),
        **tables,
    )


def describe(
    case: Case, dive: Dive, alignments: list[dict[str, str]], *, threads: int, wall_s: float
) -> dict[str, Any]:
    """The manifest: versions, hashes of every file read, settings, clocks, the start, and what is not as measured."""
    return {
        "kind": KIND,
        "status": "complete",
        "version": kernel.kernel_version(),
        "versions": library_versions(),
        "configuration_hash": case.content_hash(),
        "case": case.name,
        "description": case.description,
        "configuration": case.model_dump(mode="json"),
        "options": kernel_options(case),
        "files": {name: {"name": path.name, "sha256": _sha256(path)} for name, path in case.files().items()},
        "threads": threads,
        "wall_time_s": round(wall_s, 3),
        "runs": draws_of(case),
        "methods": list(case.replay.methods),
        "what_if": [
            [RECORDED, "nothing taken away"],
            *([asked.name, asked.words()] for asked in case.what_if),
        ],
        "semi_synthetic": list(case.semi_synthetic),
        "reference_note": "" if case.reference is None else case.reference.note,
        "has_reference": dive.reference is not None,
        "origin": None if dive.origin is None else asdict(dive.origin),
        "alignment": alignments[0],
        "clocks": {name: _clock(report) for name, report in dive.clocks.items()},
        "notes": list(dive.notes),
        "beams": dive.instrument.geometry.beams,
    }


def _clock(report: ClockReport) -> dict[str, Any]:
    words = {key: getattr(report, key).words for key in ("repeats", "backward", "gaps", "jumps", "empty")}
    numbers = {
        key: getattr(report, key)
        for key in ("rows", "kept", "first_s", "last_s", "median_step_s", "strays_s", "gap_s")
    }
    return numbers | words


def _sha256(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror})") from error


def prepare_folder(out: Path, configuration: str, *, force: bool = False) -> None:
    """Makes sure that a directory is ours: new, empty, or a replay's of the same case, which is then made anew.

    With `force` another replay's files are removed.

    Raises:
        OutputError: for anything else in its place.
    """
    if not out.exists() or (out.is_dir() and not any(out.iterdir())):
        return
    manifest = read_json(out / MANIFEST) if out.is_dir() else None
    if manifest is None or manifest.get("kind") != KIND:
        raise OutputError(f"{out}: is not empty and holds no replay of ours; choose another directory")
    if manifest.get("configuration_hash") != configuration:
        if not force:
            raise OutputError(
                f"{out}: holds a replay of another configuration; choose another directory or use --force to start over"
            )
        shutil.rmtree(out / "figures", ignore_errors=True)
        for name in (*(f"{table}.parquet" for table in TABLES), "reference.parquet", "report.html", MANIFEST):
            (out / name).unlink(missing_ok=True)


def write_replay(replayed: Replayed, out: Path) -> None:
    """The tables and, last, the manifest; each whole or not at all.

    Raises:
        OutputError: where the directory cannot be written.
    """
    for name in TABLES:
        write_parquet(out / f"{name}.parquet", getattr(replayed, name))
    if replayed.path is not None:
        write_parquet(out / "reference.parquet", replayed.path)
    write_json(out / MANIFEST, replayed.manifest)
