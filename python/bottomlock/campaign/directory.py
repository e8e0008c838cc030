"""A campaign's directory: whose it is, which chunks it has, and its chunks' files read with care."""

import contextlib
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import polars as pl

from bottomlock import kernel
from bottomlock.atomic_write import read_json, write_parquet
from bottomlock.campaign.chunk import ChunkResult
from bottomlock.campaign.partition import Partition, RunRange, Shard
from bottomlock.errors import DataError, OutputError
from bottomlock.tables.campaign import CHOICES, OUTCOMES, SAMPLES
from bottomlock.tables.check import check

MANIFEST = "manifest.json"
TABLES = ("runs.parquet", "ensemble.parquet", "consistency.parquet", "choices.parquet")
TRUTH = "truth.parquet"
_OURS = ("chunks", *TABLES, TRUTH, MANIFEST)


def prepare(out: Path, configuration: str, *, shard: Shard | None = None, force: bool = False) -> None:
    """Makes sure that a directory is ours: new, empty, or of the same campaign and the same shard of it.

    Removes what a process that was ended while it wrote has left, and with `force` another campaign's files.

    Raises:
        OutputError: for anything else in its place, and for a directory that cannot be read.
        DataError: for a manifest that cannot be read.
    """
    try:
        # A manifest that was never finished is all that a process leaves that is ended at once: as good as empty.
        unfinished = set(out.glob(f".{MANIFEST}.*.part"))
        occupied = out.exists() and (
            not out.is_dir() or any(path not in unfinished for path in out.iterdir())
        )
    except OSError as error:
        raise OutputError(f"{out}: cannot be read ({error.strerror})") from error
    if not occupied:
        _sweep_up(out)
        return
    manifest = read_json(out / MANIFEST) if out.is_dir() else None
    if manifest is None or "configuration_hash" not in manifest:
        raise OutputError(f"{out}: is not empty and holds no campaign of ours; choose another directory")
    other = _difference(manifest, configuration, shard)
    if other is not None and not force:
        raise OutputError(f"{out}: holds {other}; choose another directory or use --force to start over")
    _sweep_up(out)
    if force:
        for part in _OURS:
            path = out / part
            shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)


def _difference(manifest: Mapping[str, Any], configuration: str, shard: Shard | None) -> str | None:
    """What a directory holds that is not ours, in words."""
    if manifest["configuration_hash"] != configuration:
        return "a campaign of another configuration"
    if manifest.get("version") != kernel.kernel_version():
        return f"a campaign of version {manifest.get('version')}"
    held = shard_of(manifest)
    if held != shard:
        return "a whole campaign" if held is None else f"shard {held} of this campaign"
    return None


def shard_of(manifest: Mapping[str, Any]) -> Shard | None:
    """Which shard a manifest is of, or None for a whole campaign.

    Raises:
        DataError: for an entry that is no shard.
    """
    entry = manifest.get("shard")
    if entry is None:
        return None
    try:
        return Shard(int(entry["k"]), int(entry["n"]))
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"the manifest's shard is {entry!r}, expected k and n") from error


def _sweep_up(out: Path) -> None:
    """Removes files that were never finished; see `output` for their names."""
    for pattern in (f".{MANIFEST}.*.part", ".*.parquet.*.part", "chunks/*/.*.parquet.*.part"):
        for path in out.glob(pattern):
            path.unlink(missing_ok=True)


def _paths(out: Path, name: str, span: RunRange) -> tuple[Path, Path, Path]:
    folder = out / "chunks" / name
    return folder / f"samples-{span.stem}", folder / f"choices-{span.stem}", folder / f"counts-{span.stem}"


def is_finished(out: Path, name: str, span: RunRange) -> bool:
    """Whether a chunk is there, whole."""
    return all(path.exists() for path in _paths(out, name, span))


def write_chunk(out: Path, name: str, span: RunRange, flown: ChunkResult) -> None:
    """A chunk's tables to disk, each whole or not at all."""
    samples_path, choices_path, counts_path = _paths(out, name, span)
    write_parquet(samples_path, flown.samples)
    write_parquet(choices_path, flown.choices)
    write_parquet(counts_path, flown.counts)


def take_chunk(out: Path, source: Path, name: str, span: RunRange) -> None:
    """A finished chunk of another directory: linked where the file system allows, else copied.

    Raises:
        OutputError: where it cannot be written.
    """
    for old, new in zip(_paths(source, name, span), _paths(out, name, span), strict=True):
        _take(old, new)


def take_truth(out: Path, source: Path) -> None:
    """The true paths of another directory, as `take_chunk`."""
    _take(source / TRUTH, out / TRUTH)


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


def read_samples(out: Path, plan: Partition, span: RunRange) -> pl.DataFrame:
    """The samples of a chunk (`tables.campaign.SAMPLES`), ordered by run, method and time.

    Raises:
        DataError: for a file that is missing, damaged, or of other runs than its name says.
    """
    path, _, _ = _paths(out, plan.name, span)
    samples = check(_read(path), SAMPLES, place=str(path))
    per_method, left = divmod(samples.height, span.runs * len(plan.methods))
    expected = pl.int_range(span.first_run, span.first_run + span.runs, eager=True)
    expected = expected.repeat_by(per_method * len(plan.methods)).explode()
    if left or not samples.height or not expected.equals(samples["run"]):
        raise DataError(
            f"{path}: expected the runs {span.first_run} to {span.first_run + span.runs - 1} of "
            f"{len(plan.methods)} methods; delete the file and run the same command again"
        )
    return samples


def read_choices(out: Path, plan: Partition, span: RunRange) -> pl.DataFrame:
    """What the selectors of a chunk have chosen (`tables.campaign.CHOICES`).

    Raises:
        DataError: for a file that is missing or damaged.
    """
    _, path, _ = _paths(out, plan.name, span)
    return check(_read(path), CHOICES, place=str(path))


def read_counts(out: Path, plan: Partition, span: RunRange) -> pl.DataFrame:
    """The fix counts of a chunk (`tables.campaign.OUTCOMES`).

    Raises:
        DataError: for a file that is missing or damaged.
    """
    _, _, path = _paths(out, plan.name, span)
    return check(_read(path), OUTCOMES, place=str(path))


def _read(path: Path) -> pl.DataFrame:
    try:
        return pl.read_parquet(path)
    except FileNotFoundError as error:
        raise DataError(f"{path}: is missing; the same command flies it again") from error
    except (OSError, pl.exceptions.PolarsError) as error:
        raise DataError(
            f"{path}: cannot be read ({str(error).splitlines()[0]}); delete the file and run the same command again"
        ) from error
