"""A campaign's folder: which campaign owns it, its chunks as files, and its tables."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import polars as pl

from bottomlock.campaign.chunk import Chunk, ChunkTables
from bottomlock.errors import DataError, OutputError, note
from bottomlock.files.atomic_write import write_parquet
from bottomlock.files.campaign_tables import chunk_file
from bottomlock.files.columns import CHOICES, OUTCOMES, SAMPLES, check
from bottomlock.files.output_folder import is_occupied
from bottomlock.files.overwriting import named_in, remove_named
from bottomlock.files.records import MissingFileError, read_record, read_recorded_table, write_record
from bottomlock.files.versions import bit_versions, check_identity, versions_in_words
from bottomlock.simulation.build import Simulation

MANIFEST = "manifest.json"
TABLES = ("runs.parquet", "ensemble.parquet", "consistency.parquet", "choices.parquet", "truth.parquet")
_COLUMNS = {"samples": SAMPLES, "choices": CHOICES, "counts": OUTCOMES}
_RUN_AGAIN = "the chunk is run again"

Identity = Mapping[str, Any]
"""What decides the numbers of a campaign: `configuration_hash`, and `versions` (`files.versions.bit_versions`)."""


def identity_of(simulations: Sequence[Simulation]) -> Identity:
    """What decides the numbers of a campaign, apart from the number of runs; known before any truth is computed."""
    content = [
        (simulation.scenario.name, simulation.fingerprint(), list(simulation.scenario.campaign.methods))
        for simulation in simulations
    ]
    digest = hashlib.sha256(json.dumps(content).encode()).hexdigest()
    return {"configuration_hash": digest, "versions": bit_versions()}


def check_owner(out: Path, identity: Identity, *, force: bool) -> None:
    """Rejects a folder that is neither new, nor empty, nor of the same campaign; changes nothing.

    With `force` another campaign is accepted. A manifest that has been removed is written again where a chunk of this
    campaign is in the folder.

    Raises:
        OutputError: for a folder that holds anything else or cannot be read.
        DataError: for a manifest that is damaged.
    """
    if not is_occupied(out):
        return
    try:
        held = read_record(out / MANIFEST) if out.is_dir() else None
    except DataError as error:
        raise DataError(error, hint="remove it, and every chunk that is whole is kept") from error
    if held is None or "configuration_hash" not in held:
        if not any(_is_of(path, identity) for path in out.glob("chunks/*/record-*.json")):
            raise OutputError(
                "is not empty and holds no campaign of ours", place=out, hint="choose another directory"
            )
        return
    if force:
        return
    other = versions_in_words(dict(held.get("versions", {})), identity["versions"])
    content = f"a campaign made with {other}, so that bits may differ" if other else ""
    if held["configuration_hash"] != identity["configuration_hash"]:
        content = "a campaign of another configuration"
    if content:
        raise OutputError(
            f"holds {content}", place=out, hint="choose another directory or use --force to start over"
        )


def _is_of(record: Path, identity: Identity) -> bool:
    try:
        return bool((read_record(record) or {}).get("configuration_hash") == identity["configuration_hash"])
    except DataError:
        return False


def start_folder(out: Path, manifest: Mapping[str, Any], *, force: bool) -> None:
    """Removes what a process that was killed while writing has left, with `force` a campaign's files, and begins.

    A campaign's files are what its records name.

    Raises:
        OutputError: for a part that is a symbolic link, and what cannot be removed or written.
    """
    if force:
        remove_named(out, {*TABLES, *named_in(out, ["chunks"])})
    # `atomic_write` names them.
    for pattern in (".*.json.*.part", ".*.parquet.*.part"):
        for path in (*out.glob(pattern), *out.glob(f"chunks/*/{pattern}")):
            path.unlink(missing_ok=True)
    write_record(out / MANIFEST, {**manifest, "status": "running"}, {})


def _paths(out: Path, chunk: Chunk) -> tuple[dict[str, Path], Path]:
    """The files of a chunk's tables by name, and its record."""
    of = [
        chunk_file(out, chunk.scenario, name, chunk.first_run, chunk.runs) for name in (*_COLUMNS, "record")
    ]
    return dict(zip(_COLUMNS, of[:-1], strict=True)), of[-1]


def write_chunk(out: Path, chunk: Chunk, tables: ChunkTables, identity: Identity) -> None:
    """Writes the tables of a chunk, each whole or not at all, then the record that makes the chunk finished.

    Raises:
        OutputError: where they cannot be written.
    """
    paths, record = _paths(out, chunk)
    digests = {
        path.name: write_parquet(path, getattr(tables, name), compressed=True) for name, path in paths.items()
    }
    write_record(record, {**identity, "chunk": asdict(chunk)}, digests)


def read_chunk(out: Path, chunk: Chunk, identity: Identity) -> ChunkTables | None:
    """The tables of a finished chunk of this campaign; None where it is to be run, with a note where it is damaged."""
    paths, place = _paths(out, chunk)
    try:
        record = read_record(place)
        if record is None:
            return None
        check_identity(place, record, identity, remedy=_RUN_AGAIN)
        if record.get("chunk") != asdict(chunk):
            note(f"{place}: is of other runs than its name says; {_RUN_AGAIN}")
            return None
        return ChunkTables(
            **{
                name: check(
                    read_recorded_table(path, record, remedy=_RUN_AGAIN), _COLUMNS[name], place=str(path)
                )
                for name, path in paths.items()
            }
        )
    except MissingFileError:
        return None
    except DataError as error:
        note(f"{str(error).removesuffix(f'; {_RUN_AGAIN}')}; {_RUN_AGAIN}")
        return None


def write_tables(out: Path, tables: Sequence[pl.DataFrame], manifest: Mapping[str, Any]) -> None:
    """Writes the tables in the order of `TABLES`, each whole or not at all, and the manifest that states them.

    Raises:
        OutputError: where they cannot be written.
    """
    digests = {name: write_parquet(out / name, table) for name, table in zip(TABLES, tables, strict=True)}
    write_record(out / MANIFEST, {**manifest, "status": "complete"}, digests)
