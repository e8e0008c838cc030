"""Text tables as loggers write them: separators, comment lines, rows of units, missing headers, decimal commas."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import polars as pl

from bottomlock.errors import DataError
from bottomlock.files.table_file import check_memory, check_regular, read_parquet

SEPARATORS = (",", ";", "\t", "|", " ")
_HEAD = 65_536
_TIMES_ITS_SIZE = 8.0
"""Memory that reading a text takes, over its size."""
_SUFFIXES = {".parquet", ".pq"}
_COMMENTS = ("#", "%", "//")
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
        raw = path.read_bytes()
    except OSError as error:
        raise DataError(f"cannot be read ({error.strerror or error})", place=path) from error
    if b"\0" in raw[:_HEAD]:
        raise DataError("holds binary data of no known format", place=path)
    try:
        text, latin = raw.decode("utf-8-sig"), False
    except UnicodeDecodeError:
        text, latin = raw.decode("latin-1"), True
    return _read_text(path, text, plain=not latin)


def _read_text(path: Path, text: str, *, plain: bool) -> AnyTable:
    lines = text.splitlines()
    rows = [k for k, line in enumerate(lines[:400]) if line.strip()]
    data = [k for k in rows if not lines[k].lstrip().startswith(_COMMENTS)]
    separator = _separator([lines[k] for k in data[:60]])
    if separator is None or len(data) < 2:
        raise DataError(
            (
                "is in no format that `bottomlock convert` knows and is no table: expected two or "
                "more columns, separated by commas, semicolons, tabs or spaces"
            ),
            place=path,
        )
    header, first_row = _header(path, lines, rows, data, separator)
    units: dict[str, str] = {}
    body_cells = _cells(lines[first_row], separator)
    next_rows = [k for k in data if k > first_row]
    if next_rows and not _has_number(body_cells) and _has_number(_cells(lines[next_rows[0]], separator)):
        units = {name: cell.strip("[]() ") for name, cell in zip(header, body_cells, strict=False)}
        first_row = next_rows[0]
    comments = [lines[k] for k in rows if k > first_row and lines[k].lstrip().startswith(_COMMENTS)]
    frame = _frame(path, lines[first_row:], header, separator)
    simple = (
        plain and separator == "," and first_row == 1 and not comments and not units
        and _cells(lines[0], separator) == list(header) and not _decimal_comma(frame, separator)
    )  # fmt: skip
    frame = _points(frame, separator)
    names = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars", " ": "spaces"}
    words = (
        "" if simple else f"columns are separated by {names[separator]}, data begin at line {first_row + 1}"
    )
    return AnyTable(path, frame, simple, units, words)


def _cells(line: str, separator: str) -> list[str]:
    parts = line.split() if separator == " " else line.split(separator)
    return [part.strip().strip('"').strip() for part in parts]


def _separator(lines: list[str]) -> str | None:
    """The separator that cuts the last lines, which are data, into the same number of cells, two or more.

    One that cuts the first line, the header, as often comes before one that does not: a decimal comma cuts data alone.
    """
    if not lines:
        return None
    tail = lines[-max(2, len(lines) // 2) :]
    fitting = []
    for separator in SEPARATORS:
        counts = {len(_cells(line, separator)) for line in tail}
        if (
            len(counts) == 1
            and max(counts) > 1
            and any(_numeric(c) and c for c in _cells(tail[-1], separator))
        ):
            fitting.append(separator)
    agreeing = [one for one in fitting if len(_cells(lines[0], one)) == len(_cells(tail[-1], one))]
    return next(iter([*agreeing, *fitting]), None)


def _numeric(cell: str) -> bool:
    """Whether a cell is a number, with a decimal point or comma."""
    return is_number(cell) or is_number(cell.replace(",", ".", 1))


def _has_number(cells: Sequence[str]) -> bool:
    return any(_numeric(cell) for cell in cells if cell)


def _header(
    path: Path, lines: list[str], rows: list[int], data: list[int], separator: str
) -> tuple[list[str], int]:
    """Names of the columns, and the line where what is below them begins.

    Raises:
        DataError: where neither the first line nor a comment above it names them.
    """
    width = len(_cells(lines[data[-1]], separator))
    first = next((k for k in data if len(_cells(lines[k], separator)) == width), data[0])
    cells = _cells(lines[first], separator)
    if not _has_number(cells):
        return _unique(cells), next((k for k in rows if k > first), first)
    above = [k for k in rows if k < first]
    if above:
        bare = lines[above[-1]].lstrip().lstrip("#%/").strip()
        named = _cells(bare, separator)
        if len(named) != width and separator == ",":
            named = bare.split()
        if len(named) == width and not _has_number(named):
            return _unique(named), first
    shown = ", ".join([*cells[:8], *(["..."] if width > 8 else [])])
    raise DataError(
        f"names none of its {width} columns; the first row is {shown}",
        place=path,
        expected="a line of their names above the numbers",
        hint=NAMES,
    )


def _unique(names: list[str]) -> list[str]:
    found: list[str] = []
    for k, name in enumerate(names):
        base = name or f"column_{k + 1}"
        found.append(base if base not in found else f"{base}_{k + 1}")
    return found


def _frame(path: Path, lines: list[str], header: list[str], separator: str) -> pl.DataFrame:
    kept = [line for line in lines if line.strip() and not line.lstrip().startswith(_COMMENTS)]
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


def _decimal_comma(frame: pl.DataFrame, separator: str) -> bool:
    first = [cell or "" for cell in frame.row(0)]
    return separator != "," and any(re.fullmatch(r"[-+]?\d+,\d+([eE][-+]?\d+)?", cell) for cell in first)


def _points(frame: pl.DataFrame, separator: str) -> pl.DataFrame:
    return frame.select(pl.all().str.replace(",", ".")) if _decimal_comma(frame, separator) else frame
