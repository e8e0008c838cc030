"""An output directory while a command writes to it: locked for all others."""

import json
import os
import socket
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any

from bottomlock.errors import OutputError, note
from bottomlock.files.atomic_write import make_folder

LOCK = ".lock"
"""The file in an output directory that says which process holds it; it goes when the process ends in order."""

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

    The lock of a process that has ended is taken over, with a note. Held twice by one thread it is one lock. On
    leaving, a directory that was made here and is still empty goes again.

    Raises:
        OutputError: for a directory that another process holds, naming it, or that cannot be made.
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
        with _lock_file(out) as file:
            _take(out, file)
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
def _lock_file(out: Path) -> Iterator[IO[str]]:
    """The lock file, open and locked by the operating system, which lets go of it when the process ends."""
    path = out / LOCK
    while True:
        try:
            # Not through a link, since the file is emptied.
            flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)
            file = os.fdopen(os.open(path, flags, 0o666), "r+", encoding="utf-8")
        except OSError as error:
            raise OutputError(f"cannot be written ({error.strerror or error})", place=out) from error
        with file:
            if not _lock(file, out):
                file.seek(0)
                raise OutputError(
                    f"is in use by {_words(_holder(file))}",
                    place=out,
                    hint="wait until it ends, or choose another directory",
                )
            # Whoever held it before may have removed the file between our opening and locking it.
            if _is_same(path, file):
                yield file
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


def _take(out: Path, file: IO[str]) -> None:
    """Writes who holds the directory, after one who ended without letting go."""
    file.seek(0)
    before = _holder(file)
    if before and before.get("host") not in {None, socket.gethostname()}:
        # Locks of one host are not always seen by another.
        raise OutputError(
            f"is in use by {_words(before)}",
            place=out,
            hint=f"if that process has ended, remove {out / LOCK}",
        )
    if before:
        note(f"{out}: was left by {_words(before)}, which has ended; taken over")
    holder = {
        "host": socket.gethostname(),
        "pid": os.getpid(),
        "since": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    file.truncate(0)
    file.write(json.dumps(holder))
    file.flush()


def _holder(file: IO[str]) -> dict[str, Any]:
    """Who wrote the lock; empty where nobody did, or its writing was cut."""
    try:
        content = json.loads(file.read())
    except (OSError, ValueError, RecursionError):
        return {}
    return content if isinstance(content, dict) else {}


def _words(holder: dict[str, Any]) -> str:
    if not holder:
        return "another process"
    return f"process {holder.get('pid')} on {holder.get('host')} since {holder.get('since')}"
