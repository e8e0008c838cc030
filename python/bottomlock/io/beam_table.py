"""The beam table: recorded pings of any DVL in one form, and the account of how they were read.

Every reader returns a `Recording`: a `BeamTable`, a `WaterTable` where the instrument measured the water too, and the
`Account` of each record of the file. The tables are written to Parquet, the account to JSON beside them. Signs follow
the beam model: beam k reads y_k = b_k . v, with v the velocity of the instrument over ground and b_k the unit vector
from the instrument along the beam.

A water table has a row for each ping and cell; its signs follow the beams of the bottom.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from itertools import count
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from bottomlock.errors import DataError, bad_column
from bottomlock.files.atomic_write import read_json, write_parquet
from bottomlock.files.records import DIGESTS, read_record, sha256_of, write_record
from bottomlock.files.table_file import read_parquet
from bottomlock.io.account import Account, Flags, Floats, Integers, Reason
from bottomlock.io.columns import (
    WATER_ENDING,
    check_converted,
    check_rising,
    check_valid,
    column_numbers,
    frame_of,
    number_series,
    numbers_of,
    read_flags,
    whole_numbers,
)
from bottomlock.libraries import pl


def water_file(path: str | Path) -> Path:
    """Path of the water of a beam table.

    >>> water_file("dive/beams.parquet").as_posix()
    'dive/beams_water.parquet'
    """
    path = Path(path)
    return path.with_name(f"{path.stem}{WATER_ENDING}.parquet")


@dataclass(frozen=True, eq=False)
class WaterTable:
    """Cells of pings, sorted by time and cell; NaN marks what a record does not contain.

    Attributes:
        time_ns: (n,) int64, the time of the ping.
        cell: (n,) int64, from 1, the nearest, on.
        range_m: (n,) along the beam from the transducer to the middle of the cell.
        velocity_mps: (n, beams) of the vehicle through the water.
        valid: (n, beams).
        quality: (n, beams) correlation, 0 to 255.
        sd_mps: (n, beams) 1 sigma.
    """

    time_ns: Integers
    cell: Integers
    range_m: Floats
    velocity_mps: Floats
    valid: Flags
    quality: Floats
    sd_mps: Floats

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.time_ns)

    @property
    def beams(self) -> int:
        """Number of beams."""
        return int(self.velocity_mps.shape[1])

    def to_frame(self) -> pl.DataFrame:
        """The documented columns: null where a record holds nothing."""
        columns = {"time_ns": self.time_ns, "cell": self.cell, "range_m": self.range_m}
        return frame_of(columns | _columns(self, ("mps", "valid", "quality", "sd_mps")))

    @classmethod
    def from_frame(cls, frame: pl.DataFrame, place: str) -> Self:
        """The table from its columns, as `to_frame` writes them.

        Raises:
            DataError: naming the place and the column: for one that is missing or of another type, rows that are not
                sorted by time and cell, a cell below 1, or a valid beam without a finite velocity and range.
        """
        table = cls(
            time_ns=whole_numbers(frame, "time_ns", place),
            cell=whole_numbers(frame, "cell", place),
            range_m=column_numbers(frame, "range_m", place),
            **_per_beam(frame, ("mps", "valid", "quality", "sd_mps"), place),
        )
        table._check(place)
        return table

    def _check(self, place: str) -> None:
        step_ns, cells = np.diff(self.time_ns), np.diff(self.cell)
        unsorted = np.flatnonzero((step_ns < 0) | ((step_ns == 0) & (cells <= 0)))
        if unsorted.size:
            raise DataError(
                f"row {unsorted[0] + 1} is not later, or of a later cell, than the one before", place=place
            )
        low = np.flatnonzero(self.cell < 1)
        if low.size:
            raise bad_column(place, "cell", f"is {self.cell[low[0]]}", "1 or more", row=low[0])
        wrong = np.argwhere(self.valid & ~(np.isfinite(self.velocity_mps) & (self.range_m >= 0.0)[:, None]))
        if wrong.size:
            row, beam = (int(index) for index in wrong[0])
            raise DataError(
                f"beam {beam + 1} is flagged valid",
                place=f"{place}: row {row}",
                expected="a finite velocity and a range of 0 m or more, or a cleared flag",
            )


def joined(tables: Sequence[WaterTable]) -> WaterTable:
    """One table of some with as many beams, at least one, sorted by time and cell; of repeats the first stands."""
    if len(tables) == 1:
        return tables[0]
    parts = {
        one.name: np.concatenate([getattr(table, one.name) for table in tables]) for one in fields(WaterTable)
    }
    _, first = np.unique(np.stack([parts["time_ns"], parts["cell"]]), axis=1, return_index=True)
    return WaterTable(**{name: values[first] for name, values in parts.items()})


def read_water_table(path: str | Path) -> WaterTable:
    """Reads a water table, Parquet with the columns of `WaterTable.to_frame`.

    Raises:
        DataError: naming file and column, as `WaterTable.from_frame`; also for a file that cannot be read.
    """
    place = Path(path)
    check_converted(place)
    return WaterTable.from_frame(read_parquet(place), str(place))


__all__ = [
    "EXTRA", "EXTRA_PER_BEAM", "MOST_BEAMS", "NO_TIME_NS", "Account", "BeamTable", "Flags", "Floats", "Integers",
    "Reason", "Recording", "read_account", "read_beam_table", "sidecar", "write_recording",
]  # fmt: skip


MOST_BEAMS = 8
"""Most beams of an instrument, the kernel's limit."""

