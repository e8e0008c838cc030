"""An output directory while a command writes to it: locked for all others."""

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from bottomlock.errors import OutputError, note
from bottomlock.files.atomic_write import make_folder

LOCK = ".lock"
"""The file in an output directory that is locked while a process holds it; it goes when the process ends in order."""

_HELD: dict[Path, int] = {}
"""Directories that this process holds, and the thread that does."""


def is_occupied(out: Path) -> bool:
    """Whether `out` is there and holds more than a lock and manifests that were never finished.

    Raises:
        OutputError: for a path that cannot be read.
    """
    try:
        return out.exists() and (not out.is_dir() or any(not _is_leftover(path) for path in out.iterdir()))
    except (OSError, ValueError) as error:
        raise OutputError(
            f"cannot be read ({getattr(error, 'strerror', None) or error})", place=out
        ) from error


def _is_leftover(path: Path) -> bool:
    ours = path.name == LOCK or (
        path.name.startswith(".") and path.name.endswith(".part") and ".json." in path.name
    )
    return ours and path.is_file() and not path.is_symlink()


@contextmanager
def locked(out: Path) -> Iterator[None]:
    """Makes and holds a directory; a second process, or thread, that wants it gets an error at once.

    The operating system lets go of the lock when a process ends. Held twice by one thread it is one lock. On leaving,
    a directory that was made here and is still empty goes again.

    Raises:
        OutputError: for a directory that another process holds, or that cannot be made.
    """
    place = out.resolve()
    if _HELD.get(place) == threading.get_ident():
        yield
        return
    try:
        made = make_folder(out)
    except OSError as error:
        raise OutputError(f"cannot be written ({error.strerror or error})", place=out) from error
    try:
        with _lock_file(out):
            _HELD[place] = threading.get_ident()
            try:
                yield
            finally:
                del _HELD[place]
                # While it is still locked: nobody can have taken it in between.
                with suppress(OSError):
                    (out / LOCK).unlink()
    finally:
        with suppress(OSError):
            for folder in made:
                folder.rmdir()


@contextmanager
def _lock_file(out: Path) -> Iterator[None]:
    """Within it the lock file is open and locked."""
    path = out / LOCK
    while True:
        try:
            # Not through a link: another process would remove it.
            flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)
            file = os.fdopen(os.open(path, flags, 0o666), "r+", encoding="utf-8")
        except OSError as error:
            raise OutputError(f"cannot be written ({error.strerror or error})", place=out) from error
        with file:
            if not _lock(file, out):
                raise OutputError(
                    "is in use by another process",
                    place=out,
                    hint="wait until it ends, or choose another directory",
                )
            # Whoever held it before may have removed the file between our opening and locking it.
            if _is_same(path, file):
                yield
                return


def _lock(file: IO[str], out: Path) -> bool:
    """Whether the lock was free."""
    if sys.platform == "win32":
        note(f"{out}: this system has no lock; start no second command on this directory")
        return True
    import fcntl  # noqa: PLC0415 - it is not on every system

    try:
        fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        note(
            f"{out}: its file system has no locks ({error.strerror}); start no second command on this directory"
        )
    return True


def _is_same(path: Path, file: IO[str]) -> bool:
    try:
        return path.stat().st_ino == os.fstat(file.fileno()).st_ino
    except FileNotFoundError:
        return False
