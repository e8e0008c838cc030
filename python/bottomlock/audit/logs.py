"""Readers of logs for an audit: defects of time and velocity are kept, since the audit reports them."""

import json
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from bottomlock.errors import DataError
from bottomlock.io.beams import (
    LEAST_READING_NS,
    Columns,
    beam_flags,
    read_flags,
    read_times,
    times_as_they_stand,
)
from bottomlock.io.columns import check_valid, column_numbers, read_rows
from bottomlock.recordings.streams import Depths, Inertial
from bottomlock.support.rising import rising

AXES = ("x", "y", "z")


@dataclass(frozen=True, eq=False)
class BeamLog:
    """Pings as recorded.

    Attributes:
        place: name of the log in messages.
        time_ns: (n,) int64, in the order of the file; it may repeat or go back.
        velocity_mps: (n, beams) readings, NaN where there is none; beams may be 0.
        valid: (n, beams) the instrument's flags.
        range_m: (n, beams), or None.
        instrument_mps: (n, 3) the instrument's own velocity in its own frame, or None.
        instrument_valid: (n,) its own flag of that velocity, or None.
        columns: map of the columns that were read, or None for the documented names.
        beside: content of the JSON file that the converter wrote beside the table; empty where there is none.
        stale: (n,) pings that the reader has marked as unchanged repeats (and flagged invalid), or None.
        error_velocity_mps: (n,) closure that the instrument gives in place of beams, NaN where none, or None.
    """

    place: str
    time_ns: NDArray[np.int64]
    velocity_mps: NDArray[np.float64]
    valid: NDArray[np.bool_]
    range_m: NDArray[np.float64] | None = None
    instrument_mps: NDArray[np.float64] | None = None
    instrument_valid: NDArray[np.bool_] | None = None
    columns: Columns | None = None
    beside: dict[str, Any] = field(default_factory=dict)
    stale: NDArray[np.bool_] | None = None
    error_velocity_mps: NDArray[np.float64] | None = None

    @property
    def beams(self) -> int:
        """Number of beams."""
        return int(self.velocity_mps.shape[1])

    @property
    def pings(self) -> int:
        """Number of pings."""
        return len(self.time_ns)

    @property
    def time_s(self) -> NDArray[np.float64]:
        """(n,) seconds from the first ping."""
        return np.asarray((self.time_ns - self.time_ns[0]) * 1e-9, dtype=np.float64)

    @property
    def full(self) -> NDArray[np.bool_]:
        """(n,) every beam is flagged valid and finite."""
        return np.asarray((self.valid & np.isfinite(self.velocity_mps)).all(axis=1))

    @property
    def own_frame(self) -> bool:
        """The instrument's velocity is in its own frame, not in the ship's or the Earth's."""
        return self.beside.get("instrument_frame", "frd") not in {"earth", "ship"}

    @property
    def solved(self) -> NDArray[np.bool_]:
        """(n,) the instrument gives a velocity and flags it valid."""
        if self.instrument_mps is None:
            return np.zeros(self.pings, dtype=bool)
        finite = np.isfinite(self.instrument_mps).all(axis=1)
        return np.asarray(finite if self.instrument_valid is None else finite & self.instrument_valid)


def numbers(table: pl.DataFrame, name: str, place: str) -> NDArray[np.float64]:
    """A column as floats, NaN where it is empty; true and false are 1 and 0."""
    if name in table.columns and table[name].dtype == pl.Null:
        return np.full(table.height, np.nan)
    return column_numbers(table, name, place, words=True)


def _filled(table: pl.DataFrame, name: str) -> bool:
    """The column is there and holds something."""
    return name in table.columns and table[name].null_count() < table.height


def _columns_of(table: pl.DataFrame, ending: str) -> list[str]:
    found = [name for name in table.columns if re.fullmatch(rf"beam[1-8]_{ending}", name)]
    return sorted(found, key=lambda name: int(name[4]))


