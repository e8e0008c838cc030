"""The one model of a figure: curves in panels over one horizontal axis, and the tracks of a map.

A page's script draws it (`pages.plots`), and so does matplotlib (`figures.drawing`).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from bottomlock.figures.palette import STROKES

Floats = NDArray[np.float64]
Times = NDArray[np.int64]
Rows = NDArray[np.int64]

FIRST_UTC_NS = 631_152_000 * 10**9
"""1990, in Unix time: no clock of a log that begins at 0 reads that much."""
LOG_SPREAD = 12.0
"""Ratio of the largest to the smallest value above which an axis is logarithmic."""


def is_utc(time_ns: int) -> bool:
    """Whether a time is Unix time: after 1990.

    >>> is_utc(1_767_225_610 * 10**9), is_utc(0)
    (True, False)
    """
    return time_ns >= FIRST_UTC_NS


@dataclass(frozen=True, eq=False)
class Curve:
    """A quantity against time, or against what the panel has on its horizontal axis.

    Attributes:
        label: its name beside the value; "" for none.
        colour: CSS colour.
        x: (n,) in order: times in ns, or floats where the panel's axis is another one.
        value: (n,) NaN where there is none, at which the line breaks.
        sd: (n,) claimed standard deviation, shaded on both sides; None for none.
        dash: lengths of strokes and gaps, pixels; () for a whole line.
        kind: "line", "dots", "held" until the next value, "rings", "bars" from zero, or the "area" of the interval.
        width: of the line, pixels.
        interval: low and high (n,) of the value, shaded; None for none.
    """

    label: str
    colour: str
    x: NDArray[Any]
    value: Floats
    sd: Floats | None = None
    dash: Sequence[float] = ()
    kind: Literal["line", "dots", "held", "rings", "bars", "area"] = "line"
    width: float = 1.4
    interval: tuple[Floats, Floats] | None = None

    @property
    def bounds(self) -> tuple[Floats, Floats] | None:
        """Low and high (n,) of what is shaded; None for none."""
        return self.interval if self.sd is None else (self.value - self.sd, self.value + self.sd)

    def rows(self, parts: int) -> "Rows":
        """Rows that show the curve in so many parts of the time: all of one that is held; see `thinned_rows`."""
        if self.kind == "dots":
            return scattered_rows(self.x, self.value, parts)
        if self.kind != "line":
            return np.arange(len(self.x))
        shaded = [self.sd] if self.sd is not None else [*(self.interval or ())]
        return thinned_rows(self.x, [self.value, *shaded], parts)


@dataclass(frozen=True, eq=False)
class Panel:
    """Curves with one vertical axis.

    Attributes:
        title: quantity and unit.
        curves: in the order of drawing.
        decimals: of a value that is read off.
        log: whether the axis is logarithmic.
        band: low and high of a shaded range of values; None for none.
        band_label: what that range is, above the panel.
        period: of an angle that may go around; its values are shown within one turn. 0 for none.
        names: of the whole numbers from 1 on, where they stand for things; () where they are numbers.
        compared: whether its named curves are of methods, drawn with their marks and named at their ends.
        x_label: of a horizontal axis of numbers; "" for time, or for places.
        places: names of the x 0, 1, ...; () where they are times or numbers.
        joined: whether values at places are joined by lines; otherwise methods stand side by side at each place.
        least: values that the axis holds in any case.
        downwards: whether the axis points down.
        diagonal: whether x and y are one quantity, claimed and true: equal logarithmic axes, shaded above the diagonal.
    """

    title: str
    curves: Sequence[Curve]
    decimals: int = 2
    log: bool = False
    band: tuple[float, float] | None = None
    band_label: str = ""
    period: float = 0.0
    names: Sequence[str] = ()
    compared: bool = False
    x_label: str = ""
    places: Sequence[str] = ()
    joined: bool = True
    least: Sequence[float] = ()
    downwards: bool = False
    diagonal: bool = False

    @property
    def over_time(self) -> bool:
        """Whether its horizontal axis is the time."""
        return not (self.x_label or self.places)


@dataclass(frozen=True, eq=False)
class Track:
    """A way over ground.

    Attributes:
        label: its name.
        colour: CSS colour.
        time_ns: (n,) in order.
        north_m, east_m: (n,) from the origin.
        sd_north_m, sd_east_m: (n,) claimed standard deviations, drawn as ellipses; None for none.
        lost: (n,) beams lost since the point before; None where it is not shown.
        dash: as of a curve.
        width: of the line, pixels.
        kind: "way", drawn as its method; "smoothed", dotted; or the "reference", broad.
    """

    label: str
    colour: str
    time_ns: Times
    north_m: Floats
    east_m: Floats
    sd_north_m: Floats | None = None
    sd_east_m: Floats | None = None
    lost: Floats | None = None
    dash: Sequence[float] = ()
    width: float = 1.6
    kind: Literal["way", "smoothed", "reference"] = "way"


@dataclass(frozen=True, eq=False)
class Frame:
    """What a map shows, m from the origin."""

    south_m: float
    north_m: float
    west_m: float
    east_m: float


@dataclass(frozen=True, eq=False)
class Figure:
    """The tracks of a map, and panels over one horizontal axis, that are seen together.

    Attributes:
        title: above it; "" for none.
        panels: the first at the top, below the map.
        start_ns: beginning of the time that is counted; Unix time, or 0.
        size_in: width and height on paper, inches; those that its panels need for None.
        tracks: the first track is the one that is looked at.
        frame: of the map; None without tracks.
    """

    title: str
    panels: Sequence[Panel]
    start_ns: int = 0
    size_in: tuple[float, float] | None = None
    tracks: Sequence[Track] = ()
    frame: Frame | None = None


def spreads(values: Iterable[Floats]) -> bool:
    """Whether values need a logarithmic axis: their ratio exceeds `LOG_SPREAD`."""
    every = np.concatenate([np.ravel(part) for part in values])
    every = every[np.isfinite(every) & (every > 0.0)]
    return bool(every.size and every.max() > LOG_SPREAD * every.min())


def held_curve(
    label: str, colour: str, time_ns: Times, there: NDArray[np.bool_], level: float, width: float = 8.0
) -> Curve:
    """A line at a level while something is there: a point where that changes, and the first and the last.

    Args:
        label, colour, width: as of a curve.
        time_ns: (n,) in order.
        there: (n,) which times have it, until the next.
        level: value of the line.
    """
    changed = np.flatnonzero(there[1:] != there[:-1]) + 1
    rows = np.unique(np.concatenate([[0], changed, [len(there) - 1]])) if len(there) else changed
    value = np.where(there[rows], level, np.nan)
    return Curve(label, colour, time_ns[rows], value, kind="held", width=width)


def frame_of(tracks: Sequence[Track], margin: float = 0.08) -> Frame:
    """The frame that tracks need, at least 2 m wide, with a margin as a part of its extent."""
    north = np.concatenate([track.north_m for track in tracks])
    east = np.concatenate([track.east_m for track in tracks])
    north, east = north[np.isfinite(north)], east[np.isfinite(east)]
    extent = max(float(np.ptp(north)), float(np.ptp(east)), 2.0 / (1.0 + 2.0 * margin))
    edges = []
    for axis in (north, east):
        half = max(0.5 * float(np.ptp(axis)), 0.5 * extent / 3.0) + margin * extent
        middle = 0.5 * float(axis.min() + axis.max())
        edges += [middle - half, middle + half]
    return Frame(*edges)


def thinned_rows(time_ns: Times | Floats, values: Sequence[Floats], buckets: int) -> Rows:
    """Rows that keep the extremes: of each equal part of the time the least and greatest of every value.

    Args:
        time_ns: (n,) in order.
        values: (n,) each; a part's first NaN is kept too, at which a line breaks.
        buckets: number of parts. All rows stay where they are few.

    Returns:
        Rows in order; the first and the last are among them.
    """
    count = len(time_ns)
    if count <= 2 * buckets * max(1, len(values)):
        return np.arange(count)
    span = int(time_ns[-1] - time_ns[0]) + 1
    # Whole numbers: a dive of 10 h times 10⁴ parts stays below 2⁶³.
    part = (time_ns - time_ns[0]) * buckets // span
    starts = np.flatnonzero(np.concatenate([[True], np.diff(part) > 0]))
    ends = np.append(starts[1:], count)
    kept = [np.array([0, count - 1])]
    for value in values:
        missing = ~np.isfinite(value)
        for worst, pick in ((np.inf, np.argmin), (-np.inf, np.argmax)):
            filled = np.where(missing, worst, value)
            kept.append(np.array([a + pick(filled[a:b]) for a, b in zip(starts, ends, strict=True)]))
        gaps = np.flatnonzero(missing & ~np.concatenate([[False], missing[:-1]]))
        kept.append(gaps)
    return np.unique(np.concatenate(kept))


def scattered_rows(time_ns: Times | Floats, value: Floats, parts: int) -> Rows:
    """Rows of a cloud of points: evenly chosen ones, which show how it is spread, and the extremes.

    Args:
        time_ns: (n,) in order.
        value: (n,)
        parts: of the time; twice as many rows are chosen evenly, and the extremes of a quarter as many parts.
    """
    if len(time_ns) <= 3 * parts:
        return np.arange(len(time_ns))
    even = np.linspace(0, len(time_ns) - 1, 2 * parts).astype(np.int64)
    return np.union1d(even, thinned_rows(time_ns, [value], max(1, parts // 4)))


BEAM_COLOURS = tuple(
    STROKES[method].colour for method in ("tc", "info", "nsv", "elc", "ins", "weak_sway", "vhv", "plcf")
)


def valid_panel(
    time_ns: Times,
    valid: NDArray[np.bool_],
    *,
    title: str = "beams valid",
) -> Panel:
    """A line for each beam while it is valid, from beam 1 down.

    Args:
        time_ns: (n,) of the pings, in order.
        valid: (n, beams).
        title: above the panel.
    """
    curves = [
        held_curve(f"beam {k + 1}", BEAM_COLOURS[k % len(BEAM_COLOURS)], time_ns, flags, k + 1.0)
        for k, flags in enumerate(valid.T)
    ]
    return Panel(title, curves, decimals=0, names=[f"{k + 1}" for k in range(len(curves))])
