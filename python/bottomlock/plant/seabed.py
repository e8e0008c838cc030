"""The seabed below the vehicle: flat, sloped or gridded; range and incidence of every beam of every ping."""

import math
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from bottomlock.config.mission_sections import AnySeabed, FlatSeabedTable, RollingSeabedTable
from bottomlock.config.toml_file import parse_toml, read_text
from bottomlock.errors import ScenarioError
from bottomlock.plant.maths import FloatArray
from bottomlock.recordings.rotation import matrices

_MARCH_STEPS = 256
_BISECTIONS = 40


class Seabed(Protocol):
    """A seabed that rays intersect."""

    def intersect(self, origin_t_m: FloatArray, direction_t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Range (m) and cosine of incidence of the first intersection of rays (..., 3); NaN without one."""
        ...


@dataclass(frozen=True)
class PlaneSeabed:
    """Depth = depth_m + slope_north north + slope_east east; slopes positive when it deepens that way."""

    depth_m: float
    slope_north: float = 0.0
    slope_east: float = 0.0

    def __post_init__(self) -> None:
        if not np.isfinite([self.depth_m, self.slope_north, self.slope_east]).all() or self.depth_m <= 0.0:
            raise ScenarioError(
                f"is {self.depth_m:g}, slopes {self.slope_north:g} and {self.slope_east:g}",
                place="seabed",
                key="depth_m",
                expected="a positive depth and finite slopes",
            )

    def intersect(self, origin_t_m: FloatArray, direction_t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Range (m) and cosine of incidence of rays (..., 3); NaN for rays parallel to the plane or away from it."""
        normal = np.array([-self.slope_north, -self.slope_east, 1.0])
        closing = direction_t @ normal
        height = self.depth_m - origin_t_m @ normal
        hits = (closing > 0.0) & (height >= 0.0)
        reach = np.where(hits, height / np.where(hits, closing, 1.0), np.nan)
        return reach, np.where(hits, closing / np.linalg.norm(normal), np.nan)


@dataclass(frozen=True)
class GridSeabed:
    """Depths (rows north, columns east), m, on an even grid, bilinear between; beyond its edges rays return nothing.

    Raises:
        ScenarioError: for axes that do not rise evenly, depths of another shape, or a depth that is not finite.
    """

    north_m: FloatArray
    east_m: FloatArray
    depth_m: FloatArray

    def __post_init__(self) -> None:
        north, east, depth = (
            np.asarray(a, dtype=np.float64) for a in (self.north_m, self.east_m, self.depth_m)
        )
        for name, axis in (("north_m", north), ("east_m", east)):
            if axis.ndim != 1 or len(axis) < 2 or not (np.diff(axis) > 0.0).all():
                raise ScenarioError(f"{name} must hold at least two rising values", place="seabed grid")
            if not np.allclose(np.diff(axis), axis[1] - axis[0], rtol=1e-6):
                raise ScenarioError(f"{name} must be evenly spaced", place="seabed grid")
        if depth.shape != (len(north), len(east)):
            raise ScenarioError(
                f"has shape {depth.shape}",
                place="seabed grid",
                key="depth_m",
                expected=f"({len(north)}, {len(east)})",
            )
        if not np.isfinite(depth).all():
            row, column = np.argwhere(~np.isfinite(depth))[0]
            raise ScenarioError(
                f"depth_m at row {row + 1}, column {column + 1} is not finite", place="seabed grid"
            )

    def depth_at(self, north_m: FloatArray, east_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Depth (m) and its slopes to the north and east at positions (...,); NaN beyond the edges."""
        depth = np.asarray(self.depth_m)
        row, row_step = self._locate(north_m, self.north_m)
        column, column_step = self._locate(east_m, self.east_m)
        i = np.clip(np.nan_to_num(np.floor(row)), 0, depth.shape[0] - 2).astype(np.int64)
        j = np.clip(np.nan_to_num(np.floor(column)), 0, depth.shape[1] - 2).astype(np.int64)
        a, b = row - i, column - j
        d00, d01, d10, d11 = depth[i, j], depth[i, j + 1], depth[i + 1, j], depth[i + 1, j + 1]
        value = (1 - a) * ((1 - b) * d00 + b * d01) + a * ((1 - b) * d10 + b * d11)
        slope_north = ((1 - b) * (d10 - d00) + b * (d11 - d01)) / row_step
        slope_east = ((1 - a) * (d01 - d00) + a * (d11 - d10)) / column_step
        inside = (row >= 0) & (row <= depth.shape[0] - 1) & (column >= 0) & (column <= depth.shape[1] - 1)
        return np.where(inside, value, np.nan), slope_north, slope_east

    @staticmethod
    def _locate(place_m: FloatArray, axis_m: FloatArray) -> tuple[FloatArray, float]:
        step = float(axis_m[1] - axis_m[0])
        return (np.asarray(place_m) - float(axis_m[0])) / step, step

    def intersect(self, origin_t_m: FloatArray, direction_t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Range (m) and cosine of incidence of the first intersection, NaN without one; by marching and bisection."""
        origin, direction = np.broadcast_arrays(origin_t_m, direction_t)
        shape = origin.shape[:-1]
        origin, direction = origin.reshape(-1, 3), direction.reshape(-1, 3)
        falling = direction[:, 2] > 0.0
        deepest = float(np.max(self.depth_m))
        furthest = np.where(
            falling, (deepest - origin[:, 2]) / np.where(falling, direction[:, 2], 1.0), np.nan
        )
        furthest = np.where(furthest > 0.0, furthest, np.nan) * (1.0 + 1e-12)
        fractions = np.linspace(0.0, 1.0, _MARCH_STEPS + 1)
        gaps = self._gap(origin[:, None], direction[:, None], furthest[:, None] * fractions)
        under = (gaps[:, 1:] <= 0.0) & (gaps[:, :-1] > 0.0)
        found = under.any(axis=1)
        first = under.argmax(axis=1)
        low, high = furthest * fractions[first], furthest * fractions[first + 1]
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            above = self._gap(origin, direction, middle) > 0.0
            low, high = np.where(above, middle, low), np.where(above, high, middle)
        reach = np.where(found, 0.5 * (low + high), np.nan)
        spot = origin + reach[:, None] * direction
        _, slope_north, slope_east = self.depth_at(spot[:, 0], spot[:, 1])
        normal = np.stack([-slope_north, -slope_east, np.ones_like(slope_north)], axis=1)
        cosine = np.abs((direction * normal).sum(axis=1)) / np.linalg.norm(normal, axis=1)
        return reach.reshape(shape), np.where(found, cosine, np.nan).reshape(shape)

    def _gap(self, origin: FloatArray, direction: FloatArray, distance: FloatArray) -> FloatArray:
        spot = origin + distance[..., None] * direction
        depth, _, _ = self.depth_at(spot[..., 0], spot[..., 1])
        return np.asarray(depth - spot[..., 2])


def rolling_seabed(
    *, depth_m: float, relief_m: float, wavelength_m: float, half_width_m: float, spacing_m: float = 5.0
) -> GridSeabed:
    """A synthetic grid: crossed sine undulations of a given relief (m, crest to mean) and wavelength (m).

    Raises:
        ScenarioError: for a length that is not positive, or a relief of the depth or more.
    """
    if min(depth_m, wavelength_m, half_width_m, spacing_m) <= 0.0 or not 0.0 <= relief_m < depth_m:
        raise ScenarioError(
            "lengths must be positive and the relief less than the depth", place="rolling seabed"
        )
    count = 2 * int(np.ceil(half_width_m / spacing_m)) + 1
    axis: FloatArray = spacing_m * (np.arange(count, dtype=np.float64) - count // 2)
    phase = 2.0 * np.pi * axis / wavelength_m
    undulation_m = 0.5 * relief_m * (np.sin(phase)[:, None] + np.sin(0.7 * phase)[None, :])
    return GridSeabed(north_m=axis, east_m=axis, depth_m=depth_m + undulation_m)


def load_grid(path: Path) -> GridSeabed:
    """Read a user's grid: TOML with north_m, east_m and depth_m (rows north), or .npz with the same names.

    Raises:
        ScenarioError: naming the file, for a missing array or a file that cannot be read.
    """
    names = ("north_m", "east_m", "depth_m")
    try:
        tables: dict[str, Any]
        if path.suffix == ".npz":
            with np.load(path, allow_pickle=False) as archive:
                tables = {name: np.asarray(archive[name], dtype=np.float64) for name in names}
        else:
            content = parse_toml(read_text(path), place=str(path))
            tables = {name: np.asarray(content[name], dtype=np.float64) for name in names}
    except KeyError as error:
        raise ScenarioError(
            f"{error} is missing", place=f"seabed grid {path}", expected=f"{', '.join(names)}"
        ) from error
    except (OSError, ValueError, TypeError, EOFError, RecursionError, zipfile.BadZipFile) as error:
        raise ScenarioError(f"cannot be read: {error}", place=f"seabed grid {path}") from error
    return GridSeabed(**tables)


def seabed_from_table(read: AnySeabed) -> Seabed:
    """The seabed of a section [seabed].

    Raises:
        ScenarioError: for a grid that cannot be read.
    """
    if isinstance(read, FlatSeabedTable):
        north, east = (math.tan(math.radians(slope)) for slope in (read.slope_north_deg, read.slope_east_deg))
        return PlaneSeabed(read.depth_m, north, east)
    if isinstance(read, RollingSeabedTable):
        return rolling_seabed(**read.model_dump(exclude={"kind"}))
    return load_grid(read.path)


@dataclass(frozen=True)
class Footprints:
    """Where beams meet the bottom: range (..., B), m, and angle of incidence (..., B), rad; NaN without a bottom."""

    range_m: FloatArray
    incidence_rad: FloatArray


def footprints(
    seabed: Seabed,
    position_t_m: FloatArray,
    attitude_t_p: FloatArray,
    directions_p: FloatArray,
    lever_arms_p_m: FloatArray | None = None,
) -> Footprints:
    """Intersect every beam of every ping with the seabed.

    Args:
        seabed: the bottom.
        position_t_m, attitude_t_p: (..., 3) and (..., 4) at the pings.
        directions_p, lever_arms_p_m: (B, 3) in the platform frame; lever arms are zero by default.
    """
    directions = np.asarray(directions_p, dtype=np.float64)
    arms = np.zeros_like(directions) if lever_arms_p_m is None else np.asarray(lever_arms_p_m)
    rotation = matrices(attitude_t_p)
    rays = np.einsum("...ij,bj->...bi", rotation, directions)
    origins = np.asarray(position_t_m)[..., None, :] + np.einsum("...ij,bj->...bi", rotation, arms)
    reach, cosine = seabed.intersect(origins, rays)
    return Footprints(reach, np.arccos(np.clip(cosine, -1.0, 1.0)))
