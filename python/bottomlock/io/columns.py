"""Columns of CSV and Parquet files as numbers; errors name missing columns and cells, empty cells are NaN."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bottomlock.errors import DataError, bad_column
from bottomlock.files.atomic_write import read_json
from bottomlock.files.records import DIGESTS, OWN_DIGEST, read_record, sha256_of
from bottomlock.files.table_file import read_table_file
from bottomlock.io.sentences import printable
from bottomlock.libraries import pl

WATER_ENDING = "_water"
"""What the name of a water table has after that of the beam table, whose account is its own."""

_REMEDY = "convert the log again, or remove the account if the change is meant"


def check_converted(path: Path) -> None:
    """Checks a Parquet file that has an account of `bottomlock convert` beside it; any other file passes.

    Raises:
        DataError: for a table or an account that has changed since the conversion.
    """
    account, tables = path.with_suffix(".json"), 1
    if not account.is_file() and path.stem.endswith(WATER_ENDING):
        # Only an account of two tables has one of the water; without, it is the user's own.
        account, tables = path.with_name(path.stem.removesuffix(WATER_ENDING) + ".json"), 2
    if path.suffix.lower() != ".parquet" or not account.is_file() or not path.is_file():
        return
    try:
        content = read_json(account)
        if content is None or not {OWN_DIGEST, DIGESTS} & content.keys():
            return
        digests = (read_record(account) or {}).get(DIGESTS, {})
    except DataError as error:
        raise DataError(error, hint=_REMEDY) from error
    if len(digests) < tables:
        return
    # Both may have been renamed together.
    if sha256_of(path) not in digests.values():
        raise DataError(
            f"has changed since `bottomlock convert` wrote it ({account.name} has another SHA-256)",
            place=path,
            hint=_REMEDY,
        )


NS_OF: Mapping[str, int] = {"ns": 1, "us": 1_000, "ms": 1_000_000, "s": 1_000_000_000}
"""Nanoseconds of a unit of time."""

LATEST_NS = 2**62
"""Bound of the times of a table, ns (146 years): differences of two still fit 64 bits."""

FLAG_WORDS: Mapping[str, str] = {
    "true": "1", "false": "0", "yes": "1", "no": "0", "valid": "1", "invalid": "0", "good": "1", "bad": "0",
}  # fmt: skip
"""Words of a flag, in small letters, and their numbers."""

FASTEST_MPS = 30.0
"""Speed beyond which a velocity of a DVL is a code for "no reading": 32.768, 88.888, 999, 9.97e36."""

_SHOWN = 12
"""Columns that an error lists."""


def is_code(velocity_mps: NDArray[np.float64], without_range: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which velocities are codes for "no reading".

    Args:
        velocity_mps: of any shape.
        without_range: where exactly 0 stands for no reading, as by a range of 0 or less.

    >>> is_code(np.array([0.3, -32.768, 0.0, 0.0, np.nan]), np.array([True, False, True, False, True])).tolist()
    [False, True, True, False, False]
    """
    too_fast = np.isfinite(velocity_mps) & (np.abs(velocity_mps) > FASTEST_MPS)
    return np.asarray(too_fast | ((velocity_mps == 0.0) & without_range))


def read_rows(path: Path) -> pl.DataFrame:
    """A table with a row at least.

    Raises:
        DataError: as `read_table_file`, and for a file without rows.
    """
    check_converted(path)
    table = read_table_file(path)
    if not table.height:
        raise DataError("has no rows", place=path)
    return table


def named_column(table: pl.DataFrame, name: str, place: str) -> pl.Series:
    """A column without conversion.

    Raises:
        DataError: for a missing column, listing the columns of the file.
    """
    if name not in table.columns:
        raise bad_column(place, name, f"is missing (there are {column_names(table)})")
    return table[name]


def column_names(table: pl.DataFrame) -> str:
    """The first names of a table's columns for one line of a message, whatever they hold."""
    more = ", ..." if len(table.columns) > _SHOWN else ""
    return printable(", ".join(table.columns[:_SHOWN])) + more


def number_series(
    table: pl.DataFrame, name: str, place: str, dtype: pl.DataType, *, words: bool = False
) -> pl.Series:
    """A column as numbers, null or NaN where a cell is empty; with `words`, those of a flag are 1 and 0.

    Raises:
        DataError: naming column and row, for a column that is missing or a cell that is no number.
    """
    column = named_column(table, name, place)
    if column.dtype == pl.String:
        return numbers_of_text(column, name, place, dtype, words=words)
    if not column.dtype.is_numeric() and column.dtype not in {pl.Boolean, pl.Null}:
        raise bad_column(place, name, f"is {column.dtype}", "numbers")
    return _cast(column, name, place, dtype)


def _cast(column: pl.Series, name: str, place: str, dtype: pl.DataType) -> pl.Series:
    """Numbers as another type.

    Raises:
        DataError: naming column and row, for one that the type cannot hold.
    """
    numbers = column.cast(dtype, strict=False)
    bad = (numbers.is_null() & column.is_not_null()).arg_true()
    if len(bad):
        row = int(bad[0])
        raise bad_column(place, name, f"is {column[row]}", "a whole number that 64 bits can hold", row=row)
    return numbers


def nanoseconds(column: pl.Series, name: str, place: str, unit: str) -> pl.Series:
    """Times in a unit of `NS_OF` as Float64 to whole nanoseconds; null where there is none.

    Raises:
        DataError: naming column and row, for a time that 64 bits cannot hold.
    """
    return _cast((column.fill_nan(None) * NS_OF[unit]).round(), name, place, pl.Int64())


