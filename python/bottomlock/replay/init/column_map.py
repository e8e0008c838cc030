"""A commented column map of a plain table: what `bottomlock convert --init` writes."""

from collections.abc import Iterator
from pathlib import Path

from bottomlock.errors import DataError, OutputError
from bottomlock.files.atomic_write import write_text
from bottomlock.files.overwriting import check_free
from bottomlock.io.columns import column_names
from bottomlock.replay.init.any_table import AnyTable, read_any_table
from bottomlock.replay.init.beam_columns import BeamColumns, beam_columns
from bottomlock.replay.init.dvl_part import dvl_of_velocity
from bottomlock.replay.init.entries import Entry, remark, toml_of
from bottomlock.replay.init.found import Found, find_streams, table_times
from bottomlock.replay.read_tables import SPEED_SI


def write_map(file: Path, to: Path, *, force: bool = False) -> None:
    """Writes the column map of a table of beams, or of a DVL's velocity.

    Raises:
        DataError: for a file that is no such table, or has to be written again first.
        OutputError: for a name that does not end in .toml, or a file that exists.
    """
    if to.suffix.lower() != ".toml":
        raise OutputError(place=to, expected="a name that ends in .toml, the column map to write")
    check_free(to, inputs=[file], force=force)
    table = read_any_table(file)
    times = table_times(table, "dvl")
    if not table.plain or not times.column:
        how = table.words or times.why
        raise DataError(
            f"a column map needs commas, a header and a column of numbers as times, but {how}",
            place=file,
            hint="bottomlock replay --init reads it as it is",
        )
    head = f"Column map of {file.name}: bottomlock convert {file.name} --out OUT --columns {to.name}"
    entries = [remark("", head), Entry("time", times.column), Entry("time_unit", times.unit, times.why)]
    beams = beam_columns(table)
    velocity = next((one for one in find_streams(table) if one.kind == "velocity"), None)
    if beams is not None:
        entries += _beams(beams, table, velocity)
    elif velocity is not None:
        unit = dvl_of_velocity(velocity).unit
        entries += [
            remark("", "no beams were found: convert needs --instrument-only"),
            *_instrument(velocity),
        ]
        entries.append(Entry("velocity_scale", SPEED_SI[unit.value], unit.why))
    else:
        raise DataError(
            f"none of its columns is known as a beam or a velocity ({column_names(table.frame)})", place=file
        )
    write_text(to, toml_of(entries))


def _beams(beams: BeamColumns, table: AnyTable, velocity: Found | None) -> Iterator[Entry]:
    """The columns of the beams, and of the instrument's own velocity where it has their unit."""
    columns = beams.columns
    assert columns.velocity is not None  # it has beams
    assert columns.valid is not None
    yield Entry("velocity", list(columns.velocity), beams.why)
    if all(name in table.frame.columns for name in columns.valid):
        yield Entry("valid", list(columns.valid))
    else:
        why = "no column of flags: lost where empty; else valid = [...]"
        if any((table.frame[name] == 0).any() for name in columns.velocity):
            why += ". A beam reads exactly 0: if that marks a lost one, leave these cells empty"
        yield Entry("lost_when_empty", value=True, why=why, known=False)
    yield Entry("velocity_scale", columns.velocity_scale, beams.scale_why)
    if columns.range is not None:
        yield Entry("range", list(columns.range))
    if velocity is None:
        return
    theirs = dvl_of_velocity(velocity).unit.value
    if SPEED_SI[theirs] == columns.velocity_scale:
        yield from _instrument(velocity)
    else:
        names = ", ".join(velocity.columns[f"v{k}"] for k in range(3))
        why = f"{names} are left out: they seem to be in {theirs}, and a map has one scale for all"
        yield Entry("instrument", why=why, known=False)


def _instrument(velocity: Found) -> Iterator[Entry]:
    """The columns of the instrument's own velocity, and of its flag."""
    yield Entry("instrument", [velocity.columns[f"v{k}"] for k in range(3)])
    if "valid" in velocity.extra:
        yield Entry("instrument_valid", velocity.extra["valid"])
