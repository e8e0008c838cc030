"""Lines of methods, and the legend beside them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from numpy.typing import NDArray

from bottomlock.figures.palette import marks


@dataclass(frozen=True)
class Line:
    """One line of a figure; `x` and `y` have one shape."""

    method: str
    x: NDArray[np.float64]
    y: NDArray[np.float64]


def draw_lines(
    axes: Axes, lines: Sequence[Line], *, every: bool = False, joined: bool = True, width: float = 1.4
) -> list[Artist]:
    """Every line with colour, dash and marker of its method, for the legend; marks side by side.

    Args:
        axes: to draw on.
        lines: in their order.
        every: a mark on every value.
        joined: whether lines join the values.
        width: of the lines.
    """
    drawn: list[Artist] = []
    for number, line in enumerate(lines):
        look = marks(line.method, len(line.x), number / len(lines))
        look |= ({"markevery": None} if every else {}) | ({} if joined else {"linestyle": ""})
        drawn += axes.plot(line.x, line.y, linewidth=width, label=line.method, **look)
    return drawn


def name_beside(axes: Axes, drawn: Sequence[Artist]) -> None:
    """The names of what is drawn, in the right margin."""
    axes.legend(
        handles=drawn, loc="upper left", bbox_to_anchor=(1.0, 1.04), fontsize=8.5, frameon=False,
        labelcolor="linecolor", handlelength=1.6, labelspacing=0.25, borderpad=0.2,
    )  # fmt: skip
