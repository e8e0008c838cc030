"""Recorded positions of a first case: GPS, USBL, LBL or a reference, in metres, with their resolution and scatter."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from bottomlock.geodesy import Place, tangent_from_geodetic
from bottomlock.recordings.robust import white_sd
from bottomlock.recordings.streams import Floats, Integers
from bottomlock.replay.init.found import Found
from bottomlock.replay.init.guess import Guess, angle_unit

LEAST_SD_M = 1.0
"""Positions of satellites wander by as much over minutes, which their scatter does not show."""
THROUGHOUT = 0.9
"""Part of the pings with a position near in time from which positions are there throughout."""
SATELLITES = ("gps", "gnss", "navsat", "ublox")
TRUTHS = ("ref", "gt", "truth", "ground", "slam", "telemetry", "ekf", "mocap", "qualisys", "vicon")
"""Words in the names of files."""


@dataclass(frozen=True, eq=False)
class PositionPart:
    """Positions as guessed.

    Attributes:
        found: columns.
        columns: values to be written again, by role; None where the table can be read as it is.
        unit: of latitude and longitude; None for metres.
        offset: of its clock to the IMU's.
        time_ns, north_east_m: (k,), (k, 2) rows with a position, on the IMU's clock.
        resolution_m, scatter_m: smallest step, and robust sigma of third differences.
        throughout: part of the pings that have a position within two of its steps.
        longest_gap_s: between two positions.
        latitude_rad, longitude_rad: of the first; NaN for metres.
    """

    found: Found
    columns: dict[str, Any] | None
    unit: Guess | None
    offset: Guess
    time_ns: Integers
    north_east_m: Floats
    resolution_m: float
    scatter_m: float
    throughout: float
    longest_gap_s: float
    latitude_rad: float = float("nan")
    longitude_rad: float = float("nan")

    @property
    def sd_m(self) -> float:
        """1 sigma of a position, m."""
        return float(f"{max(LEAST_SD_M, self.resolution_m, self.scatter_m):.2g}")

    @property
    def words(self) -> str:
        """Resolution, scatter and gaps."""
        gaps = f"longest gap {self.longest_gap_s:.3g} s"
        there = (
            "throughout"
            if self.throughout > THROUGHOUT
            else f"near {100.0 * self.throughout:.0f} % of the pings"
        )
        grid = "on a grid, from the first of them: " if self.unit is None and self.columns is not None else ""
        return f"{grid}resolution {self.resolution_m:.2g} m, scatter {self.scatter_m:.2g} m, {there}, {gaps}"


def guess_positions(found: Found, pings_ns: Integers, offset: Guess) -> PositionPart | None:
    """Unit and noise of positions on a clock; None with fewer than four.

    Args:
        found: their columns.
        pings_ns: (p,) times of the pings, on the IMU's clock.
        offset: of their own clock to that.
    """
    times = found.times.time_ns
    assert times is not None  # chosen so
    columns = _rewritten(found)
    unit, first = None, (np.nan, np.nan)
    if found.kind == "geodetic":
        unit = angle_unit(found.values("latitude", "longitude"), found.units.get("latitude", ""))
        if columns is not None:
            unit = Guess("deg", unit.why)
        place = (
            found.values("latitude", "longitude")
            if columns is None
            else np.stack(list(columns.values()), axis=1)
        )
        place = np.deg2rad(place) if unit.value == "deg" else place
    else:
        place = found.values("north", "east") if columns is None else np.stack(list(columns.values()), axis=1)
    good = np.isfinite(place).all(axis=1) & np.concatenate([[True], np.diff(times) > 0])
    if good.sum() < 4:
        return None
    place, own = place[good], times[good] + round(offset.value * 1e9)
    if found.kind == "geodetic":
        first = float(place[0, 0]), float(place[0, 1])
        place = tangent_from_geodetic(place[:, 0], place[:, 1], np.zeros(len(place)), Place(*first, 0.0))[
            :, :2
        ]
    scatter = float(np.max(white_sd(place, 3))) if len(place) > 11 else 0.0
    steps = [np.diff(np.unique(place[:, k].round(3))) for k in range(2)]
    least = [float(x.min()) for x in steps if x.size]
    gaps_s = np.diff(own) * 1e-9
    nearest = np.clip(np.searchsorted(own, pings_ns), 1, len(own) - 1)
    apart = np.minimum(np.abs(own[nearest] - pings_ns), np.abs(own[nearest - 1] - pings_ns))
    near = float((apart < 2e9 * float(np.median(gaps_s))).mean()) if len(pings_ns) else 0.0
    return PositionPart(
        found, columns, unit, offset, own, place, max(least, default=0.0), scatter, near, float(gaps_s.max()), *first
    )  # fmt: skip


def is_reference(found: Found, sources: int) -> bool:
    """Whether a position is what errors are measured against, by the name of its file or by what is beside it."""
    if _named(found, SATELLITES):
        return False
    beside = any(role.startswith(("ned", "v")) for role in found.extra)
    return _named(found, TRUTHS) or beside or sources > 1


def _named(found: Found, words: tuple[str, ...]) -> bool:
    return any(word in found.table.label for word in words)


def choose_positions(places: list[Found]) -> tuple[Found | None, Found | None]:
    """The reference and the GPS among recorded positions: positions that do not aid are the reference."""
    longest = max((_tens_of_seconds(one) for one in places if not one.table.independent), default=0)
    ordered = sorted(
        places,
        key=lambda one: (
            _doubt(one, longest), not _named(one, TRUTHS), not is_reference(one, len(places))
        ),
    )  # fmt: skip
    satellites = [one for one in ordered[1:] if _named(one, SATELLITES)]
    return (ordered[0] if ordered else None), (satellites[0] if satellites else None)


def _doubt(found: Found, longest: int) -> int:
    """0 for measured positions, 1 for an estimate, 2 for measured ones that cover less than half of it."""
    if not found.table.independent:
        return 1
    return 2 if _tens_of_seconds(found) < 0.5 * longest else 0


def _tens_of_seconds(found: Found) -> int:
    """How many tens of seconds have a position."""
    assert found.times.time_ns is not None  # chosen so
    return len(np.unique(found.times.time_ns // 10_000_000_000))


GRID_M = 1e5
"""Coordinates beyond it are those of a map's grid, from an origin that is not the dive's: UTM begins at 166 km east."""


MOST_MINUTES = 18_100.0
"""Largest ddmm.mmmm of a longitude, 18,000, and a little more."""


def _rewritten(found: Found) -> dict[str, Any] | None:
    """Positions in degrees where they are not, or rows without a fix are zero; None to leave them.

    Integers are of 1e-7 deg, and what no latitude and longitude are is degrees and minutes, ddmm.mmmm, as receivers
    send them.

    Those on a grid are from the first of them.
    """
    if found.kind != "geodetic":
        place = found.values("north", "east")
        whole = np.isfinite(place).all(axis=1)
        if not whole.any() or float(np.abs(place[whole]).max()) < GRID_M:
            return None
        place = place - place[int(np.argmax(whole))]
        return {"north": place[:, 0], "east": place[:, 1]}
    place = found.values("latitude", "longitude")
    none = (place == 0.0).all(axis=1)
    largest = float(np.nanmax(np.abs(place)))
    if largest > MOST_MINUTES:
        place = 1e-7 * place
    elif largest > 360.0:
        whole = np.trunc(place / 100.0)
        place = whole + (place - 100.0 * whole) / 60.0
    elif not none.any():
        return None
    place = np.where(none[:, None], np.nan, place)
    return {"latitude": place[:, 0], "longitude": place[:, 1]}
