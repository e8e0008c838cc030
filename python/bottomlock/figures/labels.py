"""Names at the ends of lines, moved apart so that none overlaps another."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from bottomlock.figures.palette import marks


@dataclass(frozen=True)
class Line:
    """One line of a figure, for all methods that coincide on it; `x` and `y` have one shape, `colour` is its name's."""

    methods: tuple[str, ...]
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    colour: str


NEAR = 0.004
"""Of the size of the axes: lines that are nowhere farther apart are one to the eye."""


def coincident(
    axes: Axes, lines: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]]
) -> list[tuple[str, ...]]:
    """Methods grouped where their lines (x and y of each) are one to the eye: each group gets one label.

    Limits and scale of the axes must be final.
    """
    to_axes, groups = axes.transData + axes.transAxes.inverted(), dict[tuple[str, ...], NDArray[np.float64]]()
    for method, line in lines.items():
        place = to_axes.transform(np.column_stack(line))
        for group, other in groups.items():
            if place.shape == other.shape and np.allclose(place, other, 0.0, NEAR, equal_nan=True):
                groups = {
                    (*members, method) if members == group else members: outline
                    for members, outline in groups.items()
                }
                break
        else:
            groups[(method,)] = place
    return list(groups)


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
        at_edge = across > 0.99
        leader = ([1.005, 1.02, 1.035, 1.045], [up, up, place, place])
        axes.plot(
            *(leader if at_edge else ([across, 1.02, 1.045], [up, place, place])),
            transform=axes.transAxes, color=line.colour, linewidth=0.7, alpha=1.0 if at_edge else 0.8, clip_on=False,
        )  # fmt: skip
        axes.text(
            1.052, place, name, transform=axes.transAxes, color=line.colour, fontsize=size,
            va="center", ha="left", linespacing=1.1, clip_on=False,
        )  # fmt: skip


def draw_lines(
    axes: Axes, lines: Sequence[Line], *, every: bool = False, joined: bool = True, width: float = 1.4
) -> None:
    """Every method of every line with its colour, dash and marker; the dashed ones on top, marks side by side.

    Args:
        axes: to draw on.
        lines: in their order.
        every: a mark on every value.
        joined: whether lines join the values.
        width: of the lines.
    """
    methods = [(method, line) for line in lines for method in line.methods]
    for number, (method, line) in enumerate(methods):
        look = marks(method, len(line.x), number / len(methods))
        look |= ({"markevery": None} if every else {}) | ({} if joined else {"linestyle": ""})
        axes.plot(line.x, line.y, linewidth=width, **look)


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
