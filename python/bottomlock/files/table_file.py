"""Reads tables from files of a user, Parquet or CSV: what a damaged file does to the library ends here, in one line."""

from __future__ import annotations

import contextlib
import math
import os
import stat
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from bottomlock.errors import DataError
from bottomlock.files.parquet_check import check_parquet
from bottomlock.support.later import pl

_PARQUET = {".parquet", ".pq"}
_TIMES_ITS_SIZE = 7.0
"""Memory that reading a text takes, over its size (measured: 5.3 and what the interpreter holds)."""


def check_regular(path: Path) -> None:
    """Checks that a path is a file that ends.

    Raises:
        DataError: for a missing file, a folder, a pipe or a device.
    """
    try:
        mode = path.stat().st_mode
    except FileNotFoundError as error:
        raise DataError("no such file", place=path) from error
    except (OSError, ValueError) as error:
        raise DataError(
            f"cannot be read ({getattr(error, 'strerror', None) or error})", place=path
        ) from error
    if stat.S_ISDIR(mode):
        raise DataError("is a folder", place=path, expected="a file")
    if not stat.S_ISREG(mode):
        raise DataError(
            "is a pipe or a device", place=path, expected="a file", hint="save the data to a file first"
        )


def check_memory(path: Path | str, needed_bytes: float) -> None:
    """Checks that what is to be read fits into the memory: where it does not, the system may end the program instead.

    Args:
        path: what is read.
        needed_bytes: about what reading takes.

    Raises:
        DataError: where less is available.
    """
    available = available_memory_bytes()
    if needed_bytes > available:
        raise DataError(
            (
                f"reading it takes about {needed_bytes / 1000000000.0:.1f} GB of memory, and "
                f"{available / 1000000000.0:.1f} GB are available"
            ),
            place=path,
            hint="cut it into parts of a dive each, or use a machine with more",
        )


def content(path: Path, times_its_size: float) -> bytes:
    """The bytes of a file, if reading it takes no more memory than there is.

    Args:
        path: the file.
        times_its_size: memory that its reader takes, over its size.

    Raises:
        DataError: where it cannot be read, or is too large for the memory.
    """
    try:
        check_memory(path, times_its_size * path.stat().st_size)
        return path.read_bytes()
    except OSError as error:
        raise DataError(f"cannot be read ({error.strerror or error})", place=path) from error


def available_memory_bytes() -> float:
    """Memory that this process may still take: the machine's, its container's or its own limit; infinite if unknown."""
    bounds = [math.inf]
    with contextlib.suppress(OSError, ValueError, IndexError):
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        bounds += [1024.0 * float(line.split()[1]) for line in lines if line.startswith("MemAvailable:")]
    with contextlib.suppress(OSError, ValueError):
        group = Path("/sys/fs/cgroup")
        stated = (group / "memory.stat").read_text(encoding="ascii").splitlines()
        taken = {name: float(value) for name, value in (line.split() for line in stated)}
        bounds.append(float((group / "memory.max").read_text(encoding="ascii")) - taken.get("anon", 0.0))
    with contextlib.suppress(ImportError, OSError, ValueError, IndexError):
        import resource  # noqa: PLC0415 - not on Windows

        limit = float(resource.getrlimit(resource.RLIMIT_AS)[0])
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
        if limit > 0.0 and limit != float(resource.RLIM_INFINITY):
            bounds.append(limit - float(pages * resource.getpagesize()))
    return max(min(bounds), 0.0)


def read_table_file(path: Path) -> pl.DataFrame:
    """CSV (as text) or Parquet as a table.

    Raises:
        DataError: for what is not a file, or cannot be read.
    """
    if path.suffix.lower() in _PARQUET:
        return read_parquet(path)
    check_regular(path)
    check_memory(path, _TIMES_ITS_SIZE * path.stat().st_size)
    # Text first: a number that cannot be read is then reported with its row, not dropped.
    return _read(path, lambda: pl.read_csv(path, infer_schema=False, glob=False))


def read_parquet(path: Path, columns: Sequence[str] | None = None) -> pl.DataFrame:
    """A Parquet file, or some of its columns.

    Raises:
        DataError: for what is not a file, or cannot be read: damaged, cut off, or without a column.
    """

    def read() -> pl.DataFrame:
        check_parquet(path)
        return pl.read_parquet(path, columns=None if columns is None else list(columns), glob=False)

    return _read(path, read)


def _read(path: Path, read: Callable[[], pl.DataFrame]) -> pl.DataFrame:
    check_regular(path)
    try:
        with _silent():
            return read()
    except DataError:
        raise
    # A damaged file makes the library raise anything, also a panic, which is no Exception.
    except (Exception, pl.exceptions.PanicException) as error:
        text = str(error).strip() or type(error).__name__
        raise DataError(f"cannot be read ({text.splitlines()[0][:200]})", place=path) from error


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """Without the trace that a panic in compiled code writes to the standard error, past Python."""
    try:
        kept, sink = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    except OSError:
        yield
        return
    try:
        os.dup2(sink, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(sink)
