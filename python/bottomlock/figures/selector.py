"""Selections as fractions of the runs over time."""

from typing import Any

import matplotlib as mpl
import numpy as np
import polars as pl
from matplotlib.figure import Figure

from bottomlock.figures.palette import FAINT, HEIGHT_IN, INK, STYLE, new_figure, stroke


def shares_table(choices: pl.DataFrame, trajectory: str) -> pl.DataFrame:
    """A row per selector, component, source and ping: runs in which the source is chosen, and their fraction.

    `method`, `component`, `source`, `time_ns`, `runs_chosen`, `chosen_fraction`; of each component the most frequent
    source first. Without rows where the trajectory has no selector.

    Args:
        choices: `tables.campaign.CHOICES`.
        trajectory: one of its trajectories.
    """
    strip = ["method", "component"]
    rows = choices.filter(pl.col("trajectory") == trajectory)
    sources = (
        rows.group_by(*strip, "source")
        .agg(pl.col("runs_chosen").sum().alias("all"))
        .sort("all", "source", descending=[True, False])
    )
    every = (
        rows.select(strip)
        .unique(maintain_order=True)
        .sort("method", descending=True, maintain_order=True)
        .join(sources, on=strip, maintain_order="left_right")
        .join(rows.select(pl.col("time_ns").unique().sort()), how="cross", maintain_order="left_right")
    )
    at = [*strip, "source", "time_ns"]
    counted = every.join(rows.select(*at, "runs_chosen"), on=at, how="left", maintain_order="left")
    return counted.select(*at, pl.col("runs_chosen").fill_null(0)).with_columns(
        chosen_fraction=pl.col("runs_chosen") / pl.col("runs_chosen").sum().over(*strip, "time_ns").clip(1)
    )


def choices_figure(shares: pl.DataFrame) -> Figure:
    """A strip for each method and component: share of the runs in which each source is chosen.

    Args:
        shares: `shares_table`, with rows.
    """
    strips = shares.select("method", "component").unique(maintain_order=True).rows()
    with mpl.rc_context(STYLE):
        figure = new_figure(height_in=max(0.5 * HEIGHT_IN, 0.95 * len(strips) + 0.6))
        all_axes: Any = figure.subplots(len(strips), 1, sharex=True, squeeze=False)
        for axes, (method, component) in zip(all_axes[:, 0], strips, strict=True):
            _strip(axes, shares.filter(method=method, component=component))
            axes.set_title(f"{method}: {component}", loc="left", fontsize=9.0, color=INK)
            axes.set_yticks([0.0, 1.0], ["0", "all"])
        all_axes[-1, 0].set_xlabel("time, s")
        figure.subplots_adjust(left=0.08, right=0.74, top=0.93, bottom=0.13, hspace=0.75)
    return figure


def _strip(axes: Any, shares: pl.DataFrame) -> None:  # noqa: ANN401 - matplotlib's axes
    """Shares stacked from below, the most frequent source first; each labelled at the right."""
    own = {str(name): one for (name,), one in shares.group_by("source", maintain_order=True)}
    names = list(own)
    time_s = own[names[0]]["time_ns"].to_numpy() * 1e-9
    colours = [FAINT if name == "none" else stroke(name).colour for name in names]
    axes.stackplot(time_s, *[one["chosen_fraction"] for one in own.values()], colors=colours, linewidth=0.0)
    axes.set_ylim(0.0, 1.0)
    axes.set_xlim(float(time_s[0]), float(time_s[-1]))
    part = np.array([one["runs_chosen"].sum() for one in own.values()]) / shares["runs_chosen"].sum()
    for k, (name, colour) in enumerate(zip(names[:4], colours, strict=False)):
        axes.annotate(
            f"{name} {100.0 * part[k]:.0f} %",
            (1.0, 0.92 - 0.33 * k),
            xycoords="axes fraction",
            xytext=(6, 0),
            textcoords="offset points",
            color=colour,
            fontsize=8.0,
            va="center",
            annotation_clip=False,
        )
