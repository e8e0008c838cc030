"""Writing to an output directory so that nothing is ever half-written."""

import contextlib
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import polars as pl

from bottomlock.errors import DataError, OutputError


def _write(path: Path, write: Callable[[Path], None]) -> None:
    """Writes under a temporary name, then renames.

    Raises:
        OutputError: where the directory cannot be written or the disk is full; the old file, if any, stays.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write(temporary)
        temporary.replace(path)
    except (OSError, pl.exceptions.PolarsError) as error:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
        reason = getattr(error, "strerror", None) or str(error).splitlines()[0]
        raise OutputError(f"{path}: cannot be written ({reason}); nothing was changed") from error


def write_parquet(path: Path, frame: pl.DataFrame) -> None:
    """A table to Parquet, whole or not at all.

    Uncompressed: noise does not compress, and compressing it costs more than writing it.
    """
    _write(
        path, lambda temporary: frame.write_parquet(temporary, compression="uncompressed", statistics=False)
    )


def write_json(path: Path, content: dict[str, Any]) -> None:
    """A dict to JSON, whole or not at all."""
    text = json.dumps(content, indent=2, sort_keys=True) + "\n"
    _write(path, lambda temporary: _write_text(temporary, text))


def write_text(path: Path, text: str) -> None:
    """Text to a file in UTF-8, whole or not at all."""
    _write(path, lambda temporary: _write_text(temporary, text))


def write_bytes(path: Path, content: bytes) -> None:
    """Bytes to a file, whole or not at all."""

    def write(temporary: Path) -> None:
        temporary.write_bytes(content)

    _write(path, write)


def _write_text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def read_json(path: Path) -> dict[str, Any] | None:
    """The dict in a JSON file, or None where there is no file.

    Raises:
        DataError: for a file that is not a JSON object.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise DataError(f"{path}: cannot be read as JSON ({error})") from error
    if not isinstance(content, dict):
        raise DataError(f"{path}: expected a JSON object")
    return content
