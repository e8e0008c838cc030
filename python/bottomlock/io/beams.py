"""Readers of pings (CSV or Parquet) and of instrument files (TOML) to validated arrays."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from bottomlock import units
from bottomlock.config.beam_layout import BeamLayout
from bottomlock.config.dvl import StatedCalibration
from bottomlock.config.packaged import packaged_names, text_of
from bottomlock.config.section import shown
from bottomlock.config.toml_file import parse_toml
from bottomlock.config.validation import checked
from bottomlock.errors import DataError, ScenarioError, bad_column
from bottomlock.files.table_file import read_table_file
from bottomlock.io.account import Account
from bottomlock.io.columns import (
    check_rising,
    check_valid,
    column_names,
    column_numbers,
    is_code,
    nanoseconds,
    number_series,
    numbers_of,
    read_flags,
    read_rows,
)
from bottomlock.kernel import BeamGeometry, Configuration, KernelError
from bottomlock.kernel.models import Real
from bottomlock.libraries import pl


class Columns(BaseModel):
    """Column map of a log; the defaults are the documented names."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)
    time: str = "time_ns"
    """column of the times"""
    time_unit: Literal["ns", "us", "ms", "s"] = "ns"
    """unit of the times"""
    velocity: Annotated[tuple[str, ...] | None, shown(example=["b1", "b2", "b3", "b4"])] = None
    """column of each beam's velocity, positive towards the bottom; none: beam1_mps, beam2_mps, ..."""
    valid: Annotated[tuple[str, ...] | None, shown(example=["ok1", "ok2", "ok3", "ok4"])] = None
    """column of each beam's flag; none: beam1_valid, beam2_valid, ..."""
    lost_when_empty: Annotated[bool, shown(example=True)] = False
    """a beam is lost where the cell of its velocity is empty, and no column of flags is read"""
    velocity_scale: Annotated[Real, Field(gt=0, allow_inf_nan=False), shown(unit="1")] = 1.0
    """factor from the velocities' unit to m/s: 0.001 of mm/s"""
    # Columns that `bottomlock convert` keeps beside the beams; of these a fix uses `instrument_valid`.
    range: Annotated[tuple[str, ...] | None, shown(example=["r1", "r2", "r3", "r4"])] = None
    """column of each beam's range, m"""
    quality: Annotated[tuple[str, ...] | None, shown(example=["q1", "q2", "q3", "q4"])] = None
    """column of each beam's quality, in the instrument's own measure"""
    sd: Annotated[tuple[str, ...] | None, shown(example=["s1", "s2", "s3", "s4"])] = None
    """column of each beam's standard deviation, m/s"""
    instrument: Annotated[tuple[str, ...] | None, shown(example=["vx", "vy", "vz"])] = None
    """columns of the instrument's own velocity, its axes x, y, z, in the unit of the beams"""
    instrument_valid: Annotated[str | None, shown(example="valid")] = None
    """column that says whether that velocity is valid"""

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if self.lost_when_empty and self.valid is not None:
            raise ValueError(
                "'valid' names columns of flags, so lost_when_empty cannot be true: state one of them"
            )
        return self


class InstrumentFile(BeamLayout):
    """Contents of a DVL's TOML file."""

    name: Annotated[str, shown(example="Water Linked A50")] = ""
    """name for pages"""
    configuration: Annotated[Configuration, shown(example="x")]
    """beams in an x (azimuths 45, 135, 225, 315 deg), in a + (0, 90, 180, 270), by angles, or by directions"""
    beam_noise_mps: Annotated[
        tuple[Annotated[Real, Field(gt=0)], ...] | Annotated[Real, Field(gt=0)],
        shown(example=0.02),
    ]
    """white noise, 1 sigma, of every beam, or of each"""
    beam_noise_mps_per_m: Annotated[Real, Field(ge=0, allow_inf_nan=False), shown(example=5e-4)] = 0.0
    """white noise that grows with the range of a beam, beside that, 1 sigma"""
    columns: Columns = Columns()
    calibration: StatedCalibration | None = None


