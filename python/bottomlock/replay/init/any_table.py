"""Text tables as loggers write them: separators, comment lines, rows of units, missing headers, decimal commas."""

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import polars as pl

from bottomlock.errors import DataError
from bottomlock.files.table_file import check_memory, check_regular, read_parquet
from bottomlock.io.columns import FLAG_WORDS
from bottomlock.io.formats import utf8
from bottomlock.io.sentences import printable
from bottomlock.replay.init.names import named, time_unit

SEPARATORS = (",", ";", "\t", "|", " ")
_HEAD = 65_536
_TIMES_ITS_SIZE = 8.0
"""Memory that reading a text takes, over its size."""
_SUFFIXES = {".parquet", ".pq"}
_COMMENTS = ("#", "%", "//")
PACKED = (b"\x1f\x8b", b"PK\x03\x04")
"""How gzip and zip begin; a workbook of a spreadsheet is a zip."""
MOST_ZEROS = 0.01
"""Part of the bytes that are zero from which a file is no text; a logger that loses its power leaves some."""
NAMES = (
    "name them as ax, ay, az, wx, wy, wz (IMU), roll, pitch, yaw, depth, latitude, longitude, vx, vy, vz or "
    "beam1_mps ..., with time"
)
"""What to do about columns that are not known by their names."""


@dataclass(frozen=True, eq=False)
class AnyTable:
    """A table as read.

    Attributes:
        path: the file.
        frame: its columns; text of a text file, without spaces around the cells.
        plain: whether the file can be read as it is, by its own column names.
        units: unit of a column as a row below the header states it, by the column's name.
        words: how it was read, for an error or a comment.
        part: topic or message of a log that holds several tables; "" for a file of one.
        remark: what has to be said where the table is used; "".
        independent: whether it is measured, not estimated from other streams of the log.
    """

    path: Path
    frame: pl.DataFrame
    plain: bool
    units: dict[str, str]
    words: str = ""
    part: str = ""
    remark: str = ""
    independent: bool = True

    @property
    def label(self) -> str:
        """What names the table, in lower case: its part, or the file."""
        return (self.part or self.path.stem).lower()


def is_number(cell: str) -> bool:
    """Whether a cell is a number, "nan" or empty.

    >>> [is_number(cell) for cell in ("1e-3", "nan", "", "2024-05-01", "x")]
    [True, True, True, False, False]
    """
    try:
        float(cell.strip().strip('"') or "nan")
    except ValueError:
        return False
    return True


def read_any_table(path: Path) -> AnyTable:
    """Reads Parquet, or text with any of the usual separators.

    Raises:
        DataError: for what is not a table of two columns and two rows or more, and one without names of its columns.
    """
    if path.suffix.lower() in _SUFFIXES:
        return AnyTable(path, read_parquet(path), plain=True, units={}, words="Parquet")
    check_regular(path)
    check_memory(path, _TIMES_ITS_SIZE * path.stat().st_size)
    try:
        written = path.read_bytes()
    except OSError as error:
        raise DataError(f"cannot be read ({error.strerror or error})", place=path) from error
    if written.startswith(PACKED):
        raise DataError("is compressed", place=path, hint="unpack it; export a workbook as CSV")
    raw = utf8(written)
    if raw[:_HEAD].count(b"\0") > MOST_ZEROS * len(raw[:_HEAD]):
        raise DataError("holds binary data of no known format", place=path)
    # A replay's reader takes no zeros, and a carriage return alone for no end of a line.
    plain, raw = written.endswith(raw) and b"\n" in raw and b"\0" not in raw, raw.replace(b"\0", b"")
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError:
        text, plain = raw.decode("latin-1"), False
    return _read_text(path, text, plain=plain)


