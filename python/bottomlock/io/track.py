"""A user's own trajectory as rows: times, positions, attitude, from CSV or Parquet.

Columns carry their unit in the name. Time: `time_ns`, `time_us`, `time_ms`, `time_s`, or `time` as ISO 8601. Position:
`north_m` and `east_m`, or `latitude_deg` and `longitude_deg` (or `_rad`); `depth_m` or `down_m`, positive down.
Attitude, each optional: `roll_deg`, `pitch_deg`, `yaw_deg` or `heading_deg` (or `_rad`), or the quaternion
`attitude_t_p_w` to `_z`, platform to tangent. The truth that `bottomlock fly` writes can be read again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from bottomlock.errors import DataError, bad_column
from bottomlock.geodesy import radii_m
from bottomlock.io.account import Floats
from bottomlock.io.columns import NS_OF, column_names, column_numbers, read_rows, unix_times
from bottomlock.libraries import pl
from bottomlock.text import did_you_mean

SUFFIXES = (".csv", ".parquet", ".pq")
COLUMNS = (
    "time_ns", "time_us", "time_ms", "time_s", "time",
    "north_m", "east_m", "latitude_deg", "longitude_deg", "latitude_rad", "longitude_rad",
    "position_t_m_x", "position_t_m_y", "position_t_m_z", "depth_m", "down_m",
    "roll_deg", "roll_rad", "pitch_deg", "pitch_rad", "yaw_deg", "yaw_rad", "heading_deg", "heading_rad",
    "attitude_t_p_w", "attitude_t_p_x", "attitude_t_p_y", "attitude_t_p_z",
)  # fmt: skip
"""The names that a column may have, or be given by a map."""

FARTHEST_M = 100_000.0
"""From the first row: farther out, north and east of one place are no coordinates of a flat frame any more."""


@dataclass(frozen=True, eq=False)
class Track:
    """The rows of a trajectory file.

    Attributes:
        place: the file, for messages.
        time_s: (n,) seconds since the first row.
        position_t_m: (n, 3) north, east, down.
        has_depth: whether the file has depths; without them the third column is zero.
        latitude_rad: of the first row, the origin of north and east; None for a file in metres.
        longitude_rad: likewise.
        angles_rad: by "roll", "pitch" and "yaw" those that the file has, (n,) each.
        columns: what was read, by the name of each quantity.
    """

    place: str
    time_s: Floats
    position_t_m: Floats
    has_depth: bool
    latitude_rad: float | None
    longitude_rad: float | None
    angles_rad: Mapping[str, Floats]
    columns: tuple[str, ...]


def read_track(path: Path, columns: Mapping[str, str] | None = None) -> Track:
    """A trajectory file.

    Args:
        path: CSV or Parquet.
        columns: for a table with other names: by one of `COLUMNS`, the name that the file has.

    Raises:
        DataError: for what cannot be read, a position that is missing, an empty cell, and angles out of range; each
            with the row and the likely mistake.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise DataError(
            "is no trajectory",
            place=path,
            key=f"'{path.suffix}'",
            expected=f"a table with times, one of {', '.join(SUFFIXES)}",
        )
    return _of_table(_named(read_rows(path), columns or {}, str(path)), str(path))


def _named(table: pl.DataFrame, columns: Mapping[str, str], place: str) -> pl.DataFrame:
    """The table with its columns under the names of `COLUMNS`."""
    for name, theirs in columns.items():
        if name not in COLUMNS:
            raise DataError(
                f"has no key '{name}'{did_you_mean(name, COLUMNS) or ','} expected one of "
                f"{', '.join(COLUMNS)}",
                place=place,
                key="trajectory.columns",
            )
        if theirs not in table.columns:
            raise bad_column(place, theirs, f"is missing (there are {column_names(table)})")
    free = table.drop([name for name in columns if name in table.columns and name not in columns.values()])
    return free.rename({theirs: name for name, theirs in columns.items()})


