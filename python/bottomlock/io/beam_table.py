"""The beam table: recorded pings of any DVL in one form, and the account of how they were read.

Every reader of this package makes a `Recording`: a `BeamTable` and the `Account` of what became of each record of
the file. The table goes to Parquet, the account to JSON beside it. Signs are those of our beam model: beam k reads
y_k = b_k . v, with v the velocity of the instrument over ground and b_k pointing away from it along the beam.
"""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np
import polars as pl
from numpy.typing import NDArray

from bottomlock.atomic_write import read_json, write_json, write_parquet
from bottomlock.errors import DataError
from bottomlock.io.sentences import show

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

MOST_BEAMS = 8
"""The kernel's bound."""

NO_TIME_NS = -(2**63)
"""Stands in `BeamTable.arrival_ns` for a ping without."""

EXTRA = {
    "altitude_m": "distance to the bottom that the instrument states, along its own vertical",
    "instrument_sd_mps": "the instrument's own figure of merit of its velocity, 1 sigma",
    "error_velocity_mps": "the closure of four beams that a Teledyne instrument gives in place of the beams",
    "heading_rad": "heading that the record carries, clockwise from north",
    "pitch_rad": "pitch that the record carries, nose up",
    "roll_rad": "roll that the record carries, starboard down",
    "sound_speed_mps": "speed of sound that the instrument used",
}
"""Columns that some formats fill, Float64, null where a record holds none."""

EXTRA_PER_BEAM = {
    "noise_dbm": "background noise at the transducer",
    "range_confidence": "the instrument's own figure for its range",
    "delay_s": "when the echo's centre came, after the record's own time stamp's trigger",
}
"""The same per beam: beam1_noise_dbm ...."""