def _read_text(path: Path, text: str, *, plain: bool) -> AnyTable:
    lines = text.splitlines()
    rows = [k for k, line in enumerate(lines[:400]) if line.strip()]
    data = [k for k in rows if not lines[k].lstrip().startswith(_COMMENTS)]
    if len(data) < 2:
        found = f"has no rows: {len(data)} lines that are no comment"
        raise DataError(found, place=path, hint="leave the file out")
    cut = _separator([lines[k] for k in data[:60]])
    if cut is None:
        raise DataError(
            (
                "is in no format that `bottomlock convert` knows and is no table: expected two or "
                "more columns, separated by commas, semicolons, tabs or spaces"
            ),
            place=path,
        )
    separator, width = cut
    closed = _closed(lines, data, separator, width)
    if closed:
        lines, width, plain = [line.rstrip().removesuffix(separator) for line in lines], width - 1, False
    names_at, units_at, first_row = _head_lines(lines, data, separator, width)
    header = _header(path, lines, rows, names_at, first_row, separator, width)
    units: dict[str, str] = {}
    if units_at is not None:
        cells = _cells(lines[units_at], separator)
        units = {name: cell.strip("[]() ") for name, cell in zip(header, cells, strict=False)}
    body, left_out = _whole_lines(lines, first_row, names_at, separator, width)
    frame = _frame(path, body, header, separator)
    points = not _decimal_comma(frame)
    frame, no_numbers = _numbers_alone(frame if points else frame.select(pl.all().str.replace(",", ".")))
    as_it_is = names_at == 0 and first_row == 1 and len(body) == len(lines) - 1
    simple = (
        plain and separator == "," and as_it_is and points and not no_numbers
        and lines[0].replace('"', "").split(",") == header
    )  # fmt: skip
    names = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars", " ": "spaces"}
    words = (
        "" if simple else f"columns are separated by {names[separator]}, data begin at line {first_row + 1}"
    )
    return AnyTable(path, frame, simple, units, words, remark="; ".join(filter(None, (left_out, no_numbers))))


def _cells(line: str, separator: str) -> list[str]:
    if separator == " ":
        parts = line.split()
    elif '"' in line:
        parts = next(csv.reader([line], delimiter=separator, skipinitialspace=True))
    else:
        parts = line.split(separator)
    return [part.strip().strip('"').strip() for part in parts]


def _count(line: str, separator: str) -> int:
    """Cells of a line."""
    return line.count(separator) + 1 if separator != " " and '"' not in line else len(_cells(line, separator))


MOST_LINES = 0.75
"""Part of the lines that have the cells of a table; the others are damaged, or stand above it."""


