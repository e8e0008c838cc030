"""Records: JSON files that state what was written, by SHA-256: what has changed since is never taken for good.

A record is written after the files that it states. A file without its record is unfinished. A record has a digest of
its own, so a bit that flips in it is found as well.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bottomlock.errors import DataError
from bottomlock.files.atomic_write import json_text, read_json, write_json, write_parquet
from bottomlock.libraries import pl

DIGESTS = "digests"
"""Entry of a record: the SHA-256 of every file that it states, by the file's name."""

OWN_DIGEST = "own_digest"
"""Entry of a record: the SHA-256 of all its other entries as `atomic_write.json_text` writes them."""


class MissingFileError(DataError):
    """A file that a record states is not there."""


def write_record(path: Path, content: Mapping[str, Any], digests: Mapping[str, str]) -> None:
    """Writes a record of files that have been written, whole or not at all.

    Args:
        path: the record's own file.
        content: further entries.
        digests: SHA-256 of every file, by name, as `atomic_write` returns it.

    Raises:
        OutputError: where it cannot be written.
    """
    stated = {**content, DIGESTS: dict(digests)}
    write_json(path, stated | {OWN_DIGEST: _own_digest(stated)})


def read_record(path: Path) -> dict[str, Any] | None:
    """The entries of a record, without its own digest; None where there is no file.

    Raises:
        DataError: for a file that is no record, or has changed since it was written.
    """
    content = read_json(path)
    if content is None:
        return None
    own = content.pop(OWN_DIGEST, None)
    if own is None:
        raise DataError(f"has no '{OWN_DIGEST}': it is of an older version, or damaged", place=path)
    if own != _own_digest(content) or not isinstance(content.get(DIGESTS), dict):
        raise DataError(f"has changed since it was written ('{OWN_DIGEST}' is not its SHA-256)", place=path)
    return content


def _own_digest(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json_text(dict(content)).encode()).hexdigest()


def read_recorded(path: Path, record: Mapping[str, Any], *, remedy: str) -> bytes:
    """The content of a file, checked against the record that states it.

    Args:
        path: the file.
        record: as `read_record` gives it.
        remedy: what the user should do about a fault, for the message.

    Raises:
        DataError: for a file that the record does not state, is missing, cannot be read, or has changed.
    """
    stated = record[DIGESTS].get(path.name)
    if stated is None:
        raise DataError("its record does not state it", place=path, hint=remedy)
    try:
        content = path.read_bytes()
    except FileNotFoundError as error:
        raise MissingFileError("is missing", place=path, hint=remedy) from error
    except OSError as error:
        raise DataError(f"cannot be read ({error.strerror or error})", place=path, hint=remedy) from error
    if hashlib.sha256(content).hexdigest() != stated:
        raise DataError(
            "has changed since it was written (its SHA-256 is not the recorded one)", place=path, hint=remedy
        )
    return content


def read_recorded_table(
    path: Path, record: Mapping[str, Any], *, remedy: str, columns: Sequence[str] | None = None
) -> pl.DataFrame:
    """The table in a Parquet file, checked as by `read_recorded`; with `columns`, those alone.

    Raises:
        DataError: as `read_recorded`, and for a file that is no such table.
    """
    content = read_recorded(path, record, remedy=remedy)
    try:
        return pl.read_parquet(io.BytesIO(content), columns=None if columns is None else list(columns))
    except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        reason = (str(error) or type(error).__name__).splitlines()[0]
        raise DataError(
            f"cannot be read as the table it should be ({reason})", place=path, hint=remedy
        ) from error


def sha256_of(path: Path) -> str:
    """Hash of a file, read in pieces; of a folder, that of its files' names and hashes.

    Raises:
        DataError: for a file that cannot be read.
    """
    if path.is_dir():
        parts = [f"{sha256_of(one)}  {one.name}\n" for one in sorted(path.iterdir()) if one.is_file()]
        return hashlib.sha256("".join(parts).encode()).hexdigest()
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise DataError(f"cannot be read ({error.strerror or error})", place=path) from error


def record_of(path: Path) -> Path:
    """The record of a file that is written on its own.

    >>> record_of(Path("cells/straight-beams_12.parquet")).name
    'straight-beams_12.record.json'
    """
    return path.with_name(f"{path.stem}.record.json")


def write_recorded_table(path: Path, frame: pl.DataFrame, content: Mapping[str, Any]) -> None:
    """Writes a table to Parquet and then its record; `content` as for `write_record`.

    Raises:
        OutputError: where they cannot be written.
    """
    write_record(record_of(path), content, {path.name: write_parquet(path, frame)})
