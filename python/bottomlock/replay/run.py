"""Replays a case: every what-if case, tables and manifest; a repeat gives the same bits."""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import polars as pl

from bottomlock import kernel
from bottomlock.errors import DataError, OutputError
from bottomlock.files.atomic_write import write_parquet
from bottomlock.files.output_folder import is_occupied, locked
from bottomlock.files.overwriting import check_apart, named_in, remove_named
from bottomlock.files.records import read_record, sha256_of, write_record
from bottomlock.files.replay_tables import RECORDED, ReplayTables
from bottomlock.files.versions import library_versions
from bottomlock.kernel import KernelError
from bottomlock.own_method import DEAD_RECKONING
from bottomlock.replay import compare, rerun
from bottomlock.replay.calibration import calibration_table
from bottomlock.replay.case import Case, WhatIf
from bottomlock.replay.findings.attitude_checks import attitude_findings, gyro_fit, start_words
from bottomlock.replay.findings.checks import closure_words
from bottomlock.replay.findings.diagnose import diagnose
from bottomlock.replay.findings.sensors import SensorRow, sensor_rows
from bottomlock.replay.model import kernel_options
from bottomlock.replay.reading import read_streams
from bottomlock.replay.reckon import measured, reckon
from bottomlock.statistics.replay import runs_table

MANIFEST = "manifest.json"
TABLES = ("runs", "samples", "innovations", "pings")
CALIBRATION, CURRENTS = "calibration", "currents"
"""Written where the filter has the states."""
PARTS: Mapping[str, Callable[[Case, str, rerun.Rerun], pl.DataFrame]] = {
    "samples": compare.samples_table, "innovations": compare.innovations_table, "pings": compare.pings_table,
    CALIBRATION: calibration_table, CURRENTS: compare.currents_table, "imu_faults": compare.imu_faults_table,
}  # fmt: skip
"""What is made of the result of each rerun."""
KIND = "replay"
_FILES = tuple(f"{table}.parquet" for table in (*TABLES, "reference", CALIBRATION, CURRENTS))
NAMED = 10
"""Rejected inertial readings that the manifest and the page name."""


def replay_case(
    case: Case,
    *,
    threads: int = 1,
    progress: Callable[[int], None] = lambda _: None,
) -> ReplayTables:
    """Runs every method of a case for every what-if case, and makes the tables.

    Args:
        case: the case.
        threads: number of threads, 0 for one per core; the results do not depend on it.
        progress: called before the first rerun, once all that can be checked has been, and after each, with the
            number of reruns done.

    Raises:
        DataError, ScenarioError: as `read_streams` and `align`.
        KernelError: naming field, row and time.
    """
    started = time.perf_counter()
    rerun.check_files(case)
    streams = read_streams(case)
    prepared = rerun.prepare(case, streams)
    rerun.check_what_ifs(case, prepared)
    progress(0)
    parts: dict[str, list[pl.DataFrame]] = {name: [] for name in PARTS}
    imu_faults: list[str] = []
    sensors: dict[str, list[SensorRow]] = {}
    log = measured(prepared)
    cases = [(RECORDED, None), *((what_if.name, what_if) for what_if in case.what_if)]
    for done, (name, what_if) in enumerate(cases, 1):
        result = _flown(case, prepared, what_if, threads)
        result = replace(result, reckoned=reckon(case, result.prepared, result.valid, log))
        for table, make in PARTS.items():
            parts[table].append(make(case, name, result))
        imu_faults = imu_faults or fault_words(result)
        sensors[name] = sensor_rows(case.replay.filters, result.result, streams.left_out)
        progress(done)
    tables = {name: pl.concat(of) for name, of in parts.items()}
    path = compare.path_table(streams)
    samples, innovations = (tables[name].filter(what_if=RECORDED) for name in ("samples", "innovations"))
    diagnosis = diagnose(case, prepared, samples, innovations, sensors[RECORDED])
    # The filter whose track is told: the one to take, else the first of the case that stands for all.
    filters = case.replay.filters
    told = next(one for one in (diagnosis.answer.method, "tc", *filters) if one in filters)
    reckoned = [DEAD_RECKONING] if (samples["method"] == DEAD_RECKONING).any() else []
    manifest = _manifest(case, prepared, imu_faults) | {
        "threads": threads,
        "wall_time_s": round(time.perf_counter() - started, 3),
        "methods": [*filters, *reckoned],
        "sensors": {name: [asdict(row) for row in rows] for name, rows in sensors.items()},
        "answer": diagnosis.answer.to_json(),
        "findings": [one.to_json() for one in diagnosis.findings],
        "answers": [*start_words(prepared, samples, told), *closure_words(prepared)],
    }
    if streams.water_counts is not None:
        manifest["water_cells"] = streams.water_counts.text()
    runs = runs_table(
        tables["samples"], tables["innovations"], tables["pings"], tables["imu_faults"], path,
        prepared.alignment.time_ns,
    )  # fmt: skip
    return ReplayTables(
        manifest, runs, tables["samples"], tables["innovations"], tables["pings"], path,
        **{name: tables[name] if tables[name].height else None for name in (CALIBRATION, CURRENTS)},
    )  # fmt: skip


def _flown(case: Case, prepared: rerun.PreparedRun, what_if: WhatIf | None, threads: int) -> rerun.Rerun:
    """Every method, and where the filters refuse the log, the cause that shows without them.

    Raises:
        DataError: for a log that they refuse because of a mistake in the case.
        KernelError: for any other that they refuse.
    """
    try:
        return rerun.run_methods(case, prepared, what_if, threads=threads)
    except KernelError as error:
        causes = attitude_findings(case, gyro_fit(case, prepared))
        if not causes:
            raise
        raise DataError(f"{error}. {causes[0].text} {causes[0].evidence} {causes[0].hint}") from error