@dataclass(frozen=True, eq=False)
class Instrument:
    """Geometry, beam noise and column map of a DVL; the mounting (roll, pitch, yaw) is already in the geometry.

    `calibration` is what its file says of it, whose scale is in the geometry too; None where it says nothing.
    """

    geometry: BeamGeometry
    beam_sd_mps: NDArray[np.float64]
    columns: Columns
    beam_sd_mps_per_m: float = 0.0
    mounting_rpy_rad: NDArray[np.float64] = dataclasses.field(default_factory=lambda: np.zeros(3))
    calibration: StatedCalibration | None = None

    def noise_mps(self, range_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """1 sigma of the beams at ranges (..., beams), m; NaN where it grows with a range that is NaN."""
        if self.beam_sd_mps_per_m == 0.0:
            return np.broadcast_to(self.beam_sd_mps, range_m.shape)
        return np.asarray(np.hypot(self.beam_sd_mps, self.beam_sd_mps_per_m * range_m))

    @property
    def stated(self) -> StatedCalibration:
        """What the file says of the calibration, or that there is nothing."""
        return StatedCalibration() if self.calibration is None else self.calibration


@dataclass(frozen=True, eq=False)
class Pings:
    """Recorded pings.

    Attributes:
        time_ns: (n,) int64, rising.
        velocity_mps: (n, beams); entries of invalid beams may be NaN.
        valid: (n, beams).
        prior_velocity_p_mps: (n, 3), or None where the log has none.
        prior_sd_mps: (n, 3), or None where the log has none.
        instrument_valid: (n,) the instrument's own flag of its velocity, or None where the log does not have all flags.
    """

    time_ns: NDArray[np.int64]
    velocity_mps: NDArray[np.float64]
    valid: NDArray[np.bool_]
    prior_velocity_p_mps: NDArray[np.float64] | None
    prior_sd_mps: NDArray[np.float64] | None
    instrument_valid: NDArray[np.bool_] | None = None


def packaged_geometries() -> list[str]:
    """Names of the packaged geometries, sorted.

    >>> "waterlinked_a50" in packaged_geometries()
    True
    """
    return packaged_names("geometries")


def geometry_text(source: str | Path) -> str:
    """The text of a DVL's TOML file, by its path or packaged name.

    Raises:
        ScenarioError: for a file that cannot be read, or an unknown name.
    """
    return text_of("geometry", source)[0]


def read_instrument_file(source: str | Path) -> InstrumentFile:
    """The settings of a DVL from a TOML file or a packaged name.

    Raises:
        ScenarioError: for a file that cannot be read, ill-formed TOML, an unknown or missing key, or a value out of
            range.
    """
    text, place = text_of("geometry", source)
    content = parse_toml(text, place=place, kind="DVL geometry")
    return checked(InstrumentFile, content, place)


def read_geometry(
    source: str | Path, *, beam_noise_mps: float | None = None, beam_noise_mps_per_m: float | None = None
) -> Instrument:
    """Reads a DVL from a TOML file or a packaged name; noise of its beams that is given, 1 sigma, replaces the file's.

    Raises:
        ScenarioError: as `read_instrument_file`, and for directions that are not unit vectors.

    Examples:
        >>> read_geometry("linkquest_caves").geometry.beams
        4
    """
    place = str(source) if Path(source).is_file() else f"geometry {source}"
    settings = read_instrument_file(source)
    given = {"beam_noise_mps": beam_noise_mps, "beam_noise_mps_per_m": beam_noise_mps_per_m}
    update = {key: value for key, value in given.items() if value is not None}
    settings = settings.model_copy(update=update)
    return instrument_of(settings, place=place)


def instrument_of(settings: InstrumentFile, *, place: str) -> Instrument:
    """The DVL of settings; `place` names them in errors.

    Raises:
        ScenarioError: for directions that are not unit vectors, and another number of noises than of beams.
    """
    mounting = np.array(settings.mounting_rpy_rad)
    calibration = settings.calibration
    scale = 1.0 if calibration is None else 1.0 + units.fraction_from_percent(calibration.scale_percent)
    try:
        geometry = settings.geometry(scale)
    except KernelError as error:
        raise ScenarioError(error, place=place) from error
    noise = settings.beam_noise_mps
    sd = np.full(geometry.beams, noise) if isinstance(noise, float) else np.array(noise)
    if sd.shape != (geometry.beams,):
        raise ScenarioError(
            f"has {len(sd)} entries",
            place=place,
            key="'beam_noise_mps'",
            expected=f"{geometry.beams}, one per beam",
        )
    return Instrument(
        geometry=geometry,
        beam_sd_mps=sd,
        columns=settings.columns,
        beam_sd_mps_per_m=settings.beam_noise_mps_per_m,
        mounting_rpy_rad=mounting,
        calibration=calibration,
    )


LEAST_PING_NS, LEAST_READING_NS = 1_000_000, 50_000
"""Least steps of the times of pings and of inertial readings: no instrument is faster."""


def check_steps(time_ns: NDArray[np.int64], least_ns: int, place: str, column: str) -> None:
    """Checks that times are in nanoseconds, by the median step of ten rows or more.

    Raises:
        DataError: naming the column and the likely unit.
    """
    steps = np.diff(time_ns)
    rising = steps[steps > 0]
    if len(rising) < 9 or float(np.median(rising)) >= least_ns:
        return
    raise DataError(
        f"column '{column}' rises by {np.median(rising):.0f} ns a row in the median",
        place=place,
        expected=f"{least_ns} or more, since no instrument is that fast: is it in micro- or milliseconds?",
    )


def times_as_they_stand(
    table: pl.DataFrame, columns: Columns, place: str, least_ns: int = LEAST_PING_NS
) -> NDArray[np.int64]:
    """Times of a table, ns (n,), in the order of the file, which may repeat or go back.

    Raises:
        DataError: naming row and column, for a time that is missing or no number, and for steps below `least_ns`.
    """
    if columns.time not in table.columns and columns.time == Columns().time:
        raise bad_column(
            place,
            columns.time,
            f"is missing (there are {column_names(table)})",
            hint=f"`bottomlock convert {place} --init --out MAP.toml` writes a map of other names, "
            "with which `bottomlock convert` makes the table to be read here",
        )
    if columns.time_unit == "ns":
        series = number_series(table, columns.time, place, pl.Int64())
    else:
        units = number_series(table, columns.time, place, pl.Float64())
        series = nanoseconds(units, columns.time, place, columns.time_unit)
    missing = series.is_null().arg_true()
    if len(missing):
        raise bad_column(place, columns.time, "has no time", row=missing[0])
    times = np.asarray(series.to_numpy(), dtype=np.int64)
    check_steps(times, least_ns, place, columns.time)
    return times


def read_times(
    table: pl.DataFrame, columns: Columns, place: str, least_ns: int = LEAST_PING_NS
) -> NDArray[np.int64]:
    """Times of a table, ns (n,), strictly rising.

    Raises:
        DataError: as `times_as_they_stand`, and for a time that repeats or goes back.
    """
    times = times_as_they_stand(table, columns, place, least_ns)
    check_rising(times, columns.time, place)
    return times


def beam_flags(
    table: pl.DataFrame,
    names: Sequence[str],
    velocity_mps: NDArray[np.float64],
    columns: Columns,
    place: str,
    account: Account | None = None,
) -> NDArray[np.bool_]:
    """Which beams are valid (n, beams): by their columns, or where the velocity is a number if the map says so.

    A velocity that is a code for "no reading" is lost whatever its flag: one of 0 with a mapped range of 0 or less, or
    in a ping of zeros alone that has no flags; one that no DVL measures. The account counts their pings.

    Raises:
        DataError: as `read_flags`; for a table without flags, with both ways out.
    """
    flags = _stated_flags(table, names, velocity_mps, columns, place)
    no_range = np.broadcast_to((velocity_mps == 0.0).all(axis=1)[:, None], flags.shape)
    if not columns.lost_when_empty:
        no_range = np.zeros(flags.shape, dtype=bool)
    if columns.range is not None and len(columns.range) == flags.shape[1]:
        no_range = no_range | (numbers_of(table, columns.range, place) <= 0.0)
    lost = flags & is_code(velocity_mps, no_range)
    if account is not None:
        account.flag_where(
            "velocity is a code for no reading",
            np.asarray(lost.any(axis=1)),
            np.arange(len(lost)),
            lambda k: f"{velocity_mps[k][lost[k]][0]:g} m/s",
        )
    return flags & ~lost


def _stated_flags(
    table: pl.DataFrame, names: Sequence[str], velocity: NDArray[np.float64], columns: Columns, place: str
) -> NDArray[np.bool_]:
    """The flags as the table has them."""
    if columns.lost_when_empty:
        return np.isfinite(velocity)
    if columns.valid is None and not any(name in table.columns for name in names):
        raise DataError(
            "no column says which beams are valid",
            place=place,
            expected=f"{', '.join(names)} (there are {column_names(table)})",
            hint=(
                "name yours in the column map, valid = [...], or state lost_when_empty = true if a "
                "lost beam's cell is empty"
            ),
        )
    return read_flags(table, names, place)


def read_validity(path: Path, *, beams: int) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Times (n,), ns, and validity (n, beams) of a log with the columns `time_ns` and `beam1_valid` ....

    Raises:
        DataError: naming file, row and column: for a file that cannot be read, a missing column, a time that repeats or
            goes back, a flag other than 0 or 1, or fewer than two rows.
    """
    table = read_table_file(path)
    if table.height < 2:
        raise DataError(f"has {table.height} rows", place=path, expected="2 or more")
    names = [f"beam{k + 1}_valid" for k in range(beams)]
    return read_times(table, Columns(), str(path)), read_flags(table, names, str(path))


def read_beams(
    path: str | Path,
    *,
    geometry: Instrument | str | Path | None = None,
    beams: int | None = None,
    columns: Columns | None = None,
) -> Pings:
    """Reads pings from CSV or Parquet, of a DVL or of a number of beams.

    The documented columns are `time_ns`, `beam1_mps` ..., `beam1_valid` ... (0/1 or true/false) and, optionally,
    `prior_surge_mps`, `prior_sway_mps`, `prior_heave_mps` with `prior_surge_sd_mps` ..., and `instrument_valid`; a map
    in the geometry file names others. Rows are counted from 0, without the header.

    Args:
        path: the table.
        geometry: the DVL, whose file may have a map of columns: what `read_geometry` returns or takes.
        beams: number of beams, in place of the DVL.
        columns: a map of columns, in place of the DVL's.

    Raises:
        TypeError: for both or neither of `geometry` and `beams`.
        ScenarioError: as `read_geometry`.
        DataError: naming file, row and column: for a file that cannot be read, a missing column, a cell that is no
            number, a time that repeats or goes back, a valid beam without a finite velocity, a log without rows, or
            one with another number of beams.
    """
    place = str(path)
    if (geometry is None) == (beams is None):
        raise TypeError(
            "read_beams takes either the geometry of the DVL, a name or a file, or the number of beams: "
            f"geometry is {geometry!r:.40}, beams is {beams}"
        )
    if geometry is not None:
        instrument = geometry if isinstance(geometry, Instrument) else read_geometry(geometry)
        beams, columns = instrument.geometry.beams, columns or instrument.columns
    assert beams is not None
    columns = columns or Columns()
    table = read_rows(Path(path))
    velocity_names, valid_names = beam_columns(columns, beams, place)
    if columns.velocity is None and "beam1_mps" in table.columns:
        check_beam_count(place, _beams_of(table, beams), beams)
    time_ns, velocity, valid = read_mapped(table, velocity_names, valid_names, columns, place)
    prior_velocity, prior_sd = _prior(table, place)
    # That of the map, or `instrument_valid` of a beam table if no ping lacks it.
    flag, instrument_valid = columns.instrument_valid or "instrument_valid", None
    if columns.instrument_valid or (flag in table.columns and not table[flag].null_count()):
        instrument_valid = read_flags(table, (flag,), place)[:, 0]
    return Pings(time_ns, velocity, valid, prior_velocity, prior_sd, instrument_valid)


def beam_columns(columns: Columns, beams: int, place: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of the columns of velocity and validity of so many beams, as mapped or documented.

    Raises:
        DataError: for a map that names another number of them.
    """
    velocity = columns.velocity or tuple(f"beam{k + 1}_mps" for k in range(beams))
    valid = columns.valid or tuple(f"beam{k + 1}_valid" for k in range(beams))
    for key, names in (("columns.velocity", velocity), ("columns.valid", valid)):
        if len(names) != beams:
            expected = f"{beams}, one per beam"
            raise DataError(f"names {len(names)} columns", place=place, key=key, expected=expected)
    return velocity, valid


def read_mapped(
    table: pl.DataFrame,
    velocity_names: Sequence[str],
    valid_names: Sequence[str],
    columns: Columns,
    place: str,
    account: Account | None = None,
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.bool_]]:
    """Times (n,), ns, velocities (n, beams), m/s, and validity (n, beams) by the named columns.

    Raises:
        DataError: as `read_times` and `beam_flags`, and for a valid beam without a finite velocity.
    """
    time_ns = read_times(table, columns, place)
    velocity = numbers_of(table, velocity_names, place) * columns.velocity_scale
    valid = np.empty(velocity.shape, dtype=bool)
    if velocity_names:
        valid = beam_flags(table, valid_names, velocity, columns, place, account)
    check_valid(velocity, valid, velocity_names, place)
    return time_ns, velocity, valid


