"""What may be written over: one rule for every command that writes.

A file that is there is replaced with `force` alone, and a file that a command reads never. A folder holds one result,
whose record names its files and the digests of what it was made from: the same result may be made again, another one
takes its place with `force` alone, and what no record names is neither replaced nor removed.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from bottomlock.errors import DataError, OutputError, note
from bottomlock.files.atomic_write import write_bytes
from bottomlock.files.output_folder import is_occupied, locked
from bottomlock.files.records import DIGESTS, read_record, write_record

MADE_FROM = "made_from"
"""Entry of a result's record: digests of what it was made from, by name; of records by their path."""

Files = dict[str, bytes | memoryview | str]
"""Contents by a file's name, `folder/name` in a folder."""

_RECORDS = ("manifest.json", "study.json", "*.record.json", "record-*.json")
_ENDING = ".record.json"


def check_free(*paths: Path, inputs: Iterable[Path] = (), force: bool = False) -> None:
    """Checks files that a command is to write: none is one that it reads, and none is there without `force`.

    Raises:
        OutputError: naming the file.
    """
    check_apart(paths, inputs)
    for path in paths:
        if os.path.lexists(path) and not force:
            raise OutputError(
                "is there already", place=path, hint="choose another name, or use --force to replace it"
            )


def check_apart(paths: Iterable[Path], inputs: Iterable[Path]) -> None:
    """Checks that no file to be written is one that is read, also through a link or under another name.

    Raises:
        OutputError: naming the file.
    """
    read = list(inputs)
    for path in paths:
        for one in read:
            if _is_same(path, one):
                raise OutputError(
                    f"is read by this command ({one})",
                    place=path,
                    hint="choose another name for what it writes",
                )


def _is_same(path: Path, other: Path) -> bool:
    try:
        return path.samefile(other)
    except (OSError, ValueError):
        return False


@dataclass(frozen=True)
class Result:
    """What a command writes to a folder, with the record `NAME.record.json`.

    Attributes:
        out: the folder.
        name: of the result.
        command: that makes it, for messages.
        made_from: digests of all that decides it, by name.
        inputs: files that are read for it.
        beside: it stands in the folder of what it was made from, and follows that: made again without `force`.
        resumes: a file that has changed is taken for damaged and made again without `force`.
    """

    out: Path
    name: str
    command: str
    made_from: Mapping[str, str]
    inputs: Sequence[Path] = ()
    beside: bool = False
    resumes: bool = False

    @property
    def record(self) -> Path:
        """The file of its record."""
        return self.out / f"{self.name}{_ENDING}"

    def check(self, *, force: bool = False) -> None:
        """Refuses, before anything is computed, a folder in which the result may not be written.

        Raises:
            OutputError: for a folder of something else, the same result of other inputs or with files that have
                changed since without `force`, and for a file that is read.
            DataError: for a record that is damaged.
        """
        self._names(force=force)

    def _names(self, *, force: bool) -> Mapping[str, str]:
        """The files that the record in the folder names, with their digests."""
        try:
            record = read_record(self.record)
        except DataError as error:
            raise DataError(
                error, hint="remove it and the files of that result, or choose another directory"
            ) from error
        if record is None:
            if not self.beside and is_occupied(self.out):
                raise OutputError(
                    f"is not empty and holds no result of `bottomlock {self.command}`, and not "
                    "even --force replaces what is not of ours",
                    place=self.out,
                    hint="choose another directory",
                )
            return {}
        names: dict[str, str] = record[DIGESTS]
        check_apart([self.out / name for name in names], self.inputs)
        if force:
            return names
        before = record.get(MADE_FROM, {})
        keys = {*before, *self.made_from}
        differing = sorted(key for key in keys if before.get(key) != self.made_from.get(key))
        if differing and not self.beside:
            raise OutputError(
                f"holds a result of `bottomlock {self.command}` that differs in: {', '.join(differing)}",
                place=self.out,
                hint="choose another directory or use --force to replace it",
            )
        is_finished = record.get("status") == "complete"
        for name, digest in names.items():
            if is_finished and not self.resumes and _has_changed(self.out / name, digest):
                raise OutputError(
                    "has changed since it was written",
                    place=self.out / name,
                    hint="move it away, or use --force to replace it",
                )
        return names

    def write(self, files: Files, *, force: bool = False) -> list[Path]:
        """Writes the files of the result and its record, and removes those of an earlier one.

        Args:
            files: their contents.
            force: as for `check`.

        Returns:
            The paths of the files.

        Raises:
            As `check`; OutputError too for a file that is there and is not of ours, and what cannot be written.
        """
        contents = {name: one.encode() if isinstance(one, str) else one for name, one in files.items()}
        with nullcontext() if self.beside else locked(self.out):
            # In this order: what a second process writes here is in the record before it is there.
            there = [name for name in contents if os.path.lexists(self.out / name)]
            before = self._names(force=force)
            for name in there:
                if name not in before:
                    raise OutputError(
                        "is there and not of ours, and not even --force replaces it",
                        place=self.out / name,
                        hint="move it away",
                    )
            check_apart([self.out / name for name in contents], self.inputs)
            _check_names(self.out, {**before, **contents})
            digests = {name: hashlib.sha256(content).hexdigest() for name, content in contents.items()}
            stated = {"kind": self.name, MADE_FROM: dict(self.made_from)}
            # Whatever is written is named beforehand, so that what a killed process leaves is known as ours.
            write_record(self.record, stated | {"status": "running"}, {**before, **digests})
            for name, content in contents.items():
                write_bytes(self.out / name, content)
            remove_named(self.out, before.keys() - contents.keys())
            write_record(self.record, stated | {"status": "complete"}, digests)
        return [self.out / name for name in contents]


