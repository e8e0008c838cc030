"""Plan view of tracks on paper: scaled to a frame, with claimed σ, beams lost, scale and north."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Ellipse
from matplotlib.ticker import MaxNLocator

from bottomlock.figures.labels import Line, draw_lines, name_beside
from bottomlock.figures.palette import INK, draw_order
from bottomlock.figures.series import Frame, Track

LOST_COLOURS = ("#f0c24b", "#f0862d", "#d6391f", "#9c2a6e")
"""Of a track where one, two, three, four or more beams are lost."""
ELLIPSES = 8
"""Along a track, the last of them at its end."""
LARGEST = 0.5
"""Part of the map that an ellipse may fill: a larger one would hide what is drawn."""

_LOOKS: dict[str, Any] = {
    "way": {"linewidth": 1.5},
    "smoothed": {"linewidth": 1.0, "alpha": 0.55, "linestyle": (0, (1.5, 1.2))},
    "reference": {"linewidth": 4.0, "alpha": 0.45, "zorder": 1},
}


def draw_map(axes: Axes, tracks: Sequence[Track], frame: Frame) -> None:
    """Draws tracks on axes whose place is final; what leaves the frame is cut off."""
    _scale(axes, frame)
    ways = {track.label: track for track in tracks if track.kind == "way" and track.label}
    for track in tracks:
        if track.label not in ways or track.kind != "way":
            axes.plot(track.east_m, track.north_m, color=track.colour, **_LOOKS[track.kind])
        if track.lost is not None:
            _lost(axes, track)
        if track.sd_east_m is not None:
            _ellipses(axes, track)
    drawn = [ways[name] for name in draw_order(list(ways))]
    lines = [Line(track.label, track.east_m, track.north_m) for track in drawn]
    if lines:
        name_beside(axes, draw_lines(axes, lines, width=1.3))
    _places(axes, tracks[0], ended=not ways)


def _scale(axes: Axes, frame: Frame) -> None:
    """Limits that hold the frame, with one scale for both axes."""
    box = axes.get_window_extent()
    m_per_pixel = max((frame.east_m - frame.west_m) / box.width, (frame.north_m - frame.south_m) / box.height)
    for low, high, pixels, limit in (
        (frame.west_m, frame.east_m, box.width, axes.set_xlim),
        (frame.south_m, frame.north_m, box.height, axes.set_ylim),
    ):
        middle, half = 0.5 * (low + high), 0.5 * m_per_pixel * pixels
        limit(middle - half, middle + half)


def _places(axes: Axes, first: Track, *, ended: bool) -> None:
    """Start, axes, scale bar and north; where no name stands at the end of the track, its end too."""
    (west, east), (south, north) = axes.get_xlim(), axes.get_ylim()
    width, height = east - west, north - south
    far = np.hypot(first.north_m[-1] - first.north_m[0], first.east_m[-1] - first.east_m[0])
    closed = ended and far < 0.03 * width
    marked = [(0, "o", "start, end" if closed else "start")] + [(-1, "s", "end")] * (ended and not closed)
    for row, mark, name in marked:
        place = (first.east_m[row], first.north_m[row])
        axes.plot(*place, mark, color=INK, markersize=5.0, zorder=5)
        axes.annotate(name, place, xytext=(6, 6), textcoords="offset points", fontsize=9.0)
    axes.set(xlabel="east, m", ylabel="north, m")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(6))
    length = scale_length(0.25 * width)
    x, y = west + 0.03 * width, south + 0.03 * height
    axes.plot([x, x + length], [y, y], color=INK, linewidth=2.5, solid_capstyle="butt", zorder=6)
    axes.text(x, y + 0.012 * height, scale_words(length), fontsize=8.5, va="bottom", zorder=6)
    axes.annotate(
        "N", (0.97, 0.985), (0.97, 0.885), xycoords="axes fraction", ha="center", va="center", fontsize=9.0,
        arrowprops={"arrowstyle": "-|>", "color": INK, "shrinkA": 0.0, "shrinkB": 0.0},
    )  # fmt: skip


def scale_length(most_m: float) -> float:
    """The greatest of 1, 2, 5 times a power of ten that is at most so long.

    >>> scale_length(134.0), scale_length(0.7), scale_length(5.0)
    (100.0, 0.5, 5.0)
    """
    power = 10.0 ** np.floor(np.log10(most_m))
    return float(max(digit * power for digit in (1.0, 2.0, 5.0) if digit * power <= most_m * (1.0 + 1e-9)))


def scale_words(length_m: float) -> str:
    """A length on a map.

    >>> scale_words(2000.0), scale_words(0.5)
    ('2 km', '0.5 m')
    """
    return f"{length_m / 1000.0:g} km" if length_m >= 1000.0 else f"{length_m:g} m"


def _lost(axes: Axes, track: Track) -> None:
    """A broad line in a colour where beams are lost, with a legend."""
    assert track.lost is not None
    place = np.column_stack([track.east_m, track.north_m])
    starts = np.flatnonzero(np.diff(track.lost[1:], prepend=-1.0)) + 1
    shown = {}
    for start, end in zip(starts, [*starts[1:], len(track.lost)], strict=True):
        number = int(track.lost[start])
        if number:
            index = min(number, len(LOST_COLOURS)) - 1
            (shown[number],) = axes.plot(
                *place[start - 1 : end].T, color=LOST_COLOURS[index], linewidth=4.0 + index, zorder=1.5,
                solid_capstyle="butt", label=f"{number} lost",
            )  # fmt: skip
    if shown:
        beams = axes.legend(
            handles=[shown[number] for number in sorted(shown)], title="beams", loc="upper left",
            bbox_to_anchor=(1.0, 0.3), fontsize=8.5, title_fontsize=8.5, frameon=False, alignment="left",
        )  # fmt: skip
        # The legend of the methods would take its place.
        axes.add_artist(beams)


def _ellipses(axes: Axes, track: Track) -> None:
    """2 sigma of north and east at places evenly spread over the time."""
    assert track.sd_east_m is not None
    assert track.sd_north_m is not None
    most = LARGEST * max(np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim()))
    for row in np.linspace(0, len(track.time_ns) - 1, ELLIPSES + 1).round().astype(int)[1:]:
        width, height = 4.0 * track.sd_east_m[row], 4.0 * track.sd_north_m[row]
        if 0.0 < max(width, height) < most:
            axes.add_patch(
                Ellipse(
                    (track.east_m[row], track.north_m[row]), width, height, edgecolor=track.colour,
                    facecolor="none", linewidth=0.9, alpha=0.8,
                )
            )  # fmt: skip
