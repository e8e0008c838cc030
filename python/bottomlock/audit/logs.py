"""Readers of logs for an audit: defects of time and velocity are kept, since the audit reports them."""

import re
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import RotationSpline, Slerp

from bottomlock.errors import DataError, bad_column
from bottomlock.files.atomic_write import read_json
from bottomlock.io.beams import LEAST_READING_NS, Columns, beam_flags, read_times, times_as_they_stand
from bottomlock.io.columns import check_valid, numbers_of, read_flags, read_rows
from bottomlock.recordings.axes import from_angles
from bottomlock.recordings.rig_motion import Tracked

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Times = NDArray[np.int64]

AXES = ("x", "y", "z")
SLOW_S, STEP_S = 0.3, 0.1
"""Attitude at longer steps is interpolated by a smooth spline, at shorter ones by shortest arcs; to this step."""
CHANGE_S = (0.5, 1.0)
"""A velocity's change is taken over a sample on either side, within these: one of 2 mm/s noise has then a noise of
3 mm/s², less than the acceleration of a slow vehicle."""


@dataclass(frozen=True, eq=False)
class BeamLog:
    """Pings as recorded.

    Attributes:
        place: name of the log in messages.
        time_ns: (n,) int64, in the order of the file; it may repeat or go back.
        velocity_mps: (n, beams) readings, NaN where there is none; beams may be 0.
        valid: (n, beams) the instrument's flags.
        instrument_mps: (n, 3) the instrument's own velocity in its own frame, or None.
        instrument_valid: (n,) its own flag of that velocity, or None.
        columns: map of the columns that were read, or None for the documented names.
        beside: content of the JSON file that the converter wrote beside the table; empty where there is none.
        stale: (n,) pings that the reader has marked as unchanged repeats (and flagged invalid), or None.
        error_velocity_mps: (n,) closure that the instrument gives in place of beams, NaN where none, or None.
    """

    place: str
    time_ns: Times
    velocity_mps: Array
    valid: Flags
    instrument_mps: Array | None = None
    instrument_valid: Flags | None = None
    columns: Columns | None = None
    beside: dict[str, Any] = field(default_factory=dict)
    stale: Flags | None = None
    error_velocity_mps: Array | None = None

    @property
    def beams(self) -> int:
        """Number of beams."""
        return int(self.velocity_mps.shape[1])

    @property
    def pings(self) -> int:
        """Number of pings."""
        return len(self.time_ns)

    @property
    def time_s(self) -> Array:
        """(n,) seconds from the first ping."""
        return np.asarray((self.time_ns - self.time_ns[0]) * 1e-9, dtype=np.float64)

    @property
    def full(self) -> Flags:
        """(n,) every beam is flagged valid and finite."""
        return np.asarray((self.valid & np.isfinite(self.velocity_mps)).all(axis=1))

    @cached_property
    def unchanged(self) -> Flags:
        """(n,) a ping repeats all readings and flags of the one before, with at least two non-zero readings.

        Pings that a reader has marked as stale, and flagged invalid, count as well.
        """
        same, y, valid = np.zeros(self.pings, dtype=bool), self.velocity_mps, self.valid
        if self.beams:
            used = valid & np.isfinite(y)
            equal = (~used[1:] | (y[1:] == y[:-1])).all(axis=1) & (valid[1:] == valid[:-1]).all(axis=1)
            same[1:] = equal & ((used & (y != 0.0))[1:].sum(axis=1) >= 2)
        return same if self.stale is None else same | self.stale

    @property
    def own_frame(self) -> bool:
        """The instrument's velocity is in its own frame, not in the ship's or the Earth's."""
        return self.beside.get("instrument_frame", "frd") not in {"earth", "ship"}

    @property
    def solved(self) -> Flags:
        """(n,) the instrument gives a velocity and flags it valid."""
        if self.instrument_mps is None:
            return np.zeros(self.pings, dtype=bool)
        finite = np.isfinite(self.instrument_mps).all(axis=1)
        return np.asarray(finite if self.instrument_valid is None else finite & self.instrument_valid)