@dataclass(frozen=True, eq=False)
class BeamTable:
    """Pings of one instrument, a row each; NaN and -1 stand for what a record does not hold.

    Attributes:
        time_ns: (n,) int64, strictly rising: time of validity where the format has it, else of the record.
        velocity_mps: (n, beams), as recorded; NaN where the record holds none.
        valid: (n, beams).
        range_m: (n, beams) along the beam; NaN where none.
        quality: (n, beams); NaN where none; what it means differs by format and stands in the account.
        sd_mps: (n, beams): the instrument's own figure of merit per beam, 1 sigma; NaN where none.
        instrument_mps: (n, 3): the instrument's own velocity in the frame that the account names; NaN where none.
        instrument_valid: (n,) int8: 1 and 0 as the instrument judges its velocity, -1 where it does not say.
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
        columns: dict[str, Any] = {"time_ns": self.time_ns}
        for k in range(self.beams):
            columns[f"beam{k + 1}_mps"] = self.velocity_mps[:, k]
            columns[f"beam{k + 1}_valid"] = self.valid[:, k]
            columns[f"beam{k + 1}_range_m"] = self.range_m[:, k]
            columns[f"beam{k + 1}_quality"] = self.quality[:, k]
            columns[f"beam{k + 1}_sd_mps"] = self.sd_mps[:, k]
        columns |= {f"instrument_{axis}_mps": self.instrument_mps[:, k] for k, axis in enumerate("xyz")}
        said = pl.Series(self.instrument_valid)
        columns["instrument_valid"] = pl.select(pl.when(said >= 0).then(said == 1)).to_series()
        arrival = np.full(self.rows, NO_TIME_NS) if self.arrival_ns is None else self.arrival_ns
        columns["arrival_ns"] = pl.Series(arrival).replace(NO_TIME_NS, None)
        columns["stale"] = np.zeros(self.rows, dtype=bool) if self.stale is None else self.stale
        columns |= dict(self.extra)
        return pl.DataFrame(columns).with_columns(pl.col(pl.Float64).fill_nan(None))

    @classmethod
    def from_frame(cls, frame: pl.DataFrame, place: str) -> Self:
        """The table from its columns, as `to_frame` writes them.

        Raises:
            DataError: naming the place and the column: for one that is missing or of another type, a time that is
                absent or does not rise, or a valid beam without a finite velocity.
        """
        beams = 0
        while f"beam{beams + 1}_mps" in frame.columns:
            beams += 1

        def column(name: str, dtype: pl.DataType) -> pl.Series:
            if name not in frame.columns:
                raise DataError(f"{place}: column '{name}' is missing; `bottomlock convert` writes it")
            found = frame[name]
            if found.dtype not in {dtype, pl.Null()}:
                raise DataError(f"{place}: column '{name}' is {found.dtype}, expected {dtype}")
            return found.cast(dtype)

        def floats(name: str) -> Floats:
            return column(name, pl.Float64()).fill_null(np.nan).to_numpy()

        def per_beam(what: str) -> Floats:
            parts = [floats(f"beam{k + 1}_{what}") for k in range(beams)]
            return np.stack(parts, axis=1) if parts else np.empty((frame.height, 0))

        def flags(name: str) -> Flags:
            return column(name, pl.Boolean()).fill_null(value=False).to_numpy().astype(bool)

        times = column("time_ns", pl.Int64())
        if times.null_count():
            raise DataError(f"{place}: row {times.is_null().arg_max()}, column 'time_ns' has no time")
        time_ns = times.to_numpy()
        steps = np.flatnonzero(np.diff(time_ns) <= 0)
        if steps.size:
            row = int(steps[0]) + 1
            raise DataError(f"{place}: row {row}, column 'time_ns' is {time_ns[row]} ns and does not rise")
        valid = [flags(f"beam{k + 1}_valid") for k in range(beams)]
        arrival = column("arrival_ns", pl.Int64())
        verdict = column("instrument_valid", pl.Boolean())
        table = cls(
            time_ns=time_ns,
            velocity_mps=per_beam("mps"),
            valid=np.stack(valid, axis=1) if valid else np.empty((frame.height, 0), dtype=bool),
            range_m=per_beam("range_m"),
            quality=per_beam("quality"),
            sd_mps=per_beam("sd_mps"),
            instrument_mps=np.stack([floats(f"instrument_{axis}_mps") for axis in "xyz"], axis=1),
            instrument_valid=verdict.cast(pl.Int8).fill_null(-1).to_numpy(),
            arrival_ns=None
            if arrival.null_count() == frame.height
            else arrival.fill_null(NO_TIME_NS).to_numpy(),
            stale=flags("stale"),
            extra={name: floats(name) for name in _extra_names(beams) if name in frame.columns},
        )
        wrong = np.argwhere(table.valid & ~np.isfinite(table.velocity_mps))
        if wrong.size:
            row, beam = (int(index) for index in wrong[0])
            raise DataError(
                f"{place}: row {row}, column 'beam{beam + 1}_mps' is not finite, but the beam is flagged valid"
            )
        return table


def _extra_names(beams: int) -> list[str]:
    return [*EXTRA, *(f"beam{k + 1}_{what}" for what in EXTRA_PER_BEAM for k in range(beams))]


@dataclass
class Reason:
    """How many records met one fate, and where the first of them stands."""

    count: int
    first: int
    detail: str = ""


@dataclass
class Account:
    """What became of every record of a file.

    Attributes:
        unit: what positions count: "byte" (offset from 0) or "line" (from 1).
        read: records found, good or bad.
        kept: rows of the table.
        skipped: records that gave no row, by reason.
        flagged: rows that are kept, but with beams marked invalid by the reader or with something missing, by reason.
        other: well-formed records of kinds that carry no pings (replies, attitude, positions), by kind.
    """

    unit: str
    read: int = 0
    kept: int = 0
    skipped: dict[str, Reason] = field(default_factory=dict)
    flagged: dict[str, Reason] = field(default_factory=dict)
    other: dict[str, Reason] = field(default_factory=dict)

    def skip(self, reason: str, position: int, detail: str | bytes = "") -> None:
        """Counts a record that is lost; of bytes, the first record's beginning is shown."""
        _count(self.skipped, reason, position, detail)

    def flag(self, reason: str, position: int, detail: str | bytes = "") -> None:
        """Counts a record that is kept, but not as it stands."""
        _count(self.flagged, reason, position, detail)

    def pass_by(self, kind: str, position: int) -> None:
        """Counts a good record that holds no ping."""
        _count(self.other, kind, position, "")

    @property
    def lost(self) -> int:
        """Records that gave no row though they should have."""
        return sum(reason.count for reason in self.skipped.values())

    def to_json(self) -> dict[str, Any]:
        """As it stands in the file beside the table."""

        def fates(reasons: Mapping[str, Reason]) -> dict[str, dict[str, Any]]:
            return {
                name: {"count": reason.count, f"first_{self.unit}": reason.first}
                | ({"first": reason.detail} if reason.detail else {})
                for name, reason in reasons.items()
            }

        return {
            "position": self.unit,
            "records_read": self.read,
            "rows_kept": self.kept,
            "skipped": fates(self.skipped),
            "flagged": fates(self.flagged),
            "other": fates(self.other),
        }