def check_beam_count(place: str, beams: int, geometry_beams: int) -> None:
    """Checks that a log and a geometry have the same number of beams.

    Raises:
        DataError: where they differ.
    """
    if beams != geometry_beams:
        raise DataError(
            f"has {beams} beams", place=place, expected=f"{geometry_beams}, those of the geometry",
            hint="state the geometry of this instrument",
        )  # fmt: skip


def _beams_of(table: pl.DataFrame, least: int) -> int:
    """Beams of a table with the documented columns; beyond the first `least` an empty column is none."""
    names = [name for name in table.columns if re.fullmatch(r"beam[1-8]_mps", name)]
    return sum(int(name[4]) <= least or table[name].null_count() < table.height for name in names)


def _prior(table: pl.DataFrame, place: str) -> tuple[NDArray[np.float64] | None, NDArray[np.float64] | None]:
    axes = ("surge", "sway", "heave")
    if not any(name.startswith("prior_") for name in table.columns):
        return None, None
    names = [f"prior_{axis}_mps" for axis in axes] + [f"prior_{axis}_sd_mps" for axis in axes]
    values = [column_numbers(table, name, place) for name in names]
    for name, column in zip(names, values, strict=True):
        bad = np.flatnonzero(~np.isfinite(column) | (column <= 0.0 if "_sd_" in name else False))
        if bad.size:
            raise bad_column(place, name, f"is {column[bad[0]]}", "a finite number", row=bad[0])
    stacked = np.stack(values, axis=1)
    return stacked[:, :3], stacked[:, 3:]