NO_TIME_NS = -(2**63)
"""Value of `BeamTable.arrival_ns` for a ping without an arrival time."""

EXTRA = {
    "altitude_m": "distance to the bottom stated by the instrument, along its own vertical",
    "instrument_sd_mps": "the instrument's own figure of merit of its velocity, 1 sigma",
    "error_velocity_mps": "the closure of four beams that a Teledyne instrument gives in place of the beams",
    "heading_rad": "recorded heading, clockwise from north",
    "pitch_rad": "recorded pitch, nose up",
    "roll_rad": "recorded roll, starboard down",
    "sound_speed_mps": "speed of sound used by the instrument",
}
"""Columns that some formats fill, Float64, null where a record holds none."""

_OF_BEAM = {
    "mps": "velocity_mps", "valid": "valid", "range_m": "range_m", "quality": "quality", "sd_mps": "sd_mps",
}  # fmt: skip
"""Quantities of a beam, by the endings of their columns."""

EXTRA_PER_BEAM = {
    "noise_dbm": "background noise at the transducer",
    "range_confidence": "the instrument's confidence in the range",
    "delay_s": "time from the trigger at the record's time stamp to the centre of the echo",
}
"""The same per beam: beam1_noise_dbm ...."""


@dataclass(frozen=True, eq=False)
class BeamTable:
    """Pings of one instrument, a row each; NaN and -1 mark what a record does not contain.

    Attributes:
        time_ns: (n,) int64, strictly rising: time of validity where the format has it, else of the record.
        velocity_mps: (n, beams), as recorded; NaN where the record holds none.
        valid: (n, beams).
        range_m: (n, beams) along the beam; NaN where none.
        quality: (n, beams); NaN where none; its meaning depends on the format and is given in the account.
        sd_mps: (n, beams): the instrument's figure of merit per beam, 1 sigma; NaN where none.
        instrument_mps: (n, 3): the instrument's own velocity in the frame that the account names; NaN where none.
        instrument_valid: (n,) int8: 1 and 0 as the instrument flags its velocity, -1 without a flag.
        arrival_ns: (n,) int64, host clock, `NO_TIME_NS` where a ping has none; None where the file has none.
        stale: (n,) bool: the beams repeat those of the record before, unchanged; their `valid` is then false.
        extra: columns of `EXTRA` and, with the beam's number before it, of `EXTRA_PER_BEAM`, (n,) each.
    """

    time_ns: Integers
    velocity_mps: Floats
    valid: Flags
    range_m: Floats
    quality: Floats
    sd_mps: Floats
    instrument_mps: Floats
    instrument_valid: NDArray[np.int8]
    arrival_ns: Integers | None = None
    stale: Flags | None = None
    extra: Mapping[str, Floats] = field(default_factory=dict)

    @property
    def rows(self) -> int:
        """Number of pings."""
        return len(self.time_ns)

    @property
    def beams(self) -> int:
        """Number of beams, 0 in a table of the instrument's velocity alone."""
        return int(self.velocity_mps.shape[1])

    @property
    def beams_valid(self) -> Integers:
        """(n,) how many beams are valid in each ping."""
        return np.asarray(self.valid.sum(axis=1), dtype=np.int64)

    def to_frame(self) -> pl.DataFrame:
        """The documented columns: null where a record holds nothing."""
        columns: dict[str, Any] = {"time_ns": self.time_ns} | _columns(self, tuple(_OF_BEAM))
        columns |= {f"instrument_{axis}_mps": self.instrument_mps[:, k] for k, axis in enumerate("xyz")}
        said = pl.Series(self.instrument_valid)
        columns["instrument_valid"] = pl.select(pl.when(said >= 0).then(said == 1)).to_series()
        arrival = np.full(self.rows, NO_TIME_NS) if self.arrival_ns is None else self.arrival_ns
        columns["arrival_ns"] = pl.Series(arrival).replace(NO_TIME_NS, None)
        columns["stale"] = np.zeros(self.rows, dtype=bool) if self.stale is None else self.stale
        return frame_of(columns | dict(self.extra))

    @classmethod
    def from_frame(cls, frame: pl.DataFrame, place: str) -> Self:
        """The table from its columns, as `to_frame` writes them.

        Raises:
            DataError: naming the place and the column: for one that is missing or of another type, a time that is
                absent or does not rise, or a valid beam without a finite velocity.
        """
        arrival = number_series(frame, "arrival_ns", place, pl.Int64())
        verdict = column_numbers(frame, "instrument_valid", place)
        table = cls(
            time_ns=whole_numbers(frame, "time_ns", place),
            **_per_beam(frame, tuple(_OF_BEAM), place),
            instrument_mps=numbers_of(frame, [f"instrument_{axis}_mps" for axis in "xyz"], place),
            instrument_valid=np.where(np.isnan(verdict), -1.0, verdict).astype(np.int8),
            arrival_ns=None
            if arrival.null_count() == frame.height
            else arrival.fill_null(NO_TIME_NS).to_numpy(),
            stale=read_flags(frame, ["stale"], place)[:, 0],
            extra={name: column_numbers(frame, name, place) for name in frame.columns if _is_extra(name)},
        )
        check_rising(table.time_ns, "time_ns", place)
        check_valid(table.velocity_mps, table.valid, _names("mps", table.beams), place)
        return table