def _of_table(table: pl.DataFrame, place: str) -> Track:
    position, origin, used = _position(table, place)
    depth = next((name for name in ("depth_m", "down_m", "position_t_m_z") if name in table.columns), None)
    if depth is not None:
        position[:, 2] = _full(table, depth, place)
        used.append(depth)
    time_s, clock = _time_s(table, place)
    angles, named = _angles(table, place)
    return Track(
        place=place, time_s=time_s, position_t_m=position, has_depth=depth is not None,
        latitude_rad=origin[0], longitude_rad=origin[1], angles_rad=angles, columns=(*clock, *used, *named),
    )  # fmt: skip


def _full(table: pl.DataFrame, name: str, place: str) -> Floats:
    """A column with a finite number in every row."""
    values = column_numbers(table, name, place)
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        raise bad_column(
            place,
            name,
            "is empty or no finite number",
            "one in every row",
            row=bad[0],
            hint="leave out rows without a position",
        )
    return values


def _position(table: pl.DataFrame, place: str) -> tuple[Floats, tuple[float | None, float | None], list[str]]:
    """(n, 3) north, east and zero; the origin; the columns that were read."""
    for north, east in (("north_m", "east_m"), ("position_t_m_x", "position_t_m_y")):
        if north in table.columns and east in table.columns:
            flat = np.zeros((table.height, 3))
            flat[:, 0], flat[:, 1] = _full(table, north, place), _full(table, east, place)
            return flat, (None, None), [north, east]
    for unit, scale in (("deg", np.pi / 180.0), ("rad", 1.0)):
        names = [f"latitude_{unit}", f"longitude_{unit}"]
        if set(names) <= set(table.columns):
            latitude, longitude = (scale * _full(table, name, place) for name in names)
            _check_geodetic(latitude, longitude, unit, place)
            return _flat(latitude, longitude, place), (float(latitude[0]), float(longitude[0])), names
    raise DataError(
        "no position",
        place=place,
        expected=(
            f"columns north_m and east_m, or latitude_deg and longitude_deg (there are {column_names(table)})"
        ),
        hint='other names are given by the key columns, as in columns = { north_m = "x" }',
    )


def _check_geodetic(latitude: Floats, longitude: Floats, unit: str, place: str) -> None:
    """Rejects what is no latitude or longitude, and where north and east are not defined.

    Raises:
        DataError: naming the row.
    """
    for name, values, bound in (
        ("latitude", latitude, np.deg2rad(89.0)),
        ("longitude", longitude, np.deg2rad(360.0)),
    ):
        exchanged = "are latitude and longitude exchanged, or is it a projected coordinate in metres?"
        _check_within(name, values, bound, unit, place, exchanged)


def _flat(latitude: Floats, longitude: Floats, place: str) -> Floats:
    """(n, 3) north, east, zero: arcs of the WGS 84 ellipsoid at the first row. Depth stays depth, and level is level.

    Raises:
        DataError: for a row beyond `FARTHEST_M`.
    """
    along, across = radii_m(latitude[0])
    turned = np.mod(longitude - longitude[0] + np.pi, 2.0 * np.pi) - np.pi
    north, east = along * (latitude - latitude[0]), across * np.cos(latitude[0]) * turned
    far = np.flatnonzero(np.hypot(north, east) > FARTHEST_M)
    if far.size:
        distance_km = np.hypot(north, east)[far[0]] / 1000.0
        raise DataError(
            f"row {far[0]} is {distance_km:.0f} km from the first one",
            place=place,
            expected=f"at most {FARTHEST_M / 1000:g} km",
            hint="is a row at latitude 0, longitude 0 a position that was missing?",
        )
    return np.stack([north, east, np.zeros_like(north)], axis=1)


