"""Plain tables, CSV or Parquet: the documented columns, or others by a column map.

The map is a TOML file, or the `[columns]` of a geometry file. A velocity is taken as positive towards the bottom.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bottomlock.config.toml_file import parse_toml, read_text
from bottomlock.config.validation import checked
from bottomlock.errors import DataError
from bottomlock.files.table_file import check_regular, read_table_file
from bottomlock.io.beam_table import MOST_BEAMS, Account, Floats, Recording
from bottomlock.io.beams import Columns, beam_columns, read_mapped
from bottomlock.io.columns import column_names, numbers_of, read_flags
from bottomlock.io.rows import PLAIN, Options, make_table, raise_if_empty
from bottomlock.libraries import pl

NAME = "table"


def sniff_path(path: Path, head: bytes) -> bool:
    """Whether a file is Parquet, or CSV with the documented columns."""
    if head.startswith(b"PAR1"):
        return True
    names = {name.strip() for name in head.split(b"\n", 1)[0].split(b",")}
    return path.suffix.lower() == ".csv" and {b"time_ns", b"beam1_mps", b"beam1_valid"} <= names


def read_map(path: Path) -> Columns:
    """A column map from a TOML file, at its top or under `[columns]`.

    Raises:
        DataError: for what is not a file.
        ScenarioError: for a file that cannot be read, ill-formed TOML, or an unknown key.
    """
    check_regular(path)
    content = parse_toml(read_text(path), place=str(path))
    return checked(Columns, content.get("columns", content), str(path))


def read_path(path: Path, place: str, options: Options = PLAIN) -> Recording:
    """Reads a table of pings.

    Raises:
        DataError: naming file, row and column, as `read_beams`; without beam columns where the instrument's velocity
            alone is not requested.
        ScenarioError: for a bad column map.
    """
    columns = Columns() if options.columns is None else read_map(Path(options.columns))
    return read_frame(read_table_file(path), columns, place, options)


def read_frame(frame: pl.DataFrame, columns: Columns, place: str, options: Options = PLAIN) -> Recording:
    """The pings of a table that has been read.

    Raises:
        DataError: as `read_path`.
    """
    if not frame.height:
        raise DataError("has no rows", place=place)
    velocity_names, valid_names = _beam_columns(frame, columns, place, options)
    beams = len(velocity_names)
    account = Account(unit="row", read=frame.height)
    time_ns, velocity, valid = read_mapped(frame, velocity_names, valid_names, columns, place, account)
    flag = columns.instrument_valid
    table = make_table(
        account,
        beams,
        np.arange(frame.height),
        time_ns,
        velocity,
        valid,
        instrument=_floats(frame, columns.instrument, 3, place) * columns.velocity_scale,
        verdict=-1 if flag is None else read_flags(frame, (flag,), place)[:, 0],
        range_m=_floats(frame, columns.range, beams, place),
        quality=_floats(frame, columns.quality, beams, place),
        sd=_floats(frame, columns.sd, beams, place),
        negate=options.negate_beams,
    )
    raise_if_empty(account, place, "row")
    notes = [] if beams else ["no beam velocities: the table holds the instrument's velocity alone"]
    if beams and columns.lost_when_empty:
        notes = [
            "no column says which beams are valid: a beam counts as lost where its cell is empty, nowhere else"
        ]
    return Recording(
        format=NAME,
        table=table,
        account=account,
        frame="as recorded" if columns.instrument else "none",
        clock=f"column '{columns.time}' in {columns.time_unit}",
        time_of="record",
        quality="as recorded" if columns.quality else "",
        notes=notes,
    )


def _beam_columns(
    frame: pl.DataFrame, columns: Columns, place: str, options: Options
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of the velocity and validity columns, as mapped or documented."""
    beams = (
        sum(f"beam{k + 1}_mps" in frame.columns for k in range(MOST_BEAMS))
        if columns.velocity is None
        else len(columns.velocity)
    )
    if not beams and not options.instrument_only:
        raise DataError(
            "no beam velocities: no column 'beam1_mps', and no map that names others (there "
            f"are {column_names(frame)})",
            place=place,
            hint=(
                "record the beams, or convert the instrument's own velocity, mapped as "
                "'instrument', with --instrument-only"
            ),
        )
    return beam_columns(columns, beams, place)


def _floats(frame: pl.DataFrame, names: tuple[str, ...] | None, width: int, place: str) -> Floats:
    """The named columns, (n, width); NaN where no column is named."""
    if names is None:
        return np.full((frame.height, width), np.nan)
    if len(names) != width:
        raise DataError(f"the column map names {', '.join(names)}", place=place, expected=f"{width} columns")
    return numbers_of(frame, names, place)
