"""Axes for a notebook: in a figure of pyplot, which notebooks and windows show."""

import matplotlib as mpl
from matplotlib.axes import Axes

from bottomlock.figures.palette import HEIGHT_IN, STYLE, WIDTH_IN


def shown_axes(place: tuple[float, float, float, float]) -> Axes:
    """Axes at a place of a new figure (left, bottom, width, height, as parts of it), in the style of every figure."""
    import matplotlib.pyplot as plt  # noqa: PLC0415 - it chooses a backend; only who plots needs one

    with mpl.rc_context(STYLE):
        return plt.figure(figsize=(WIDTH_IN, HEIGHT_IN)).add_axes(place)