def unix_times(text: pl.Series) -> pl.Series:
    """Unix times, ns, of dates and times after ISO 8601, UTC where they state no zone; null for other cells.

    >>> unix_times(pl.Series(["1970-01-01T00:00:00.5Z", "1970-01-01 01:00:01+01:00", "noon"])).to_list()
    [500000000, 1000000000, None]
    """
    text = text.str.strip_chars().str.replace(" ", "T", literal=True).str.replace(",", ".", literal=True)
    zoned = text.str.contains(r"(Z|[+-]\d\d:?\d\d)$")
    parsed = (
        pl.when(zoned).then(text).otherwise(text + "Z").str.to_datetime("%+", time_unit="ns", strict=False)
    )
    return pl.select(parsed).to_series().dt.timestamp("ns")


def numbers_of_text(
    column: pl.Series, name: str, place: str, dtype: pl.DataType, *, words: bool = False
) -> pl.Series:
    """Text as numbers, as `number_series`.

    Raises:
        DataError: naming column and row, for a cell that is no number.
    """
    text = column.str.strip_chars()
    lower = text.str.to_lowercase()
    empty = text.is_null() | lower.is_in(["", "nan"])
    numbers = (lower.replace(FLAG_WORDS) if words else text).cast(dtype, strict=False)
    bad = (numbers.is_null() & ~empty).arg_true()
    if len(bad):
        expected = f"a number, or a flag as {', '.join(FLAG_WORDS)}" if words else "a number"
        found = printable(text[int(bad[0])])
        raise bad_column(place, name, f"is '{found}'", expected, row=bad[0])
    return numbers


def column_numbers(table: pl.DataFrame, name: str, place: str, *, words: bool = False) -> NDArray[np.float64]:
    """A column as numbers (n,), NaN where it is empty.

    Raises:
        DataError: as `number_series`.
    """
    series = number_series(table, name, place, pl.Float64(), words=words)
    return np.array(series.fill_null(np.nan).to_numpy(), dtype=np.float64)


def whole_numbers(table: pl.DataFrame, name: str, place: str) -> NDArray[np.int64]:
    """A column as whole numbers (n,).

    Raises:
        DataError: for a column that is missing or has other numbers, and naming the row of an empty cell.
    """
    series = named_column(table, name, place)
    if not series.dtype.is_integer():
        raise bad_column(place, name, f"is {series.dtype}", "whole numbers")
    if series.null_count():
        raise bad_column(place, name, "is empty", row=int(series.is_null().arg_max() or 0))
    return np.asarray(series.to_numpy(), dtype=np.int64)


def numbers_of(table: pl.DataFrame, names: Sequence[str], place: str) -> NDArray[np.float64]:
    """The named columns as numbers (n, columns), NaN where a cell is empty.

    Raises:
        DataError: as `column_numbers`.
    """
    parts = [column_numbers(table, name, place) for name in names]
    return np.stack(parts, axis=1) if parts else np.empty((table.height, 0))


def read_flags(table: pl.DataFrame, names: Sequence[str], place: str) -> NDArray[np.bool_]:
    """Columns of 0 and 1, or of the words of a flag (`FLAG_WORDS`), as an array (n, columns).

    Raises:
        DataError: naming row and column, for anything else.
    """
    flags = []
    for name in names:
        series = number_series(table, name, place, pl.Float64(), words=True)
        bad = (series.is_null() | ~series.is_in([0.0, 1.0])).arg_true()
        if len(bad):
            raise bad_column(place, name, f"is {series[int(bad[0])]}", "0, 1, true or false", row=bad[0])
        flags.append(series.to_numpy() == 1.0)
    return np.stack(flags, axis=1)


def frame_of(columns: Mapping[str, Any] | Sequence[Mapping[str, Any]]) -> pl.DataFrame:
    """A table of columns, or of rows, null for NaN."""
    return pl.DataFrame(columns, infer_schema_length=None).with_columns(pl.col(pl.Float64).fill_nan(None))


def check_rising(times: NDArray[np.int64], name: str, place: str) -> None:
    """Checks that times of a column, ns (n,), rise strictly.

    Raises:
        DataError: naming row and column, for a time that repeats or goes back.
    """
    steps = np.flatnonzero(np.diff(times) <= 0)
    if steps.size:
        row = int(steps[0]) + 1
        what = "repeats the time" if times[row] == times[row - 1] else "goes back in time from that"
        raise bad_column(
            place, name, f"is {times[row]} ns and {what} of row {row - 1}", "rising times", row=row
        )


def check_valid(
    velocity_mps: NDArray[np.float64], valid: NDArray[np.bool_], names: Sequence[str], place: str
) -> None:
    """Checks that valid beams have a velocity.

    Args:
        velocity_mps, valid: (n, beams).
        names: of the columns of the velocities.
        place: names the table in errors.

    Raises:
        DataError: naming row and column, for a valid beam without a finite velocity.
    """
    wrong = np.argwhere(valid & ~np.isfinite(velocity_mps))
    if wrong.size:
        row, beam = (int(index) for index in wrong[0])
        raise bad_column(
            place,
            names[beam],
            f"is not finite, but beam {beam + 1} is flagged valid",
            "a finite velocity or a cleared flag",
            row=row,
        )