def _names(quantity: str, beams: int) -> list[str]:
    """Of the columns of a quantity of each beam."""
    return [f"beam{k + 1}_{quantity}" for k in range(beams)]


def _is_extra(name: str) -> bool:
    beam, _, what = name.partition("_")
    return name in EXTRA or (beam.startswith("beam") and what in EXTRA_PER_BEAM)


def _columns(table: BeamTable | WaterTable, endings: Sequence[str]) -> dict[str, Any]:
    """Columns of the quantities of each beam."""
    return {
        f"beam{k + 1}_{ending}": getattr(table, _OF_BEAM[ending])[:, k]
        for k in range(table.beams)
        for ending in endings
    }


def _per_beam(frame: pl.DataFrame, endings: Sequence[str], place: str) -> dict[str, Any]:
    """Arrays (n, beams) of the quantities of as many beams as the columns are numbered to."""
    beams = next(k for k in count() if f"beam{k + 1}_mps" not in frame.columns)
    return {
        _OF_BEAM[ending]: (read_flags if ending == "valid" else numbers_of)(
            frame, _names(ending, beams), place
        )
        for ending in endings
    }


@dataclass(frozen=True, eq=False)
class Recording:
    """Result of reading a file.

    Attributes:
        table: the pings.
        account: outcome of each record.
        frame: of the instrument's own velocity: "frd", "flu", "instrument", "ship", "earth" ... or "none".
        clock: epoch and source of `time_ns`.
        time_of: "validity", "transmission", "record" or "arrival".
        quality: meaning of the column of that name, "" where the format has none.
        geometry: packaged geometry of the instrument, "" where the record does not identify it.
        resolution_mps: step between the beam velocities that a record can hold; 0 where it holds floats.
        notes: changes of sign and unit by the reader, and remarks on this file, a sentence each.
        facts: recorded properties of the instrument (firmware, beam angle, serial number), unchanged.
        water: what the water returned, None where the records hold none.
        format: name of the format, as `bottomlock convert --format` takes it.
    """

    table: BeamTable
    account: Account
    frame: str
    clock: str
    time_of: str
    quality: str = ""
    geometry: str = ""
    resolution_mps: float = 0.0
    notes: Sequence[str] = ()
    facts: Mapping[str, Any] = field(default_factory=dict)
    water: WaterTable | None = None
    format: str = ""

    def to_json(self) -> dict[str, Any]:
        """Everything but the tables."""
        return {
            "schema": 1,
            "format": self.format,
            "beams": self.table.beams,
            "instrument_frame": self.frame,
            "clock": self.clock,
            "time_of": self.time_of,
            "quality": self.quality,
            "geometry": self.geometry,
            "resolution_mps": self.resolution_mps,
            "notes": list(self.notes),
            "facts": dict(self.facts),
            **self.account.to_json(),
        }


