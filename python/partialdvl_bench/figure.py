"""A figure of the leaderboard: a dot and its interval for each method, best at the top."""

import matplotlib as mpl
import numpy as np
import polars as pl
from matplotlib.figure import Figure

from bottomlock.figures.palette import INK, STYLE, new_figure, stroke

SHOWN = 4.0
"""Methods further from the best than this many spans of the better half stand at the edge, with their value."""


def leaderboard_figure(rows: pl.DataFrame, label: str) -> Figure:
    """One score of one task with 95 % intervals.

    Args:
        rows: of `tables.LEADERBOARD`, best first.
        label: of the axis.
    """
    methods = rows["method"].to_list()
    value, low, high = (rows[name].to_numpy() for name in ("value", "lo", "hi"))
    half = value[: max(2, (len(value) + 1) // 2)]
    span = max(float(half.max() - half.min()), float((high - low)[: len(half)].max()))
    # Entries that all score alike, such as those without an answer, still need a width.
    span = span or 1.0
    edge = float(value.min()) + SHOWN * span
    with mpl.rc_context(STYLE):
        figure = new_figure(height_in=0.9 + 0.25 * len(methods))
        axes = figure.subplots()
        for place, method in enumerate(methods):
            colour = stroke(method).colour
            if value[place] > edge:
                axes.annotate(
                    _words(value[place]), (1.0, place), xycoords=("axes fraction", "data"), ha="right", va="center",
                    fontsize=8.5, color=INK,
                )  # fmt: skip
                continue
            axes.plot([low[place], min(high[place], edge)], [place, place], color=colour, linewidth=1.6)
            axes.plot(value[place], place, "o", markersize=5.0, color=colour)
        axes.set_yticks(range(len(methods)), methods)
        axes.set_ylim(len(methods) - 0.4, -0.6)
        axes.set_xlim(float(low.min()) - 0.05 * span, float(np.min([edge, high.max()])) + 0.05 * span)
        axes.set_xlabel(label)
        axes.grid(visible=False, axis="y")
        figure.tight_layout()
    return figure


def _words(value: float) -> str:
    return f"{value:.{0 if value >= 100.0 else 2}f} →"
