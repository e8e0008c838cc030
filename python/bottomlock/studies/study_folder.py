"""A study's directory: claimed when it is new, empty or of the same configuration; finished parts are kept."""

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import polars as pl

from bottomlock.config.scenario import Scenario
from bottomlock.errors import DataError, OutputError, note
from bottomlock.files.output_folder import LOCK, is_occupied, locked
from bottomlock.files.overwriting import check_apart, named_in, remove_named
from bottomlock.files.records import (
    MissingFileError,
    read_record,
    read_recorded_table,
    record_of,
    write_record,
    write_recorded_table,
)
from bottomlock.kernel import kernel_version
from bottomlock.tables.versions import bit_versions, check_identity, library_versions, versions_in_words

MANIFEST = "study.json"


def configuration_hash(content: Any) -> str:  # noqa: ANN401 - any JSON value
    """SHA-256 of the settings that determine a study's numbers."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def versions() -> dict[str, str]:
    """Versions of bottomlock and the libraries that computed the numbers."""
    return {"bottomlock": kernel_version()} | library_versions()


def made_with() -> str:
    """The versions in words."""
    return ", ".join(f"{name} {version}" for name, version in versions().items())


def finished_part(path: Path, configuration: str, run: Callable[[], pl.DataFrame]) -> pl.DataFrame:
    """The table in a file; where it is not finished, or has changed since, it is run (again) and written first.

    Args:
        path: the part's file; its record stands beside it.
        configuration: hash of what decides the part.
        run: computes the part.

    Raises:
        OutputError: where it cannot be written.
    """
    identity = {"configuration_hash": configuration, "versions": bit_versions()}
    table = _kept_part(path, identity)
    if table is None:
        table = run()
        write_recorded_table(path, table, identity)
    return table


def _kept_part(path: Path, identity: dict[str, Any]) -> pl.DataFrame | None:
    """The table of a part that is finished, whole and of this study; a note says why one that is there is not."""
    remedy = "the part is run again"
    try:
        record = read_record(record_of(path))
        if record is None:
            return None
        check_identity(record_of(path), record, identity, remedy=remedy)
        return read_recorded_table(path, record, remedy=remedy)
    except MissingFileError:
        return None
    except DataError as error:
        note(str(error))
        return None


@contextmanager
def claimed(
    out: Path,
    kind: str,
    configuration: str,
    *,
    parts: Iterable[str],
    scenarios: Iterable[Scenario] = (),
    force: bool = False,
    recover: bool = False,
) -> Iterator[None]:
    """Holds `out` as the directory of this study; with `force` the `parts` of another of the same kind are removed.

    Nothing is changed in a directory that is rejected. With `recover` a manifest that is damaged is written again; the
    parts have records of their own.

    Raises:
        OutputError: for a directory that holds something else, or a file of the `scenarios`, is in use, or cannot be
            read or written.
        DataError: for a manifest that is damaged.
    """
    parts = tuple(parts)

    def ours() -> set[str]:
        # Of a folder among the parts what its records name.
        return {*(one for one in parts if not (out / one).is_dir()), *named_in(out, parts)}

    check_apart([out / name for name in ours()], [file for one in scenarios for file in one.files()])
    check_owner(out, kind, configuration, parts=parts, force=force, recover=recover)
    with locked(out):
        # Another process may have held it until now.
        check_owner(out, kind, configuration, parts=parts, force=force, recover=recover)
        if force:
            remove_named(out, ours())
        write_manifest(out, kind, configuration, status="running")
        yield


def check_owner(
    out: Path, kind: str, configuration: str, *, parts: Iterable[str], force: bool, recover: bool
) -> None:
    """Rejects a directory that `claimed` would reject, and changes nothing.

    Raises:
        As `claimed`.
    """
    if not is_occupied(out):
        return
    ours = out.is_dir() and all(path.name in (*parts, LOCK) for path in out.iterdir())
    try:
        manifest = read_record(out / MANIFEST) if out.is_dir() else None
    except DataError as error:
        if recover and ours:
            return
        raise DataError(
            f"{error}; the same command with --recover writes it again and keeps every part that is whole"
        ) from error
    if manifest is None and recover and ours:
        return
    if manifest is None or manifest.get("kind") != kind:
        raise OutputError(f"{out}: is not empty and holds no {kind} study of ours; choose another directory")
    other = ""
    if manifest.get("configuration_hash") != configuration:
        other = "of another configuration"
    else:
        differing = versions_in_words(dict(manifest.get("versions", {})), bit_versions())
        other = f"made with {differing}, so that bits may differ" if differing else ""
    if other and not force:
        raise OutputError(
            f"{out}: holds a {kind} study {other}; choose another directory or use --force to start over"
        )


def write_manifest(out: Path, kind: str, configuration: str, *, status: str, **more: Any) -> None:  # noqa: ANN401
    """Writes the manifest of the directory, which the next command reads."""
    write_record(
        out / MANIFEST,
        {
            "kind": kind,
            "status": status,
            "version": kernel_version(),
            "versions": versions() | bit_versions(),
            "configuration_hash": configuration,
            **more,
        },
        {},
    )