def sidecar(path: Path) -> Path:
    """Path of the account of a beam table: beams.json beside beams.parquet."""
    return path.with_suffix(".json")


def write_recording(recording: Recording, to: Path, *, source: Path) -> None:
    """Writes the tables to Parquet and, last, their account to JSON beside them; each file atomically.

    Raises:
        OutputError: where the directory cannot be written.
    """
    described = {"source": source.name, "source_sha256": sha256_of(source)} | recording.to_json()
    water = water_file(to)
    if recording.water is None and _states(sidecar(to), water):
        # Of the conversion that this one replaces: it would be taken for the water of this one.
        water.unlink(missing_ok=True)
    digests = {to.name: write_parquet(to, recording.table.to_frame())}
    if recording.water is not None:
        digests[water.name] = write_parquet(water, recording.water.to_frame())
    write_record(sidecar(to), described, digests)


def _states(account: Path, file: Path) -> bool:
    """Whether an account, which may be damaged, is one of a file as well."""
    try:
        return file.name in ((read_record(account) or {}).get(DIGESTS) or {})
    except DataError:
        return False


def read_beam_table(path: str | Path) -> BeamTable:
    """Reads a table that `bottomlock convert` wrote.

    Raises:
        DataError: naming file and column, as `BeamTable.from_frame`; also for a file that cannot be read.
    """
    place = Path(path)
    check_converted(place)
    frame = read_parquet(place)
    return BeamTable.from_frame(frame, str(place))


def read_account(path: str | Path) -> dict[str, Any]:
    """Reads the account (JSON) beside a beam table; {} where there is none.

    Raises:
        DataError: for a file that is not a JSON object.
    """
    return read_json(sidecar(Path(path))) or {}


def geometry_beside(path: str | Path) -> str:
    """Packaged geometry that the account of `bottomlock convert` beside a table names; "" where there is none.

    Raises:
        DataError: as `read_account`.
    """
    account = read_account(path) if Path(path).suffix.lower() == ".parquet" else {}
    return str(account.get("geometry", ""))