def fault_words(result: rerun.Rerun) -> list[str]:
    """What the limits of the inertial readings found, a sentence each; of many readings the first are named."""
    start_ns, kernel_result = result.prepared.alignment.time_ns, result.result
    rejected, inflated = kernel_result["rejected_imu"], kernel_result["inflated_imu"]
    words = []
    if rejected["reason"]:
        counts = [f"{count} {name.replace('_', ' ')}" for name, count in kernel_result["imu_faults"].items()]
        words.append(f"imu: readings rejected: {len(rejected['reason'])} ({', '.join(counts[:-1])})")
    for time_ns, reason in zip(rejected["time_ns"][:NAMED], rejected["reason"][:NAMED], strict=True):
        words.append(f"imu: rejected {(time_ns - start_ns) * 1e-9:.3f} s after the start: {reason}")
    if len(inflated["gap_s"]):
        first_s = (inflated["time_ns"][0] - start_ns) * 1e-9
        words.append(
            f"imu: intervals of readings rejected, missing or doubted: {len(inflated['gap_s'])}, the longest "
            f"{inflated['gap_s'].max():.3f} s, the first up to {first_s:.3f} s after the start"
        )
    return words


def _manifest(case: Case, prepared: rerun.PreparedRun, imu_faults: list[str]) -> dict[str, Any]:
    """What was replayed: versions, hashes of every file read, settings, clocks, alignment, what is semi-synthetic."""
    streams = prepared.streams
    return {
        "kind": KIND,
        "status": "complete",
        "version": kernel.kernel_version(),
        "versions": library_versions(),
        "configuration_hash": case.content_hash(),
        "case": case.name,
        "description": case.description,
        "configuration": case.model_dump(mode="json"),
        "options": kernel_options(case, streams.instrument, streams.vehicle_motion).as_dict(),
        "files": file_digests(case),
        "what_if": [
            [RECORDED, "beams as recorded"],
            *([what_if.name, what_if.text()] for what_if in case.what_if),
        ],
        "semi_synthetic": list(case.semi_synthetic),
        "reference_note": "" if case.reference is None else case.reference.note,
        "has_reference": streams.reference is not None,
        "origin": None if streams.origin is None else asdict(streams.origin),
        "alignment": prepared.alignment.sources,
        "clocks": {name: report.to_json() for name, report in streams.clocks.items()},
        "notes": list(streams.notes),
        "imu_faults": imu_faults,
        "beams": streams.instrument.geometry.beams,
    }


def file_digests(case: Case) -> dict[str, dict[str, str]]:
    """Name and SHA-256 of every file that a case reads, by its section.

    Raises:
        DataError: for a file that cannot be read.
    """
    return {name: {"name": path.name, "sha256": sha256_of(path)} for name, path in case.files().items()}


@contextmanager
def open_folder(
    out: Path, configuration: str, *, inputs: Iterable[Path] = (), force: bool = False
) -> Iterator[None]:
    """Holds an output directory: new, empty, or with a replay of the same case, which is overwritten.

    Nothing is changed in a directory that is rejected. With `force` the files of another replay are removed: those
    that its records name.

    Raises:
        OutputError: for a directory with other content, in use, or with a replay of another case without `force`; and
            for one of its files among the `inputs`.
        DataError: for a manifest that is damaged.
    """
    check_apart([out / name for name in (*_FILES, *named_in(out))], inputs)
    _check_owner(out, configuration, force=force)
    with locked(out):
        # Another process may have held it until now.
        if _check_owner(out, configuration, force=force):
            remove_named(out, {*_FILES, *named_in(out)})
        yield


def _check_owner(out: Path, configuration: str, *, force: bool) -> bool:
    """Whether the directory holds a replay of another case, which is to be removed."""
    if not is_occupied(out):
        return False
    try:
        manifest = read_record(out / MANIFEST) if out.is_dir() else None
    except DataError as error:
        raise DataError(error, hint="remove the directory, or choose another one") from error
    if manifest is None or manifest.get("kind") != KIND:
        raise OutputError(
            "is not empty and holds no replay", place=out, expected="a new directory or a replay's"
        )
    other = bool(manifest.get("configuration_hash") != configuration)
    if other and not force:
        raise OutputError(
            "holds a replay of another configuration",
            place=out,
            hint="choose another directory or use --force to start over",
        )
    return other


def write_replay(replayed: ReplayTables, out: str | Path) -> None:
    """Writes the tables and, last, the manifest, which is their record; each file is written atomically.

    Raises:
        OutputError: where the directory cannot be written.
    """
    # Of an interrupted writing a manifest remains that is not complete.
    out = Path(out)
    begun = {key: replayed.manifest[key] for key in ("kind", "configuration_hash")}
    write_record(out / MANIFEST, begun | {"status": "running"}, {})
    tables = {name: getattr(replayed, name) for name in TABLES} | {"reference": replayed.path}
    tables |= {name: getattr(replayed, name) for name in (CALIBRATION, CURRENTS)}
    digests = {
        f"{name}.parquet": write_parquet(out / f"{name}.parquet", table)
        for name, table in tables.items()
        if table is not None
    }
    # Of an earlier replay of the case, which may have had a calibration, currents or a reference.
    remove_named(out, set(_FILES) - digests.keys())
    write_record(out / MANIFEST, replayed.manifest, digests)