def _filled(table: pl.DataFrame, *names: str) -> bool:
    """The columns are there and hold something."""
    return all(name in table.columns and table[name].null_count() < table.height for name in names)


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
    time_ns = times_as_they_stand(table, chosen, place)
    own = [f"instrument_{axis}_mps" for axis in AXES]
    has_own, has_error = _filled(table, *own), _filled(table, "error_velocity_mps")
    stated = sorted(name for name in table.columns if re.fullmatch(r"beam[1-8]_mps", name))
    names = list(chosen.velocity or [name for name in stated if _filled(table, name)])
    if not names and not has_own and not has_error:
        # Empty columns of a log without lock, which is audited as such.
        names = stated
    if not names and not has_own and not has_error:
        raise DataError(
            "has neither beam1_mps ... nor instrument_x_mps, instrument_y_mps, instrument_z_mps",
            place=place,
            hint="`bottomlock convert` makes such a table, or a geometry file maps the columns",
        )
    velocity = numbers_of(table, names, place) * chosen.velocity_scale
    flags = [name.replace("_mps", "_valid") for name in names]
    valid = np.zeros(velocity.shape, dtype=bool)
    if mapped and chosen.valid is None:
        valid = beam_flags(table, [f"beam{k + 1}_valid" for k in range(len(names))], velocity, chosen, place)
    elif names:
        valid = read_flags(table, chosen.valid or flags, place)
    check_valid(velocity, valid, names, place)
    judged, beside = has_own and _filled(table, "instrument_valid"), None
    with suppress(DataError):  # A file of this name that is no JSON object is no account.
        beside = read_json(Path(path).with_suffix(".json"))
    return BeamLog(
        place, time_ns, velocity, valid,
        numbers_of(table, own, place) if has_own else None,
        read_flags(table, ["instrument_valid"], place)[:, 0] if judged else None,
        chosen if mapped else None, beside or {},
        read_flags(table, ["stale"], place)[:, 0] if "stale" in table.columns else None,
        numbers_of(table, ["error_velocity_mps"], place)[:, 0] if has_error else None,
    )  # fmt: skip


def tracked(time_ns: Times, rpy_rad: Array, velocity_t_mps: Array) -> Tracked:
    """The motion of a reference, the platform's, at even times.

    Args:
        time_ns: (m,) rising.
        rpy_rad: (m, 3) roll, pitch, yaw from tangent (NED) to platform frame.
        velocity_t_mps: (m, 3) north, east, down.
    """
    time_s, attitudes = (time_ns - time_ns[0]) * 1e-9, from_angles(*rpy_rad.T)
    usual_s = float(np.median(np.diff(time_s)))
    at_s = np.arange(0.0, time_s[-1], min(STEP_S, usual_s))
    between = RotationSpline(time_s, attitudes) if usual_s > SLOW_S else Slerp(time_s, attitudes)
    return Tracked(
        time_ns[0] + np.round(at_s * 1e9).astype(np.int64), between(at_s).as_matrix(),
        CubicSpline(time_s, velocity_t_mps)(at_s), float(np.clip(usual_s, *CHANGE_S)),
    )  # fmt: skip


def _block(table: pl.DataFrame, names: list[str], place: str) -> Array:
    """Columns (n, k) that have no blanks."""
    block = numbers_of(table, names, place)
    wrong = np.argwhere(~np.isfinite(block))
    if wrong.size:
        row, column = (int(index) for index in wrong[0])
        raise bad_column(place, names[column], f"is {block[row, column]}", "a finite number", row=row)
    return block


_LARGEST_RAD = {"roll_rad": np.pi + 1e-3, "pitch_rad": np.pi / 2.0 + 1e-3}
"""Of an angle that is none in degrees; a yaw may count turns."""


def read_reference(path: str | Path) -> Tracked:
    """Reads attitude and velocity from `time_ns`, `roll_rad`, `pitch_rad`, `yaw_rad`, `velocity_north_mps` ....

    Raises:
        DataError: naming file, row and column, for what is missing, not finite, no angle in radians, or a time that
            does not rise.
    """
    place, table = str(path), read_rows(Path(path))
    names = [f"velocity_{axis}_mps" for axis in ("north", "east", "down")]
    rpy = _block(table, ["roll_rad", "pitch_rad", "yaw_rad"], place)
    for k, (name, most) in enumerate(_LARGEST_RAD.items()):
        beyond = np.flatnonzero(np.abs(rpy[:, k]) > most)
        if beyond.size:
            row, expected = int(beyond[0]), f"at most {most:.4g} rad either way"
            raise bad_column(place, name, f"is {rpy[row, k]:g}", expected, row=row, hint="is it in degrees?")
    time_ns = read_times(table, Columns(), place, LEAST_READING_NS)
    return tracked(time_ns, rpy, _block(table, names, place))
