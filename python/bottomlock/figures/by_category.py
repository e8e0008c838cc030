"""Errors of methods against a swept setting, and in cases without an order of their own: sets of beams or sensors."""

from collections.abc import Mapping, Sequence

import matplotlib as mpl
import numpy as np
import polars as pl
from matplotlib.figure import Figure

from bottomlock.figures.curves import SMALL_PLACE, scale_errors
from bottomlock.figures.labels import Line, coincident, draw_lines, label_ends
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


SWEEP_WIDTH_IN, SWEEP_HEIGHT_IN = 3.9, 2.6


def sweep_figure(rows: pl.DataFrame, *, level: tuple[str, float] | None = None) -> Figure:
    """Velocity error at the end, RMS over runs, against the values of one setting on one trajectory.

    Args:
        rows: of `tables.studies.SWEEP`, of one parameter and one trajectory. The values stand at equal distances.
        level: a name and an error in m/s to compare with, drawn across.
    """
    values = rows["value"].unique(maintain_order=True).to_list()
    place = {value: k for k, value in enumerate(values)}
    curves = {}
    for (method,), part in rows.group_by("method", maintain_order=True):
        at = {place[row["value"]]: row["velocity_rms_over_runs_mps"] for row in part.iter_rows(named=True)}
        curves[str(method)] = np.array([at.get(k, np.nan) for k in range(len(values))])
    with mpl.rc_context(STYLE):
        figure = new_figure(SWEEP_HEIGHT_IN, SWEEP_WIDTH_IN)
        left, _, width, _ = SMALL_PLACE
        axes = figure.add_axes((left, 0.15, width, 0.72))
        axes.set_xlim(-0.15, len(values) - 0.85)
        axes.set_xticks(range(len(values)), values)
        axes.set_title(str(rows["trajectory"][0]).replace("_", " ") + ": velocity error, m/s", loc="left")
        errors = np.array([*curves.values()])
        scale_errors(axes, errors, [] if level is None else [level[1]])
        if level is not None:
            axes.axhline(level[1], color=FAINT, linewidth=1.4, linestyle=(0, (2, 2)), zorder=1)
            axes.annotate(
                level[0],
                (0.0, level[1]),
                xytext=(4, 4),
                textcoords="offset points",
                fontsize=9.0,
                va="bottom",
            )
        at_values = np.arange(len(values), dtype=np.float64)
        lines = [
            Line(group, at_values, curves[group[0]])
            for group in coincident({method: curves[method] for method in draw_order(list(curves))}, 2e-3)
        ]
        draw_lines(axes, lines)
        for line in lines:
            # A mark on every value.
            axes.plot(
                line.x, line.y, **(marks(line.methods[0], len(values)) | {"linestyle": "", "markevery": None})
            )
        label_ends(axes, lines)
    return figure