def _has_changed(path: Path, digest: str) -> bool:
    """Whether a file is there, and is not the one of the digest."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest() != digest
    except FileNotFoundError:
        return False
    except OSError:
        return True


def digest_of(record: Mapping[str, Any]) -> str:
    """The digest of all files that a record states."""
    return hashlib.sha256(json.dumps(record[DIGESTS], sort_keys=True).encode()).hexdigest()


def digests_of(out: Path, records: Iterable[Path]) -> dict[str, str]:
    """Of the records that are there, the digests of what they state, by path from a folder (`MADE_FROM`).

    Raises:
        DataError: for a record that is damaged.
    """
    found = {path: read_record(path) for path in records}
    return {
        Path(os.path.relpath(path, out)).as_posix(): digest_of(record)
        for path, record in found.items()
        if record is not None
    }


def remove_outdated(folder: Path) -> None:
    """Removes, with a `Note`, the results in a folder that were made from records which state other files now.

    A file that has changed since it was written is the user's, and stays.

    Raises:
        OutputError: as `remove_named`.
    """
    for path in sorted(folder.glob(f"*{_ENDING}")):
        record = _readable(path)
        sources = [folder / one for one in (record or {}).get(MADE_FROM, {}) if one.endswith(".json")]
        if record is None or not sources:
            continue
        now = {Path(os.path.relpath(one, folder)).as_posix(): _readable(one) for one in sources}
        if any(one is not None and digest_of(one) != record[MADE_FROM][key] for key, one in now.items()):
            kept = {name for name, digest in record[DIGESTS].items() if _has_changed(folder / name, digest)}
            remove_named(folder, [*(record[DIGESTS].keys() - kept), path.name])
            name = path.name.removesuffix(_ENDING)
            left = f", but not {', '.join(sorted(kept))}, which you have changed" if kept else ""
            note(f"{folder}: its {name} was made from other tables and is removed{left}")


def named_in(out: Path, below: Sequence[str] = ()) -> Iterator[str]:
    """The files that the records in a folder name, and these records.

    Args:
        out: the folder.
        below: folders in it whose records, in them and below them, count as well.
    """
    tops = [out / name for name in below if (out / name).is_dir()]
    folders = [out, *tops, *(path for top in tops for path in top.rglob("*") if path.is_dir())]
    for folder in folders:
        for path in sorted({path for pattern in _RECORDS for path in folder.glob(pattern)}):
            record = _readable(path)
            if record is not None:
                yield from (
                    (folder.relative_to(out) / name).as_posix() for name in (path.name, *record[DIGESTS])
                )


def _readable(path: Path) -> dict[str, Any] | None:
    """A record; None for none and for one that is damaged, which names nothing."""
    try:
        return read_record(path)
    except DataError:
        return None


def remove_named(out: Path, names: Iterable[str]) -> None:
    """Removes files of ours, all or, where one of them is behind a link, none; and folders that are empty then.

    Raises:
        OutputError: for a link, through which nothing is removed, a name that leads elsewhere, and what cannot be
            removed.
    """
    names = list(names)
    _check_names(out, names)
    paths = [out / name for name in names]
    for path in paths:
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise OutputError(f"cannot be removed ({error.strerror or error})", place=path) from error
    folders = {folder for path in paths for folder in path.parents if out in folder.parents}
    for folder in sorted(folders, key=lambda one: len(one.parts), reverse=True):
        # One that holds something else stays.
        with suppress(OSError):
            folder.rmdir()


def _check_names(out: Path, names: Iterable[str]) -> None:
    """Checks that names lead to files in or below a folder, and not through links."""
    for name in names:
        parts = PurePosixPath(name.replace("\\", "/")).parts
        if not parts or Path(name).is_absolute() or parts[0] == "/" or ".." in parts:
            raise OutputError(
                f"a record names '{name}', which is no file below its folder",
                place=out,
                hint="nothing was changed",
            )
        for k in range(1, len(parts) + 1):
            path = out.joinpath(*parts[:k])
            if path.is_symlink():
                raise OutputError(
                    "is a symbolic link, and --force removes nothing through links",
                    place=path,
                    hint="remove the link yourself, or choose another directory",
                )
