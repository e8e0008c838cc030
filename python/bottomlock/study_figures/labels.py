"""Names at the ends of lines, nudged apart until none lies on another."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.transforms import blended_transform_factory
from numpy.typing import NDArray

from bottomlock.study_figures.palette import stroke


@dataclass(frozen=True)
class Line:
    """One line of a figure, drawn for all the arms that fall together on it."""

    arms: tuple[str, ...]
    x: NDArray[np.float64]
    y: NDArray[np.float64]


def coincident(lines: dict[str, NDArray[np.float64]], tolerance: float = 1e-4) -> list[tuple[str, ...]]:
    """Arms grouped where their lines agree to one part in ten thousand: these get one name together.

    >>> one = np.ones(3)
    >>> coincident({"tc": one, "info": one * (1 + 1e-9), "lc": 2 * one})
    [('tc', 'info'), ('lc',)]
    """
    groups: list[list[str]] = []
    for arm, line in lines.items():
        for group in groups:
            if np.allclose(line, lines[group[0]], rtol=tolerance, atol=0.0, equal_nan=True):
                group.append(arm)
                break
        else:
            groups.append([arm])
    return [tuple(group) for group in groups]


def spread(wanted: Sequence[float], gap: float, low: float, high: float) -> list[float]:
    """Places near the wanted ones, in their order, at least a gap apart and between low and high.

    The least-squares nearest places: neighbours that collide move as one block. Where the room is too small for the
    gap, the gap shrinks.

    >>> [round(place, 2) for place in spread([0.5, 0.5, 0.9], 0.1, 0.0, 1.0)]
    [0.45, 0.55, 0.9]
    """
    count = len(wanted)
    if count == 0:
        return []
    gap = min(gap, (high - low) / max(1, count - 1))
    order = sorted(range(count), key=lambda k: (wanted[k], k))
    # Without the gaps the places only have to rise: pool what does not.
    blocks: list[tuple[float, int]] = []
    for rank, k in enumerate(order):
        mean, size = wanted[k] - rank * gap, 1
        while blocks and blocks[-1][0] > mean:
            before, length = blocks.pop()
            mean, size = (before * length + mean * size) / (length + size), length + size
        blocks.append((mean, size))
    rising = [mean for mean, size in blocks for _ in range(size)]
    places = [0.0] * count
    for rank, k in enumerate(order):
        places[k] = float(np.clip(rising[rank], low, high - (count - 1) * gap)) + rank * gap
    return places


def label_ends(axes: Axes, lines: Sequence[Line], *, size: float = 8.0) -> None:
    """Writes each line's arms beside its end, in the margin right of the axes.

    Limits, scale and position of the axes must be final.
    """
    height_pt = axes.get_position().height * axes.get_figure(root=True).get_figheight() * 72.0  # type: ignore[union-attr]
    to_axes = axes.transData + axes.transAxes.inverted()
    ends = [float(to_axes.transform((line.x[-1], line.y[-1]))[1]) for line in lines]
    places = spread(np.clip(ends, 0.0, 1.0).tolist(), 1.25 * size / height_pt, -0.02, 1.04)
    margin = blended_transform_factory(axes.transAxes, axes.transAxes)
    for line, end, place in zip(lines, ends, places, strict=True):
        colour = stroke(line.arms[0]).colour
        axes.plot(
            [1.005, 1.02, 1.035, 1.045], [np.clip(end, 0, 1), np.clip(end, 0, 1), place, place],
            transform=margin, color=colour, linewidth=0.7, clip_on=False, solid_capstyle="butt", zorder=1,
        )  # fmt: skip
        axes.text(
            1.052, place, wrapped(line.arms), transform=margin, color=colour, fontsize=size,
            va="center_baseline", ha="left", clip_on=False,
        )  # fmt: skip


def wrapped(arms: Sequence[str]) -> str:
    """The arms of one line as a name: "tc = info".

    >>> wrapped(["tc", "info"])
    'tc = info'
    """
    return " = ".join(arms)
