"""A campaign's directory: which campaign owns it, and the tables in it."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import polars as pl

from bottomlock.campaign.aggregate import Tables
from bottomlock.campaign.chunk_files import Identity
from bottomlock.campaign.partition import Shard
from bottomlock.errors import DataError, OutputError
from bottomlock.files.atomic_write import write_parquet
from bottomlock.files.output_folder import is_occupied, locked
from bottomlock.files.overwriting import named_in, remove_named
from bottomlock.files.records import read_record, read_recorded_table
from bottomlock.tables.campaign import PATHS
from bottomlock.tables.check import check
from bottomlock.tables.versions import versions_in_words

MANIFEST = "manifest.json"
TABLES = ("runs.parquet", "ensemble.parquet", "consistency.parquet", "choices.parquet")
TRUTH = "truth.parquet"


@contextmanager
def open_directory(
    out: Path, identity: Identity, *, shard: Shard | None = None, force: bool = False, recover: bool = False
) -> Iterator[None]:
    """Holds `out` for a campaign: new, empty, or of the same campaign and the same shard of it.

    Nothing is changed in a directory that is rejected.

    Args:
        out: the directory.
        identity: of the campaign.
        shard: the part of the campaign that is computed here.
        force: accept another campaign of ours, which `start_directory` removes.
        recover: accept a manifest that is damaged or missing beside chunks of this very campaign.

    Raises:
        OutputError: for a directory that holds anything else, is in use, or cannot be read.
        DataError: for a manifest that is damaged.
    """
    check_owner(out, identity, shard, force=force, recover=recover)
    with locked(out):
        # Another process may have held it until now.
        check_owner(out, identity, shard, force=force, recover=recover)
        yield


def check_owner(out: Path, identity: Identity, shard: Shard | None, *, force: bool, recover: bool) -> None:
    """Rejects a directory that `open_directory` would reject for what it holds, and changes nothing.

    Raises:
        As `open_directory`.
    """
    if not is_occupied(out):
        return
    chunk_records = list(out.glob("chunks/*/record-*.json")) if out.is_dir() else []
    try:
        manifest = read_record(out / MANIFEST) if out.is_dir() else None
    except DataError as error:
        if recover and _holds_chunk_of(chunk_records, identity):
            return
        raise DataError(f"{error}; {_way_out(chunk_records, recover=recover)}") from error
    if manifest is None or "configuration_hash" not in manifest:
        if recover and _holds_chunk_of(chunk_records, identity):
            return
        hint = (
            f"; its {MANIFEST} is missing: {_way_out(chunk_records, recover=recover)}"
            if chunk_records
            else ""
        )
        raise OutputError(
            f"{out}: is not empty and holds no campaign of ours; choose another directory{hint}"
        )
    other = _difference(manifest, identity, shard)
    if other and not force:
        raise OutputError(f"{out}: holds {other}; choose another directory or use --force to start over")


def _holds_chunk_of(records: list[Path], identity: Identity) -> bool:
    """Whether any of the records of chunks is one of this campaign."""
    for path in records:
        try:
            record = read_record(path) or {}
        except DataError:
            continue
        if record.get("configuration_hash") == identity["configuration_hash"]:
            return True
    return False


def _way_out(records: list[Path], *, recover: bool) -> str:
    if recover:
        return "no chunk here is of this campaign, so there is nothing to recover: choose another directory"
    if records:
        return "the same command with --recover writes it again and keeps every chunk that is whole"
    return "no chunk is finished here: remove the directory, or choose another one"


def _difference(manifest: Mapping[str, Any], identity: Identity, shard: Shard | None) -> str | None:
    """Description of other content of a directory; None if it holds this campaign."""
    if manifest["configuration_hash"] != identity["configuration_hash"]:
        return "a campaign of another configuration"
    other = versions_in_words(dict(manifest.get("versions", {})), identity["versions"])
    if other:
        return f"a campaign made with {other}, so that bits may differ"
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


def start_directory(out: Path, *, force: bool = False) -> None:
    """Removes the temporary files of a process that was killed while writing, and with `force` a campaign's files.

    These are what the records of the directory and of its chunks name.

    Raises:
        OutputError: for a part that is a symbolic link, and what cannot be removed.
    """
    if force:
        remove_named(out, {*TABLES, TRUTH, *named_in(out, ["chunks"])})
    # `atomic_write` names them.
    for pattern in (".*.json.*.part", ".*.parquet.*.part"):
        for path in (*out.glob(pattern), *out.glob(f"chunks/*/{pattern}")):
            path.unlink(missing_ok=True)


def write_tables(out: Path, paths: pl.DataFrame, tables: Tables | None) -> dict[str, str]:
    """Writes the true paths, and the tables if there are any, each whole or not at all.

    Returns:
        The SHA-256 of each file, by name.

    Raises:
        OutputError: where they cannot be written.
    """
    written = {TRUTH: write_parquet(out / TRUTH, paths)}
    if tables is not None:
        written |= {
            name: write_parquet(out / name, table) for name, table in zip(TABLES, tables, strict=True)
        }
    return written


def read_paths(directory: Path, manifest: Mapping[str, Any]) -> pl.DataFrame:
    """The true paths (`tables.campaign.PATHS`).

    Raises:
        DataError: for a file that is missing or has changed since the manifest stated it.
    """
    path = directory / TRUTH
    return check(
        read_recorded_table(path, manifest, remedy="run the same command again"), PATHS, place=str(path)
    )
