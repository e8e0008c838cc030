"""Axes for a notebook: in a figure of pyplot, which notebooks and windows show."""

from typing import TYPE_CHECKING

import matplotlib as mpl
from matplotlib.axes import Axes

from bottomlock.figures.palette import HEIGHT_IN, STYLE, WIDTH_IN

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def shown_axes(
    place: tuple[float, float, float, float], *, size_in: tuple[float, float] = (WIDTH_IN, HEIGHT_IN)
) -> Axes:
    """Axes at a place of a new figure (left, bottom, width, height, as parts of it), in the style of every figure."""
    figure = shown_figure(size_in)
    with mpl.rc_context(STYLE):
        return figure.add_axes(place)


def shown_figure(size_in: tuple[float, float]) -> "Figure":
    """A new figure without axes, width and height in inches."""
    import matplotlib.pyplot as plt  # noqa: PLC0415 - it chooses a backend; only who plots needs one

    with mpl.rc_context(STYLE):
        return plt.figure(figsize=size_in)
