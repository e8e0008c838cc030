"""Errors of methods in cases that have no order of their own: sets of beams, sets of sensors."""

from collections.abc import Mapping, Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from bottomlock.figures.curves import scale_errors
from bottomlock.figures.labels import Line, coincident, label_ends
from bottomlock.figures.palette import FAINT, STYLE, draw_order, marks, new_figure
from bottomlock.figures.series import Floats

WIDTH_IN, HEIGHT_IN = 6.6, 3.9
TURNED_FROM = 5
"""Letters of a category from which their names are written at a slant."""


def category_figure(
    curves: Mapping[str, Floats],
    categories: Sequence[str],
    title: str,
    *,
    intervals: Mapping[str, tuple[Floats, Floats]] | None = None,
) -> Figure:
    """A point for each method and category, side by side; a bar where an interval is given.

    Args:
        curves: errors (categories,) of each method; NaN where it has none.
        categories: names, in the order of the axis.
        title: what is shown, with its unit.
        intervals: lower and upper ends (categories,) of methods.
    """
    place = np.arange(len(categories), dtype=np.float64)
    bounds = [end for ends in (intervals or {}).values() for end in ends]
    turned = max(map(len, categories)) >= TURNED_FROM
    with mpl.rc_context(STYLE):
        figure = new_figure(HEIGHT_IN, WIDTH_IN)
        axes = figure.add_axes((0.1, 0.24 if turned else 0.1, 0.69, 0.66 if turned else 0.8))
        axes.set_xlim(-0.4, len(categories) - 0.6)
        axes.set_xticks(place, categories, rotation=30 if turned else 0, ha="right" if turned else "center")
        axes.set_title(title, loc="left")
        scale_errors(axes, np.array([*curves.values(), *bounds]), [])
        order = draw_order(list(curves))
        groups = coincident({method: curves[method] for method in order}, 2e-3)
        methods = [method for group in groups for method in group]
        beside = {
            method: 0.7 * ((number + 0.5) / len(methods) - 0.5) for number, method in enumerate(methods)
        }
        # A line to a label begins at the last of the points.
        lines = [Line(group, place + beside[group[-1]], curves[group[0]]) for group in groups]
        axes.grid(visible=False, axis="x")
        for border in place[1:] - 0.5:
            axes.axvline(border, color=FAINT, alpha=0.25, linewidth=0.6)
        for method in methods:
            at = place + beside[method]
            look = marks(method, len(place)) | {"linestyle": "", "markevery": None}
            axes.plot(at, curves[method], **look)
            if intervals is not None and method in intervals:
                low, high = intervals[method]
                axes.vlines(at, low, high, color=look["color"], linewidth=1.4)
        label_ends(axes, lines)
    return figure
