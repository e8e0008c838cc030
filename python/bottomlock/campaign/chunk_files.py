"""The files of a chunk: samples, choices, counts and, last, the record that makes the chunk finished."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from bottomlock.campaign.chunk import ChunkResult
from bottomlock.campaign.partition import Chunk, Partition
from bottomlock.errors import DataError, note
from bottomlock.files.atomic_write import link_or_copy, write_parquet
from bottomlock.files.records import (
    MissingFileError,
    read_record,
    read_recorded,
    read_recorded_table,
    write_record,
)
from bottomlock.tables.campaign import CHOICES, OUTCOMES, SAMPLES
from bottomlock.tables.check import check
from bottomlock.tables.versions import check_identity

Identity = Mapping[str, Any]
"""What decides the numbers of a campaign: `configuration_hash`, and `versions` (`tables.versions.bit_versions`)."""

RUN_AGAIN = "the chunk is run again"


def _paths(out: Path, chunk: Chunk) -> tuple[Path, Path, Path]:
    """The files of samples, choices and counts."""
    folder, ending = out / "chunks" / chunk.scenario, chunk.file_ending
    return folder / f"samples-{ending}", folder / f"choices-{ending}", folder / f"counts-{ending}"


def record_path(out: Path, chunk: Chunk) -> Path:
    """The file of a chunk's record."""
    return out / "chunks" / chunk.scenario / f"record-{Path(chunk.file_ending).stem}.json"


def write_chunk(out: Path, chunk: Chunk, result: ChunkResult, identity: Identity) -> None:
    """Writes the tables of a chunk, each whole or not at all, then its record.

    The files of another directory, which `read_chunk` has checked, are linked or copied.

    Raises:
        OutputError: where they cannot be written.
    """
    paths = _paths(out, chunk)
    if result.directory is not None:
        for old, new in zip(_paths(result.directory, chunk), paths, strict=True):
            link_or_copy(old, new)
        link_or_copy(record_path(result.directory, chunk), record_path(out, chunk))
        return
    tables = (result.samples, result.choices, result.counts)
    digests = {
        path.name: write_parquet(path, table, compressed=True)
        for path, table in zip(paths, tables, strict=True)
    }
    write_record(record_path(out, chunk), {**identity, "chunk": asdict(chunk)}, digests)


def is_finished(out: Path, chunk: Chunk, identity: Identity) -> bool:
    """Whether a chunk is there, whole, and of this campaign; where it is there but not so, a note says why."""
    try:
        return check_files(out, chunk, identity, remedy=RUN_AGAIN)
    except DataError as error:
        note(str(error))
        return False


def check_files(directory: Path, chunk: Chunk, identity: Identity, *, remedy: str) -> bool:
    """Checks the files of a chunk against its record, and the record against the campaign.

    Returns:
        Whether the chunk is finished: False where its record or a file is missing.

    Raises:
        DataError: for a record or a file that has changed since it was written, or is of another campaign.
    """
    record = _record(directory, chunk, identity, remedy=remedy)
    if record is None:
        return False
    try:
        for path in _paths(directory, chunk):
            read_recorded(path, record, remedy=remedy)
    except MissingFileError:
        return False
    return True


def _record(directory: Path, chunk: Chunk, identity: Identity, *, remedy: str) -> dict[str, Any] | None:
    path = record_path(directory, chunk)
    try:
        record = read_record(path)
    except DataError as error:
        raise DataError(f"{error}; {remedy}") from error
    if record is None:
        return None
    check_identity(path, record, identity, remedy=remedy)
    if record.get("chunk") != asdict(chunk):
        raise DataError(f"{path}: is of other runs than its name says; {remedy}")
    return record


def read_chunk(directory: Path, chunk: Chunk, partition: Partition, identity: Identity) -> ChunkResult:
    """The tables of a finished chunk, the samples ordered by run, method and time.

    Raises:
        DataError: for a file that is missing or has changed, and for tables that are not of these runs and methods.
    """
    remedy = "run the same command again"
    record = _record(directory, chunk, identity, remedy=remedy)
    if record is None:
        raise DataError(f"{record_path(directory, chunk)}: is missing; {remedy}")
    tables = [
        check(read_recorded_table(path, record, remedy=remedy), columns, place=str(path))
        for path, columns in zip(_paths(directory, chunk), (SAMPLES, CHOICES, OUTCOMES), strict=True)
    ]
    samples, choices, counts = tables
    _check_content(directory, chunk, partition.methods, samples, choices, counts)
    return ChunkResult(samples=samples, choices=choices, counts=counts, directory=directory)


def _check_content(
    directory: Path,
    chunk: Chunk,
    methods: Sequence[str],
    samples: pl.DataFrame,
    choices: pl.DataFrame,
    counts: pl.DataFrame,
) -> None:
    """The tables are of the chunk's trajectory, runs and methods, in order.

    Raises:
        DataError: naming the file.
    """
    samples_path, choices_path, counts_path = _paths(directory, chunk)
    rows = chunk.runs * len(methods)
    per_method, left = divmod(samples.height, rows)
    for path, table, each in ((samples_path, samples, per_method), (counts_path, counts, 1)):
        runs = np.repeat(np.arange(chunk.first_run, chunk.first_run + chunk.runs), len(methods) * each)
        names = pl.Series(list(methods) * chunk.runs).gather(np.repeat(np.arange(rows), each))
        if (
            left
            or table.height != rows * each
            or not each
            or not np.array_equal(table["run"].to_numpy(), runs)
            or not table["method"].equals(names)
            or not (table["trajectory"] == chunk.scenario).all()
        ):
            raise DataError(
                f"{path}: expected the runs {chunk.first_run} to {chunk.first_run + chunk.runs - 1} of "
                f"{chunk.scenario}, each with the methods {', '.join(methods)}"
            )
    times = samples["time_ns"].to_numpy().reshape(rows, per_method)
    if not (times == times[0]).all() or not (np.diff(times[0]) > 0).all():
        raise DataError(f"{samples_path}: its runs and methods differ in their times")
    chosen = choices["runs_chosen"]
    if (
        not (choices["trajectory"] == chunk.scenario).all()
        or not choices["method"].is_in(list(methods)).all()
        or not chosen.is_between(1, chunk.runs).all()
    ):
        raise DataError(f"{choices_path}: is not of {chunk.runs} runs of {chunk.scenario} and its methods")
