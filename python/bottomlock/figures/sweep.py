"""Error against a swept setting: a small figure for each setting and trajectory."""

import matplotlib as mpl
import numpy as np
import polars as pl
from matplotlib.figure import Figure

from bottomlock.figures.curves import SMALL_PLACE, scale_errors
from bottomlock.figures.labels import Line, coincident, draw_lines, label_ends
from bottomlock.figures.palette import FAINT, STYLE, draw_order, marks, new_figure

WIDTH_IN, HEIGHT_IN = 3.9, 2.6


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
        figure = new_figure(HEIGHT_IN, WIDTH_IN)
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
