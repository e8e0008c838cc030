"""Exceptions of the package: each is one line that names the place, and ends a command with exit code 2; and notes."""

import warnings
from collections.abc import Sequence
from typing import Any

EXIT_INTERRUPTED = 130
"""Exit code of a command that Ctrl-C has ended."""


class BottomlockError(Exception):
    """Base of every error that the package raises on input.

    Its text is `PLACE: KEY FOUND, expected EXPECTED; HINT`, without what is not given.

    Args:
        found: what was found there.
        place: file, folder, row or section; "" for none.
        key: the key, column or option; "" for none.
        expected: what was expected in its place; "" where that is plain.
        hint: what to do, or the likely mistake; "" for none.

    Attributes:
        place, key, expected, hint: as text; of a key what stands within its quotes.

    Examples:
        >>> error = DataError("is empty", place="imu.csv: row 3", key="column 'time_s'", expected="a number")
        >>> str(error), error.place, error.expected
        ("imu.csv: row 3: column 'time_s' is empty, expected a number", 'imu.csv: row 3', 'a number')
    """

    exit_code = 2

    def __init__(
        self,
        found: object = "",
        *,
        place: object = "",
        key: str = "",
        expected: object = "",
        hint: object = "",
    ) -> None:
        self.place, self.expected, self.hint = str(place), str(expected), str(hint)
        _, quote, rest = key.partition("'")
        self.key = rest.removesuffix("'") if quote else key
        text = " ".join(part for part in (key, str(found)) if part)
        text = ", ".join(part for part in (text, f"expected {expected}" if self.expected else "") if part)
        text = ": ".join(part for part in (self.place, text) if part)
        super().__init__("; ".join(part for part in (text, self.hint) if part))


class ScenarioError(BottomlockError):
    """A scenario or geometry that is not valid."""


class KernelError(BottomlockError, ValueError):
    """Bad input to the kernel, in one line that names the field, row or time and what was expected.

    Attributes:
        taken: of a push to a `Navigator`, the number of readings that were taken before it; else 0.
        reports: their reports.
    """

    taken: int = 0
    reports: Sequence[Any] = ()


class DataError(BottomlockError):
    """Data (a log, a truth, a table) that are not valid."""


def bad_column(
    place: object, name: str, found: str, expected: object = "", *, row: int | None = None, hint: object = ""
) -> DataError:
    """The error of a column, or of its cell in a row, which counts from 0; otherwise as `BottomlockError`."""
    at = place if row is None else f"{place}: row {row}"
    return DataError(found, place=at, key=f"column '{name}'", expected=expected, hint=hint)


class OutputError(BottomlockError):
    """An output directory that cannot be written or holds something else."""


class EngineError(BottomlockError):
    """An engine that is not available or has failed."""


class Note(UserWarning):
    """One line on what was put right without an error: a command prints it and goes on."""


def note(message: str) -> None:
    """Gives a note, which a caller may filter, or turn into an error, as any warning."""
    warnings.warn(message, Note, stacklevel=3)
