"""Plots that share one cursor, as data for the page's script: thinned, rounded, packed."""

import base64
import hashlib
import json
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass
from typing import Any

import numpy as np

from bottomlock.figures.series import (
    Curve,
    Figure,
    Floats,
    Rows,
    Times,
    Track,
    is_utc,
    thinned_rows,
)

BUCKETS = 1200
"""Most parts of the time of which every curve keeps its least and greatest value: about the pixels of a plot."""
POINTS = 1_500_000
"""Most points of a page: with more views each has fewer parts."""
FEWEST = 200
MISSING = -(2**31)
"""Stands for no value; differences are less."""
LARGEST = 2**29
PARTS_PER_S = 1000
"""Times are in milliseconds."""


@dataclass(frozen=True, eq=False)
class Choice:
    """One of the things that a reader chooses: its name, what there is, and which is shown first."""

    name: str
    options: Sequence[str]
    first: str


@dataclass(frozen=True, eq=False)
class Plots:
    """Views of which one is shown, by choices.

    Attributes:
        caption: what is shown; for screen readers too.
        choices: in order.
        views: by an option of each choice.
        place: latitude and longitude of the origin, deg, and metres of a degree of each; None where unknown.
    """

    caption: str
    choices: Sequence[Choice]
    views: Mapping[tuple[str, ...], Figure]
    place: tuple[float, float, float, float] | None = None

    @property
    def first(self) -> Figure:
        """The view that is shown first."""
        return self.views[tuple(choice.first for choice in self.choices)]

    @property
    def has_map(self) -> bool:
        """Whether any view has a track."""
        return any(view.tracks for view in self.views.values())

    @property
    def buckets(self) -> int:
        """Equal parts of the time, of each of which every curve keeps its least and greatest value."""
        curves = {
            id(curve.value) for view in self.views.values() for panel in view.panels for curve in panel.curves
        }
        tracks = {id(track.north_m) for view in self.views.values() for track in view.tracks}
        return int(np.clip(POINTS // max(8 * len(curves) + 32 * len(tracks), 1), FEWEST, BUCKETS))

    @property
    def data(self) -> str:
        """The views as JSON without what could end a script."""
        return _json(self)


def _json(plots: Plots) -> str:
    start_ns = plots.first.start_ns
    pool = _Pool(start_ns)
    buckets = plots.buckets
    content: dict[str, Any] = {
        "start_s": start_ns / 1e9,
        "utc": is_utc(start_ns),
        "place": plots.place,
        "choices": [
            {"name": choice.name, "options": list(choice.options), "first": choice.first}
            for choice in plots.choices
        ],
        "views": {"\n".join(key): _view(view, pool, buckets) for key, view in plots.views.items()},
    }
    content |= {"arrays": pool.heads, "data": pool.packed()}
    return json.dumps(content, ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")


def _view(view: Figure, pool: "_Pool", buckets: int) -> dict[str, Any]:
    frame = () if view.frame is None else astuple(view.frame)
    return {
        "panels": [
            {
                "title": panel.title,
                "decimals": panel.decimals,
                "log": panel.log,
                "band": panel.band,
                "period": panel.period,
                "names": list(panel.names),
                "down": panel.downwards,
                "curves": [_curve(curve, panel.decimals, pool, buckets) for curve in panel.curves],
            }
            for panel in view.panels
        ],
        "tracks": [_track(track, pool, buckets) for track in view.tracks],
        "frame": [round(edge, 3) for edge in frame],
    }


def _curve(curve: Curve, decimals: int, pool: "_Pool", buckets: int) -> dict[str, Any]:
    step = 10.0 ** -(decimals + 1)
    rows = curve.rows(buckets)
    return {
        "label": curve.label,
        "colour": curve.colour,
        "dash": list(curve.dash),
        "kind": curve.kind,
        "width": curve.width,
        "t": pool.times(curve.x, rows),
        "v": pool.values(curve.value, rows, step),
        "sd": None if curve.sd is None else pool.values(curve.sd, rows, step),
    }


def _track(track: Track, pool: "_Pool", buckets: int) -> dict[str, Any]:
    given = {
        "n": track.north_m,
        "e": track.east_m,
        "sn": track.sd_north_m,
        "se": track.sd_east_m,
        "lost": track.lost,
    }
    columns = {key: value for key, value in given.items() if value is not None}
    rows = thinned_rows(track.time_ns, list(columns.values()), buckets)
    steps = {key: 1.0 if key == "lost" else 0.001 for key in columns}
    return {
        "label": track.label,
        "colour": track.colour,
        "dash": list(track.dash),
        "width": track.width,
        "t": pool.times(track.time_ns, rows),
    } | {key: pool.values(value, rows, steps[key]) for key, value in columns.items()}


class _Pool:
    """Arrays of whole numbers, each once: differences of multiples of a step, compressed together."""

    def __init__(self, start_ns: int) -> None:
        self.heads: list[list[float]] = []
        self._start_ns = start_ns
        self._parts: list[bytes] = []
        self._length = 0
        self._known: dict[bytes, int] = {}

    def times(self, time_ns: Times | Floats, rows: Rows) -> int:
        """The number of an array of times after the start, s."""
        return self.values(
            np.asarray((time_ns - self._start_ns) * 1e-9, dtype=np.float64), rows, 1.0 / PARTS_PER_S
        )

    def values(self, value: Floats, rows: Rows, step: float) -> int:
        """The number of an array of values, rounded to a step; to a greater one where they are too many steps."""
        chosen = np.asarray(value, dtype=float)[rows]
        there = np.isfinite(chosen)
        farthest = float(np.abs(chosen[there]).max(initial=0.0))
        step = max(step, farthest / LARGEST)
        whole = np.rint(chosen[there] / step).astype(np.int64)
        coded = np.full(len(chosen), MISSING, dtype="<i4")
        coded[there] = np.diff(whole, prepend=0)
        packed = coded.tobytes()
        key = hashlib.sha256(packed + repr(step).encode()).digest()
        if key not in self._known:
            self._known[key] = len(self.heads)
            self.heads.append([self._length, len(coded), step])
            self._parts.append(packed)
            self._length += len(coded)
        return self._known[key]

    def packed(self) -> str:
        """All arrays, deflated, in base 64."""
        return base64.b64encode(zlib.compress(b"".join(self._parts), 9)).decode("ascii")