def _time_s(table: pl.DataFrame, place: str) -> tuple[Floats, list[str]]:
    """(n,) seconds since the first row; and the column.

    Raises:
        DataError: without a column of times, and naming the row of one that is none.
    """
    for unit, scale in NS_OF.items():
        name = f"time_{unit}"
        if name not in table.columns:
            continue
        if unit == "ns" and table[name].dtype.is_integer():
            stamps = table[name].to_numpy()
            return np.asarray((stamps - stamps[0]) * 1e-9, np.float64), [name]
        values = _full(table, name, place)
        return (values - values[0]) * (scale * 1e-9), [name]
    if "time" not in table.columns:
        raise DataError(
            "has no times",
            place=place,
            expected=f"a column time_s (there are {column_names(table)})",
            hint='waypoints are flown with trajectory.kind = "waypoints"',
        )
    texts = table["time"].cast(pl.String)
    found = unix_times(texts)
    bad = found.is_null().arg_true()
    if len(bad):
        raise DataError(
            f"time '{texts[int(bad[0])]}' is no ISO 8601 time such as 2026-05-01T10:00:00Z",
            place=f"{place}: row {bad[0]}",
            hint="call a column of numbers time_s, time_ms, time_us or time_ns",
        )
    stamps = found.to_numpy()
    return np.asarray((stamps - stamps[0]) * 1e-9, np.float64), ["time"]


def _angles(table: pl.DataFrame, place: str) -> tuple[dict[str, Floats], list[str]]:
    """Roll, pitch and yaw, rad, those that the table has; and the columns."""
    quaternion = [f"attitude_t_p_{axis}" for axis in "wxyz"]
    if set(quaternion) <= set(table.columns):
        values = np.stack([_full(table, name, place) for name in quaternion], axis=1)
        bad = np.flatnonzero(np.abs(np.linalg.norm(values, axis=1) - 1.0) > 1e-3)
        if bad.size:
            raise DataError(
                f"has norm {np.linalg.norm(values[bad[0]]):.4g}",
                place=f"{place}: row {bad[0]}",
                key="attitude_t_p",
                expected="1",
            )
        yaw, pitch, roll = Rotation.from_quat(values[:, [1, 2, 3, 0]]).as_euler("ZYX").T
        return {"roll": roll, "pitch": pitch, "yaw": yaw}, ["attitude_t_p"]
    found: dict[str, Floats] = {}
    used = []
    for angle, names in (("roll", ["roll"]), ("pitch", ["pitch"]), ("yaw", ["yaw", "heading"])):
        known = [f"{name}_{unit}" for name in names for unit in ("deg", "rad")]
        there = [name for name in known if name in table.columns]
        if len(there) > 1:
            raise DataError(f"{angle} is there twice, as {' and '.join(there)}", place=place, hint="keep one")
        if there:
            values = _full(table, there[0], place)
            found[angle] = values if there[0].endswith("_rad") else np.deg2rad(values)
            used.append(there[0])
    _check_tilts(found, used, place)
    return found, used


def _check_tilts(found: Mapping[str, Floats], used: list[str], place: str) -> None:
    """Rejects roll beyond a half turn and pitch beyond a quarter.

    Raises:
        DataError: naming the row.
    """
    for angle, bound in (("roll", np.pi), ("pitch", 0.5 * np.pi)):
        for name in used:
            if name.startswith(angle):
                _check_within(angle, found[angle], bound, name[-3:], place)


def _check_within(name: str, values: Floats, bound: float, unit: str, place: str, likely: str = "") -> None:
    """Rejects angles, rad, of a column in deg or rad beyond a bound.

    Raises:
        DataError: naming the row.
    """
    bad = np.flatnonzero(np.abs(values) > bound)
    if bad.size:
        shown = values[bad[0]] if unit == "rad" else np.rad2deg(values[bad[0]])
        raise DataError(
            f"{name} {shown:g} {unit}",
            place=f"{place}: row {bad[0]}",
            expected=f"at most {np.rad2deg(bound):g} deg",
            hint=f"if these are degrees, call the column {name}_deg" if unit == "rad" else likely,
        )