def _count(reasons: dict[str, Reason], name: str, position: int, detail: str | bytes) -> None:
    if name in reasons:
        reasons[name].count += 1
    else:
        reasons[name] = Reason(1, position, show(detail) if isinstance(detail, bytes) else detail)


@dataclass(frozen=True, eq=False)
class Recording:
    """What a reader makes of a file.

    Attributes:
        format: name of the format, as `bottomlock convert --format` takes it.
        table: the pings.
        account: what became of each record.
        frame: of the instrument's own velocity: "frd", "flu", "instrument", "ship", "earth" ... or "none".
        clock: what `time_ns` counts from.
        time_of: "validity", "transmission", "record" or "arrival".
        quality: what the column of that name means, "" where the format has none.
        corrected: what the reader changed to come to our signs and units, a sentence each.
        geometry: packaged geometry that fits, "" where the record does not tell.
        notes: what the user ought to know of this file, a sentence each.
        facts: what the file says of the instrument (firmware, beam angle, serial number), as it stands there.
    """

    format: str
    table: BeamTable
    account: Account
    frame: str
    clock: str
    time_of: str
    quality: str = ""
    corrected: Sequence[str] = ()
    geometry: str = ""
    notes: Sequence[str] = ()
    facts: Mapping[str, Any] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Everything but the table."""
        return {
            "schema": 1,
            "format": self.format,
            "beams": self.table.beams,
            "instrument_frame": self.frame,
            "clock": self.clock,
            "time_of": self.time_of,
            "quality": self.quality,
            "corrected": list(self.corrected),
            "geometry": self.geometry,
            "notes": list(self.notes),
            "facts": dict(self.facts),
            **self.account.to_json(),
        }


def sidecar(path: Path) -> Path:
    """Where the account of a beam table stands: beams.json beside beams.parquet."""
    return path.with_suffix(".json")


def sha256_of(path: Path) -> str:
    """Hash of a file, read in pieces; of a folder, that of its files' names and hashes.

    Raises:
        DataError: for a file that cannot be read.
    """
    if path.is_dir():
        parts = [f"{sha256_of(one)}  {one.name}\n" for one in sorted(path.iterdir()) if one.is_file()]
        return hashlib.sha256("".join(parts).encode()).hexdigest()
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror or error})") from error


def write_recording(recording: Recording, to: Path, *, source: Path) -> None:
    """The table to Parquet and its account to JSON beside it, each whole or not at all; the account last.

    Raises:
        OutputError: where the directory cannot be written.
    """
    described = {"source": source.name, "source_sha256": sha256_of(source)} | recording.to_json()
    write_parquet(to, recording.table.to_frame())
    write_json(sidecar(to), described)


def read_beam_table(path: str | Path) -> BeamTable:
    """A table that `bottomlock convert` wrote.

    Raises:
        DataError: naming file and column, as `BeamTable.from_frame`; also for a file that cannot be read.
    """
    place = Path(path)
    if not place.is_file():
        raise DataError(f"{place}: no such file")
    try:
        frame = pl.read_parquet(place)
    except (OSError, pl.exceptions.PolarsError) as error:
        raise DataError(f"{place}: cannot be read ({str(error).splitlines()[0]})") from error
    return BeamTable.from_frame(frame, str(place))


def read_account(path: str | Path) -> dict[str, Any]:
    """What stands in the JSON beside a beam table; {} where there is none.

    Raises:
        DataError: for a file that is not a JSON object.
    """
    return read_json(sidecar(Path(path))) or {}
