"""Figures of campaigns side by side: a quantity with its interval, a dot for each method and campaign."""

import matplotlib as mpl
import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bottomlock.figures.palette import STYLE, new_figure, stroke

LOG_SPREAD = 12.0
"""Ratio of the largest to the smallest value above which the axis is logarithmic."""

SPREAD = 0.7
"""Part of the distance between two campaigns over which the methods stand."""

SHORT = 60
"""Letters that all labels together have room for under the axis."""


def compare_figure(table: pl.DataFrame, trajectory: str, quantity: str) -> Figure:
    """One quantity of all campaigns on a trajectory with its 95 % intervals.

    Args:
        table: `tables.variants.COMPARISON`.
        trajectory: one of its trajectories.
        quantity: one of its quantities.
    """
    rows = table.filter((pl.col("trajectory") == trajectory) & (pl.col("quantity") == quantity))
    campaigns = rows["campaign"].unique(maintain_order=True).to_list()
    methods = rows["method"].unique(maintain_order=True).to_list()
    place = {label: k for k, label in enumerate(campaigns)}
    with mpl.rc_context(STYLE):
        # A line of names for each method, a row of them at the top.
        figure = new_figure(height_in=4.1 + 0.2 * (1 + len(methods) // 5))
        axes = figure.subplots()
        shifts = np.linspace(-0.5, 0.5, len(methods)) * SPREAD if len(methods) > 1 else np.zeros(1)
        for method, shift in zip(methods, shifts, strict=True):
            part = rows.filter(pl.col("method") == method)
            x = np.array([place[label] for label in part["campaign"]]) + shift
            value, low, high = (part[name].to_numpy() for name in ("value", "lo", "hi"))
            bounds = np.clip([value - low, high - value], 0.0, None)
            axes.errorbar(
                x,
                value,
                yerr=bounds,
                fmt=stroke(method).marker,
                markersize=5.5,
                linewidth=1.4,
                color=stroke(method).colour,
                label=method,
            )
        _scale(axes, rows)
        axes.set_xticks(range(len(campaigns)), _ticks(table, campaigns))
        axes.set_xlim(-0.6, len(campaigns) - 0.4)
        axes.grid(visible=False, axis="x")
        unit = rows["unit"][0] if rows.height else "1"
        axes.set_ylabel(quantity if unit == "1" else f"{quantity}, {unit} RMS")
        axes.legend(
            loc="lower left", bbox_to_anchor=(-0.12, 1.0), ncols=5, frameon=False, fontsize=8.5, handletextpad=0.2,
            columnspacing=1.0,
        )  # fmt: skip
        figure.tight_layout()
    return figure


def _scale(axes: Axes, rows: pl.DataFrame) -> None:
    """A logarithmic axis where the values spread widely, else one from zero."""
    low, high = (rows[name].to_numpy() for name in ("lo", "hi"))
    if rows.height and low.min() > 0.0 and high.max() > LOG_SPREAD * low.min():
        axes.set_yscale("log")
    else:
        axes.set_ylim(bottom=0.0)


def _ticks(table: pl.DataFrame, campaigns: list[str]) -> list[str]:
    """The numbers of the campaigns in the table, with their labels where these are short."""
    numbers = {label: k for k, label in enumerate(table["campaign"].unique(maintain_order=True), start=1)}
    short = max(len(label) for label in campaigns) <= SHORT // len(campaigns)
    return [f"{numbers[label]}\n{label}" if short else str(numbers[label]) for label in campaigns]
