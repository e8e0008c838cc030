"""A true trajectory: plan view and depth."""

import matplotlib as mpl
import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bottomlock.figures.palette import FAINT, INK, STROKES, STYLE

_PATH, _START, _END = STROKES["tc"].colour, STROKES["nsv"].colour, STROKES["vb"].colour


def path_figure(paths: pl.DataFrame, trajectory: str) -> Figure:
    """Plan view above depth; the depth axis holds every trajectory of the table.

    Args:
        paths: the columns of `tables.campaign.PATHS`.
        trajectory: one of its trajectories.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(4.2, 4.6), layout="constrained")
        plan, depth = figure.subplots(2, 1, height_ratios=[2.6, 1.0])
        deepest = max(float(paths["depth_m"].max()), 1.0)  # type: ignore[arg-type]
        shallowest = min(float(paths["depth_m"].min()), 0.0)  # type: ignore[arg-type]
        path = _thinned(paths.filter(pl.col("trajectory") == trajectory).sort("time_ns"))
        plan.set_title(trajectory.replace("_", " "), loc="left")
        _plan(plan, path)
        depth.plot(path["time_ns"].to_numpy() * 1e-9, path["depth_m"], color=_PATH, linewidth=1.5)
        depth.set_ylim(deepest * 1.08, shallowest - 0.08 * deepest)
        depth.set(xlabel="time, s", ylabel="depth, m")
    return figure


def _thinned(path: pl.DataFrame, points: int = 1000) -> pl.DataFrame:
    """At most so many points, the last one included."""
    step = max(1, -(-path.height // points))
    return pl.concat([path.gather_every(step), path.tail(1)]).unique("time_ns", maintain_order=True)


def _plan(axes: Axes, path: pl.DataFrame) -> None:
    north, east = path["north_m"].to_numpy(), path["east_m"].to_numpy()
    axes.plot(east, north, color=_PATH, linewidth=1.5)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.12)
    closed = np.hypot(north[-1] - north[0], east[-1] - east[0]) < 0.1 * max(np.ptp(north), np.ptp(east))
    names = ((0, "o", _START, "start, end" if closed else "start"), (-1, "s", _END, "" if closed else "end"))
    for index, marker, colour, name in names:
        size = 8.0 if closed and index == 0 else 5.5
        axes.plot(east[index], north[index], marker, color=colour, markersize=size, clip_on=False, zorder=3)
        axes.annotate(
            name, (east[index], north[index]), xytext=(8, 0), textcoords="offset points", va="center",
            color=INK, fontsize=9.0,
        )  # fmt: skip
    axes.set(xlabel="east, m", ylabel="north, m")
    axes.tick_params(color=FAINT)
