"""Selections as fractions of the runs over time."""

import matplotlib as mpl
import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bottomlock.figures.palette import FAINT, HEIGHT_IN, INK, STYLE, new_figure, stroke


def choices_figure(choices: pl.DataFrame) -> Figure:
    """A strip for each method and component: share of the runs in which each source is chosen.

    Args:
        choices: rows of `tables.campaign.CHOICES` of one trajectory.
    """
    rows = choices.sort("method", descending=True, maintain_order=True)
    times = choices.select(pl.col("time_ns").unique().sort())
    strips = rows.partition_by("method", "component", maintain_order=True)
    with mpl.rc_context(STYLE):
        figure = new_figure(height_in=max(0.5 * HEIGHT_IN, 0.95 * len(strips) + 0.6))
        all_axes = figure.subplots(len(strips), 1, sharex=True, squeeze=False)[:, 0]
        for axes, strip in zip(all_axes, strips, strict=True):
            _strip(axes, strip, times)
            axes.set_title(
                f"{strip['method'][0]}: {strip['component'][0]}", loc="left", fontsize=9.0, color=INK
            )
            axes.set_yticks([0.0, 1.0], ["0", "all"])
        all_axes[-1].set_xlabel("time, s")
        figure.subplots_adjust(left=0.08, right=0.74, top=0.93, bottom=0.13, hspace=0.75)
    return figure


def _strip(axes: Axes, rows: pl.DataFrame, times: pl.DataFrame) -> None:
    """Shares stacked from below, the most frequent source first; each labelled at the right."""
    wide = rows.pivot("source", index="time_ns", values="runs_chosen")
    wide = times.join(wide, on="time_ns", how="left", maintain_order="left").fill_null(0)
    counts = wide.drop("time_ns")
    names = sorted(counts.columns, key=lambda name: (-counts[name].sum(), name))
    runs = counts.select(names).to_numpy().astype(np.float64)
    time_s = wide["time_ns"].to_numpy() * 1e-9
    colours = [FAINT if name == "none" else stroke(name).colour for name in names]
    shares = runs / np.maximum(runs.sum(axis=1, keepdims=True), 1.0)
    axes.stackplot(time_s, *shares.T, colors=colours, linewidth=0.0)
    axes.set_ylim(0.0, 1.0)
    axes.set_xlim(float(time_s[0]), float(time_s[-1]))
    part = runs.sum(axis=0) / runs.sum()
    for k, (name, colour) in enumerate(zip(names[:4], colours, strict=False)):
        axes.annotate(
            f"{name} {100.0 * part[k]:.0f} %", (1.0, 0.92 - 0.33 * k), xycoords="axes fraction", xytext=(6, 0),
            textcoords="offset points", color=colour, fontsize=8.0, va="center", annotation_clip=False,
        )  # fmt: skip