def _separator(lines: list[str]) -> tuple[str, int] | None:
    """The separator that cuts most of the last lines, which are data, into as many cells, and how many: two or more.

    One that cuts the line above the data, the header, as often comes before one that does not: a decimal comma cuts
    data alone.
    """
    if not lines:
        return None
    tail = lines[-max(2, len(lines) // 2) :]
    fitting = []
    for separator in SEPARATORS:
        width, often = Counter(_count(line, separator) for line in tail).most_common(1)[0]
        whole = [line for line in tail if _count(line, separator) == width]
        if (
            width > 1
            and often >= MOST_LINES * len(tail)
            and any(_numeric(c) and c for c in _cells(whole[-1], separator))
        ):
            fitting.append((separator, width))
    agreeing = [one for one in fitting if _count(_above(lines, *one), one[0]) == one[1]]
    return next(iter([*agreeing, *fitting]), None)


def _closed(lines: list[str], data: list[int], separator: str, width: int) -> bool:
    """Whether a separator stands behind the last value of every row, and not behind the last name."""
    rows = [lines[k].rstrip() for k in data if _count(lines[k], separator) == width]
    above = _above([lines[k] for k in data], separator, width)
    return _count(above, separator) == width - 1 and all(row.endswith(separator) for row in rows)


def _above(lines: list[str], separator: str, width: int) -> str:
    """The line above the first line of numbers; the first of all where there is none above."""
    first = next((k for k, line in enumerate(lines) if _is_data(line, separator, width)), 0)
    return lines[max(first - 1, 0)]


def _is_data(line: str, separator: str, width: int) -> bool:
    return _count(line, separator) == width and _has_number(_cells(line, separator))


def _numeric(cell: str) -> bool:
    """Whether a cell is a number, with a decimal point or comma."""
    return is_number(cell) or is_number(cell.replace(",", ".", 1))


def _has_number(cells: Sequence[str]) -> bool:
    return any(_numeric(cell) for cell in cells if cell)


def _head_lines(
    lines: list[str], data: list[int], separator: str, width: int
) -> tuple[int | None, int | None, int]:
    """The line of names, the line of units below it, and the first line of numbers; None where there is none.

    Of several lines of as many cells above the numbers, the one with the most known names is that of the names.
    """
    first = next((k for k in data if _is_data(lines[k], separator, width)), data[-1])
    above = [k for k in data if k < first and _count(lines[k], separator) == width]
    if not above:
        return None, None, first
    known = {
        k: sum(named(one) is not None or time_unit(one) is not None for one in _cells(lines[k], separator))
        for k in above
    }
    names_at = max(above, key=lambda k: known[k])
    return names_at, next((k for k in above if k > names_at), None), first


def _header(
    path: Path,
    lines: list[str],
    rows: list[int],
    names_at: int | None,
    first: int,
    separator: str,
    width: int,
) -> list[str]:
    """Names of the columns.

    Raises:
        DataError: where neither a line above the numbers nor a comment there names them.
    """
    if names_at is not None:
        return _unique(_cells(lines[names_at], separator))
    above = [k for k in rows if k < first]
    if above:
        bare = lines[above[-1]].lstrip().lstrip("#%/").strip()
        found = _cells(bare, separator)
        if len(found) != width and separator == ",":
            found = bare.split()
        if len(found) == width and not _has_number(found):
            return _unique(found)
    cells = _cells(lines[first], separator)
    shown = ", ".join([*cells[:8], *(["..."] if width > 8 else [])])
    raise DataError(
        f"names none of its {width} columns; the first row is {shown}",
        place=path,
        expected="a line of their names above the numbers",
        hint=NAMES,
    )


FEW_SHORT = 0.05
"""Part of the lines with fewer cells than the others up to which they are damaged; more leave out empty cells."""


def _whole_lines(
    lines: list[str], first_row: int, names_at: int | None, separator: str, width: int
) -> tuple[list[str], str]:
    """The lines of data, and which are left out: damaged ones, and the names once more."""
    names = "" if names_at is None else lines[names_at]
    below = [
        (k, line) for k, line in enumerate(lines[first_row:], first_row + 1)
        if line.strip() and not line.lstrip().startswith(_COMMENTS)
    ]  # fmt: skip
    short = [k for k, line in below if _count(line, separator) < width]
    damaged = set(short) if len(short) <= max(FEW_SHORT * len(below), 1) else set()
    damaged |= {k for k, line in below if line == names or line.count('"') % 2}
    if not damaged:
        return [line for _, line in below], ""
    words = f"{len(damaged)} lines are cut off or repeat the names, the first of them line {min(damaged)}"
    return [line for k, line in below if k not in damaged], f"{words}: they are left out"


def _unique(names: list[str]) -> list[str]:
    found: list[str] = []
    for k, name in enumerate(names):
        base = name or f"column_{k + 1}"
        found.append(base if base not in found else f"{base}_{k + 1}")
    return found


def _frame(path: Path, kept: list[str], header: list[str], separator: str) -> pl.DataFrame:
    if separator == " ":
        kept, separator = [",".join(line.split()) for line in kept], ","
    body = "\n".join(kept) + "\n"
    try:
        frame = pl.read_csv(
            body.encode(),
            separator=separator,
            has_header=False,
            infer_schema=False,
            truncate_ragged_lines=True,
        )
    except (Exception, pl.exceptions.PanicException) as error:
        raise DataError(
            f"cannot be read as a table ({str(error).splitlines()[0][:200]})", place=path
        ) from error
    if frame.width < len(header):
        raise DataError(f"has {frame.width} columns, and its header names {len(header)}", place=path)
    frame = frame.select(frame.columns[: len(header)])
    frame.columns = header
    return frame.select(pl.all().str.strip_chars().str.strip_chars('"'))


def _decimal_comma(frame: pl.DataFrame) -> bool:
    """Whether the first row has a number with a comma, which separates no columns: then it is quoted."""
    first = [cell or "" for cell in frame.row(0)]
    return any(re.fullmatch(r"[-+]?\d+,\d+([eE][-+]?\d+)?", cell) for cell in first)


def _numbers_alone(frame: pl.DataFrame) -> tuple[pl.DataFrame, str]:
    """The table without words for "no reading" in its columns of numbers, and what they are."""
    said = []
    for name in frame.columns:
        text = frame[name].str.to_lowercase().replace(FLAG_WORDS)
        filled = text.is_not_null() & (text != "")
        words = filled & text.cast(pl.Float64, strict=False).is_null()
        if not words.any() or int(words.sum()) > 0.5 * int(filled.sum()):
            continue
        said.append(
            f"{words.sum()} cells of {name} are no numbers ('{printable(frame[name].filter(words)[0])}')"
        )
        frame = frame.with_columns(pl.when(words).then(None).otherwise(pl.col(name)).alias(name))
    return frame, "; ".join(said[:MOST_SAID]) + (": they count as empty" if said else "")


MOST_SAID = 3
"""Columns with words that are named."""
