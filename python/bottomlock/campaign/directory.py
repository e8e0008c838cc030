"""A campaign's directory: which campaign owns it, which chunks are finished, and their files."""

import contextlib
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import polars as pl

from bottomlock import kernel
from bottomlock.atomic_write import read_json, write_parquet
from bottomlock.campaign.aggregate import Tables
from bottomlock.campaign.chunk import ChunkResult
from bottomlock.campaign.partition import Chunk, Partition, Shard
from bottomlock.errors import DataError, OutputError
from bottomlock.tables.campaign import CHOICES, OUTCOMES, PATHS, SAMPLES
from bottomlock.tables.check import check

MANIFEST = "manifest.json"
TABLES = ("runs.parquet", "ensemble.parquet", "consistency.parquet", "choices.parquet")
TRUTH = "truth.parquet"
_OURS = ("chunks", *TABLES, TRUTH, MANIFEST)


def claim_directory(
    out: Path, configuration: str, *, shard: Shard | None = None, force: bool = False
) -> None:
    """Makes sure that `out` may be written: new, empty, or of the same campaign and the same shard of it.

    Removes the temporary files of a process that was killed while writing, and with `force` another campaign's files.

    Raises:
        OutputError: for a directory that holds anything else, or cannot be read.
        DataError: for a manifest that cannot be read.
    """
    try:
        # A process that is killed at once leaves an unfinished manifest at most: as good as empty.
        unfinished = set(out.glob(f".{MANIFEST}.*.part"))
        occupied = out.exists() and (
            not out.is_dir() or any(path not in unfinished for path in out.iterdir())
        )
    except OSError as error:
        raise OutputError(f"{out}: cannot be read ({error.strerror})") from error
    if not occupied:
        _remove_unfinished(out)
        return
    manifest = read_json(out / MANIFEST) if out.is_dir() else None
    if manifest is None or "configuration_hash" not in manifest:
        raise OutputError(f"{out}: is not empty and holds no campaign of ours; choose another directory")
    other = _difference(manifest, configuration, shard)
    if other is not None and not force:
        raise OutputError(f"{out}: holds {other}; choose another directory or use --force to start over")
    _remove_unfinished(out)
    if force:
        for part in _OURS:
            path = out / part
            shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)


def _difference(manifest: Mapping[str, Any], configuration: str, shard: Shard | None) -> str | None:
    """Description of other content of a directory; None if it holds this campaign."""
    if manifest["configuration_hash"] != configuration:
        return "a campaign of another configuration"
    if manifest.get("version") != kernel.kernel_version():
        return f"a campaign of version {manifest.get('version')}"
    held = shard_of(manifest)
    if held != shard:
        return "a whole campaign" if held is None else f"shard {held} of this campaign"
    return None


def shard_of(manifest: Mapping[str, Any]) -> Shard | None:
    """The shard that a manifest belongs to; None for a whole campaign.

    Raises:
        DataError: for an entry without k and n.
    """
    entry = manifest.get("shard")
    if entry is None:
        return None
    try:
        return Shard(int(entry["k"]), int(entry["n"]))
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"the manifest's shard is {entry!r}, expected k and n") from error


def _remove_unfinished(out: Path) -> None:
    """Removes files that were never finished; `atomic_write` names them."""
    for pattern in (f".{MANIFEST}.*.part", ".*.parquet.*.part", "chunks/*/.*.parquet.*.part"):
        for path in out.glob(pattern):
            path.unlink(missing_ok=True)


def _paths(out: Path, chunk: Chunk) -> tuple[Path, Path, Path]:
    """The files of samples, choices and counts."""
    folder, ending = out / "chunks" / chunk.scenario, chunk.file_ending
    return folder / f"samples-{ending}", folder / f"choices-{ending}", folder / f"counts-{ending}"


def is_finished(out: Path, chunk: Chunk) -> bool:
    """Whether all files of a chunk are there."""
    return all(path.exists() for path in _paths(out, chunk))


def write_chunk(out: Path, chunk: Chunk, result: ChunkResult) -> None:
    """Writes the tables of a chunk, each whole or not at all; those of another directory are linked or copied.

    Raises:
        OutputError: where they cannot be written.
    """
    paths = _paths(out, chunk)
    if result.directory is not None:
        for old, new in zip(_paths(result.directory, chunk), paths, strict=True):
            _take(old, new)
        return
    for path, table in zip(paths, (result.samples, result.choices, result.counts), strict=True):
        write_parquet(path, table)


def write_tables(out: Path, paths: pl.DataFrame, tables: Tables | None) -> None:
    """Writes the true paths, and the tables if there are any, each whole or not at all.

    Raises:
        OutputError: where they cannot be written.
    """
    write_parquet(out / TRUTH, paths)
    if tables is not None:
        for name, table in zip(TABLES, tables, strict=True):
            write_parquet(out / name, table)


def _take(old: Path, new: Path) -> None:
    temporary = new.with_name(f".{new.name}.{os.getpid()}.part")
    try:
        new.parent.mkdir(parents=True, exist_ok=True)
        # Files of ours are replaced, never changed in place, so two names for one file do no harm.
        try:
            temporary.hardlink_to(old)
        except OSError:
            shutil.copyfile(old, temporary)
        temporary.replace(new)
    except OSError as error:
        raise OutputError(f"{new}: cannot be written ({error.strerror})") from error
    finally:
        # Renaming one link of a file over another does nothing, and leaves both.
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def read_chunk(directory: Path, chunk: Chunk, partition: Partition) -> ChunkResult:
    """The tables of a finished chunk, the samples ordered by run, method and time.

    Raises:
        DataError: for a file that is missing, damaged, or of other runs than its name says.
    """
    samples_path, choices_path, counts_path = _paths(directory, chunk)
    samples = check(_read(samples_path), SAMPLES, place=str(samples_path))
    methods = len(partition.methods)
    per_method, left = divmod(samples.height, chunk.runs * methods)
    expected = pl.int_range(chunk.first_run, chunk.first_run + chunk.runs, eager=True)
    expected = expected.repeat_by(per_method * methods).explode()
    if left or not samples.height or not expected.equals(samples["run"]):
        raise DataError(
            f"{samples_path}: expected the runs {chunk.first_run} to {chunk.first_run + chunk.runs - 1} of "
            f"{methods} methods; delete the file and run the same command again"
        )
    return ChunkResult(
        samples=samples,
        choices=check(_read(choices_path), CHOICES, place=str(choices_path)),
        counts=check(_read(counts_path), OUTCOMES, place=str(counts_path)),
        directory=directory,
    )


def read_paths(directory: Path) -> pl.DataFrame:
    """The true paths (`tables.campaign.PATHS`).

    Raises:
        DataError: for a file that is missing or damaged.
    """
    return check(_read(directory / TRUTH), PATHS, place=str(directory / TRUTH))


def _read(path: Path) -> pl.DataFrame:
    try:
        return pl.read_parquet(path)
    except FileNotFoundError as error:
        raise DataError(f"{path}: is missing; run the same command again") from error
    except (OSError, pl.exceptions.PolarsError) as error:
        raise DataError(
            f"{path}: cannot be read ({str(error).splitlines()[0]}); delete the file and run the same command again"
        ) from error