def read_log(path: str | Path, columns: Columns | None = None) -> BeamLog:
    """Reads a beam table (`time_ns`, `beam1_mps`, `beam1_valid`, ..., `instrument_x_mps`, ...), or a mapped log.

    A log with the instrument's velocity alone has no beams.

    Args:
        path: CSV or Parquet.
        columns: map of other names, from a geometry file.

    Raises:
        DataError: naming file, row and column, for a file that cannot be read, a flag other than 0 or 1, a valid beam
            without a finite velocity, or a log with neither beams nor the instrument's velocity.
    """
    place, table = str(path), read_rows(Path(path))
    mapped = columns is not None and columns.velocity is not None and columns.velocity[0] in table.columns
    chosen = columns if mapped and columns is not None else Columns()
    names = list(chosen.velocity or [n for n in _columns_of(table, "mps") if _filled(table, n)])
    flags = list(chosen.valid or (f"beam{k + 1}_valid" for k in range(len(names))))
    if not mapped:
        flags = [name.replace("_mps", "_valid") for name in names]
    time_ns = times_as_they_stand(table, chosen, place)
    own = [f"instrument_{axis}_mps" for axis in AXES]
    has_own = all(_filled(table, name) for name in own)
    if not names and not has_own and not _filled(table, "error_velocity_mps"):
        # Empty columns of a log without lock, which is audited as such.
        names = _columns_of(table, "mps")
        flags = [name.replace("_mps", "_valid") for name in names]
    empty = np.zeros((table.height, 0))
    velocity = np.stack([numbers(table, n, place) for n in names], axis=1) if names else empty
    velocity = velocity * chosen.velocity_scale
    if mapped and chosen.valid is None:
        valid = beam_flags(table, flags, velocity, chosen, place)
    else:
        valid = read_flags(table, flags, place) if names else empty.astype(bool)
    check_valid(velocity, valid, names, place)
    instrument = np.stack([numbers(table, n, place) for n in own], axis=1) if has_own else None
    verdict = None
    if has_own and _filled(table, "instrument_valid"):
        verdict = read_flags(table, ["instrument_valid"], place)[:, 0]
    if not names and instrument is None and not _filled(table, "error_velocity_mps"):
        raise DataError(
            "has neither beam1_mps ... nor instrument_x_mps, instrument_y_mps, instrument_z_mps",
            place=place,
            hint="`bottomlock convert` makes such a table, or a geometry file maps the columns",
        )
    ranges = [name for name in _columns_of(table, "range_m") if _filled(table, name)]
    reach = None
    if len(ranges) == len(names) > 0:
        reach = np.stack([numbers(table, n, place) for n in ranges], axis=1)
    return BeamLog(
        place, time_ns, velocity, valid, reach, instrument, verdict,
        chosen if mapped else None, _beside(Path(path)),
        read_flags(table, ["stale"], place)[:, 0] if "stale" in table.columns else None,
        numbers(table, "error_velocity_mps", place) if _filled(table, "error_velocity_mps") else None,
    )  # fmt: skip


def _beside(path: Path) -> dict[str, Any]:
    """Account of the converter; empty without one, or for a file that is no JSON object."""
    try:
        content = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


@dataclass(frozen=True, eq=False)
class Reference:
    """Recorded attitude of the platform, with velocity where the file has it.

    Attributes:
        time_ns: (m,) int64, rising.
        rpy_rad: (m, 3) roll, pitch, yaw from tangent (NED) to platform frame.
        velocity_t_mps: (m, 3) north, east, down, or None.
    """

    time_ns: NDArray[np.int64]
    rpy_rad: NDArray[np.float64]
    velocity_t_mps: NDArray[np.float64] | None


def _rising(table: pl.DataFrame, place: str) -> NDArray[np.int64]:
    return read_times(table, Columns(), place, LEAST_READING_NS)


def _block(table: pl.DataFrame, names: list[str], place: str) -> NDArray[np.float64]:
    block = np.stack([numbers(table, name, place) for name in names], axis=1)
    wrong = np.argwhere(~np.isfinite(block))
    if wrong.size:
        row, column = (int(index) for index in wrong[0])
        raise DataError(
            f"is {block[row, column]}",
            place=f"{place}: row {row}",
            key=f"column '{names[column]}'",
            expected="a finite number",
        )
    return block


def read_reference(path: str | Path) -> Reference:
    """Reads attitude from `time_ns`, `roll_rad`, `pitch_rad`, `yaw_rad` and, if present, `velocity_north_mps` ....

    Raises:
        DataError: naming file, row and column, for what is missing, not finite, or a time that does not rise.
    """
    place, table = str(path), read_rows(Path(path))
    names = [f"velocity_{axis}_mps" for axis in ("north", "east", "down")]
    velocity = _block(table, names, place) if any(name in table.columns for name in names) else None
    return Reference(
        _rising(table, place), _block(table, ["roll_rad", "pitch_rad", "yaw_rad"], place), velocity
    )


def read_own_attitude(path: str | Path) -> Reference | None:
    """Attitude that the instrument recorded with its pings (`roll_rad`, `pitch_rad`, `heading_rad`); None without one.

    Pings without all three, or whose time does not rise, are left out.

    Raises:
        DataError: for a file that cannot be read.
    """
    place, table = str(path), read_rows(Path(path))
    names = ["roll_rad", "pitch_rad", "heading_rad"]
    if "time_ns" not in table.columns or not all(_filled(table, name) for name in names):
        return None
    rpy = np.stack([numbers(table, name, place) for name in names], axis=1)
    time_ns = times_as_they_stand(table, Columns(), place)
    rows = np.isfinite(rpy).all(axis=1) & rising(time_ns)
    return Reference(time_ns[rows], rpy[rows], None) if rows.sum() > 1 else None


def read_inertial(path: str | Path) -> Inertial:
    """Reads an IMU from `time_ns`, `force_x_mps2` ... and `omega_x_radps` ..., platform frame (FRD).

    Raises:
        DataError: as `read_reference`.
    """
    place, table = str(path), read_rows(Path(path))
    force, omega = [f"force_{a}_mps2" for a in AXES], [f"omega_{a}_radps" for a in AXES]
    return Inertial(_rising(table, place), _block(table, force, place), _block(table, omega, place))


def read_depths(path: str | Path) -> Depths:
    """Reads depth from `time_ns` and `depth_m`.

    Raises:
        DataError: as `read_reference`.
    """
    place, table = str(path), read_rows(Path(path))
    return Depths(_rising(table, place), _block(table, ["depth_m"], place)[:, 0])
