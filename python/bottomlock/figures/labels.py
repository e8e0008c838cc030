"""Names at the ends of lines, moved apart so that none overlaps another."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from bottomlock.figures.palette import marks, stroke


@dataclass(frozen=True)
class Line:
    """One line of a figure, for all methods that coincide on it; `x` and `y` have one shape."""

    methods: tuple[str, ...]
    x: NDArray[np.float64]
    y: NDArray[np.float64]


def coincident(lines: dict[str, NDArray[np.float64]], tolerance: float = 1e-4) -> list[tuple[str, ...]]:
    """Methods grouped where their lines agree to `tolerance`, relative: each group gets one label.

    >>> one = np.ones(3)
    >>> coincident({"tc": one, "info": one * (1 + 1e-9), "lc": 2 * one})
    [('tc', 'info'), ('lc',)]
    """
    groups: list[list[str]] = []
    for method, line in lines.items():
        for group in groups:
            other = lines[group[0]]
            if line.shape == other.shape and np.allclose(line, other, tolerance, 0.0, equal_nan=True):
                group.append(method)
                break
        else:
            groups.append([method])
    return [tuple(group) for group in groups]


def spread(wanted: Sequence[float], heights: Sequence[float], low: float, high: float) -> list[float]:
    """Centres nearest to the wanted ones (least squares), in their order, for labels that must not overlap.

    Neighbours that collide move as one block. Where the range from `low` to `high` is too small for all heights, all
    shrink by the same factor.

    >>> [round(place, 2) for place in spread([0.5, 0.5, 0.9], [0.1, 0.1, 0.1], 0.0, 1.0)]
    [0.45, 0.55, 0.9]
    """
    order = sorted(range(len(wanted)), key=lambda k: (wanted[k], k))
    sizes = np.array([heights[k] for k in order]) * min(1.0, (high - low) / max(sum(heights), 1e-9))
    offsets = np.cumsum(sizes) - 0.5 * sizes
    # With the heights below subtracted the centres only have to rise: pool adjacent violators.
    blocks: list[tuple[float, int]] = []
    for rank, k in enumerate(order):
        mean, size = wanted[k] - offsets[rank], 1
        while blocks and blocks[-1][0] > mean:
            before, length = blocks.pop()
            mean, size = (before * length + mean * size) / (length + size), length + size
        blocks.append((mean, size))
    rising = [mean for mean, size in blocks for _ in range(size)]
    places = [0.0] * len(wanted)
    for rank, k in enumerate(order):
        places[k] = float(np.clip(rising[rank], low, high - sizes.sum()) + offsets[rank])
    return places


def label_ends(axes: Axes, lines: Sequence[Line], *, size: float = 9.0) -> None:
    """Labels each line with its methods in the right margin, joined to the last point of the line.

    Limits, scale and position of the axes must be final.
    """
    figure = axes.get_figure(root=True)
    assert figure is not None
    row = 1.25 * size / (axes.get_position().height * figure.get_figheight() * 72.0)
    to_axes = axes.transData + axes.transAxes.inverted()
    ends = [np.clip(to_axes.transform((line.x[-1], line.y[-1])), 0.0, 1.0) for line in lines]
    names = [wrapped(line.methods) for line in lines]
    heights = [row * (1 + name.count("\n")) for name in names]
    places = spread([float(end[1]) for end in ends], heights, -0.05, 1.05)
    for line, name, (across, up), place in zip(lines, names, ends, places, strict=True):
        colour = stroke(line.methods[0]).colour
        at_edge = across > 0.99
        leader = ([1.005, 1.02, 1.035, 1.045], [up, up, place, place])
        axes.plot(
            *(leader if at_edge else ([across, 1.02, 1.045], [up, place, place])),
            transform=axes.transAxes, color=colour, linewidth=0.7, alpha=1.0 if at_edge else 0.8, clip_on=False,
        )  # fmt: skip
        axes.text(
            1.052, place, name, transform=axes.transAxes, color=colour, fontsize=size,
            va="center", ha="left", linespacing=1.1, clip_on=False,
        )  # fmt: skip


def draw_lines(axes: Axes, lines: Sequence[Line], *, width: float = 1.5, alpha: float = 1.0) -> None:
    """Every method of every line with its colour, dash and marker; the dashed ones on top, marks side by side."""
    count = sum(len(line.methods) for line in lines)
    number = 0
    for line in lines:
        for method in line.methods:
            look = marks(method, len(line.x), number / count)
            axes.plot(line.x, line.y, linewidth=width, alpha=alpha, **look)
            number += 1


def wrapped(methods: Sequence[str], width: int = 14) -> str:
    r"""The methods of one line as a label, broken to fit the margin.

    >>> wrapped(["tc", "info"])
    'tc = info'
    >>> wrapped(["tc", "weak_sway", "info", "sway_current"])
    'tc = weak_sway\n= info\n= sway_current'
    """
    rows = [methods[0]]
    for method in methods[1:]:
        if len(rows[-1]) + 3 + len(method) <= width:
            rows[-1] += f" = {method}"
        else:
            rows.append(f"= {method}")
    return "\n".join(rows)
