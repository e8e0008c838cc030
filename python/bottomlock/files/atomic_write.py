"""Writing to an output directory so that nothing is ever half-written, also after a loss of power.

Every file is written under a temporary name, forced to the disk (fsync), renamed, and the renaming forced to the disk.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import math
import os
import secrets
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bottomlock.errors import DataError, OutputError
from bottomlock.libraries import pl


def write_bytes(path: Path, content: bytes | memoryview) -> str:
    """Bytes to a file, whole or not at all.

    Returns:
        Their SHA-256, 64 hex digits.

    Raises:
        OutputError: where the directory cannot be written or the disk is full; the old file, if any, stays.
    """
    _replace(path, content)
    return hashlib.sha256(content).hexdigest()


def write_parquet(path: Path, frame: pl.DataFrame, *, compressed: bool = False) -> str:
    """A table to Parquet, as `write_bytes`.

    Uncompressed unless asked for: noise in double precision does not compress, and trying costs more than writing.
    """
    return write_bytes(path, parquet_bytes(frame, compressed=compressed))


def parquet_bytes(frame: pl.DataFrame, *, compressed: bool = False) -> memoryview:
    """A table as `write_parquet` writes it."""
    content = io.BytesIO()
    if compressed:
        frame.write_parquet(content, compression="zstd", compression_level=1, statistics=False)
    else:
        frame.write_parquet(content, compression="uncompressed", statistics=False)
    return content.getbuffer()


def json_text(content: dict[str, Any]) -> str:
    """The one text of a dict in JSON."""
    return json.dumps(content, indent=2, sort_keys=True) + "\n"


def plain(value: object) -> Any:  # noqa: ANN401 - what JSON holds is any of six types
    """Arrays, numpy numbers and dataclasses as JSON holds them; NaN and infinity are None."""
    if isinstance(value, Mapping):
        return {str(key): plain(one) for key, one in value.items()}
    if hasattr(value, "__dataclass_fields__"):
        return plain(vars(value))
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_json(path: Path, content: dict[str, Any]) -> str:
    """A dict to JSON, as `write_bytes`."""
    return write_bytes(path, json_text(content).encode())


def write_text(path: Path, text: str) -> str:
    """Text to a file in UTF-8, as `write_bytes`."""
    return write_bytes(path, text.encode())


def _replace(path: Path, content: bytes | memoryview) -> None:
    """Writes under a temporary name that nobody can foresee, then renames."""
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(8)}.part")
    try:
        make_folder(path.parent)
        _write(temporary, content)
        temporary.replace(path)
        _sync_folder(path.parent)
    except OSError as error:
        raise OutputError(
            f"cannot be written ({error.strerror or error})", place=path, hint="this file is as it was"
        ) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def _write(path: Path, content: bytes | memoryview) -> None:
    # Never one that is there or behind a link; with the rights of the umask, unlike the files of `tempfile`.
    with path.open("xb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def make_folder(folder: Path) -> list[Path]:
    """Makes a folder and those above it that are not there, each forced to the disk.

    Returns:
        The folders that were made, the last one first.

    Raises:
        OSError: where that is not possible.
    """
    if folder.is_dir():
        return []
    above = make_folder(folder.parent) if folder != folder.parent else []
    folder.mkdir(exist_ok=True)
    _sync_folder(folder.parent)
    return [folder, *above]


def _sync_folder(folder: Path) -> None:
    """Forces the names in a folder to the disk, where the system can do that for folders."""
    if hasattr(os, "O_DIRECTORY"):
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            # Some network file systems refuse; they keep names in their own way.
            with contextlib.suppress(OSError):
                os.fsync(handle)
        finally:
            os.close(handle)


def read_json(path: Path) -> dict[str, Any] | None:
    """The dict in a JSON file, or None where there is no file.

    Raises:
        DataError: for a file that is not a JSON object.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except RecursionError as error:
        raise DataError("cannot be read as JSON (nested too deeply)", place=path) from error
    except (OSError, ValueError) as error:
        raise DataError(f"cannot be read as JSON ({error})", place=path) from error
    if not isinstance(content, dict):
        raise DataError(place=path, expected="a JSON object")
    return content
