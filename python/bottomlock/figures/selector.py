"""Selections as fractions of the runs over time."""

from typing import Any

import matplotlib as mpl
import numpy as np
import polars as pl
from matplotlib.figure import Figure

from bottomlock.figures.palette import FAINT, HEIGHT_IN, INK, STYLE, new_figure, stroke


def choices_figure(choices: pl.DataFrame, trajectory: str) -> Figure | None:
    """A strip for each method and component: share of the runs in which each source is chosen; None without a selector.

    Args:
        choices: `tables.campaign.CHOICES`.
        trajectory: one of its trajectories.
    """
    rows = choices.filter((pl.col("trajectory") == trajectory) & (pl.col("component") != "reason"))
    strips = (
        rows.select("method", "component").unique(maintain_order=True).sort("method", descending=True).rows()
    )
    if not strips:
        return None
    time_ns = rows["time_ns"].unique().sort()
    with mpl.rc_context(STYLE):
        figure = new_figure(height_in=max(0.5 * HEIGHT_IN, 0.95 * len(strips) + 0.6))
        all_axes: Any = figure.subplots(len(strips), 1, sharex=True, squeeze=False)
        for axes, (method, component) in zip(all_axes[:, 0], strips, strict=True):
            own = rows.filter((pl.col("method") == method) & (pl.col("component") == component))
            _strip(axes, own, time_ns)
            axes.set_title(f"{method}: {component}", loc="left", fontsize=9.0, color=INK)
            axes.set_yticks([0.0, 1.0], ["0", "all"])
        all_axes[-1, 0].set_xlabel("time, s")
        figure.subplots_adjust(left=0.08, right=0.74, top=0.93, bottom=0.13, hspace=0.75)
    return figure


def _strip(axes: Any, rows: pl.DataFrame, time_ns: pl.Series) -> None:  # noqa: ANN401 - matplotlib's axes
    """Shares stacked from below, the most frequent source first; each labelled at the right."""
    total = (
        rows.group_by("source")
        .agg(pl.col("runs_chosen").sum())
        .sort("runs_chosen", "source", descending=[True, False])
    )
    shares, names = [], total["source"].to_list()
    for name in names:
        at = dict(rows.filter(pl.col("source") == name).select("time_ns", "runs_chosen").rows())
        shares.append(np.array([at.get(t, 0) for t in time_ns], dtype=np.float64))
    whole = np.maximum(np.sum(shares, axis=0), 1.0)
    time_s = time_ns.to_numpy() * 1e-9
    colours = [FAINT if name == "none" else stroke(name).colour for name in names]
    axes.stackplot(time_s, *[share / whole for share in shares], colors=colours, linewidth=0.0)
    axes.set_ylim(0.0, 1.0)
    axes.set_xlim(float(time_s[0]), float(time_s[-1]))
    part = total["runs_chosen"].to_numpy() / total["runs_chosen"].sum()
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
