"""Every method in a panel of its own, on one scale: its curve with its interval, all the others faint behind it."""

import math

import matplotlib as mpl
import numpy as np
import polars as pl
from matplotlib.figure import Figure

from bottomlock.figures.curves import scale_errors
from bottomlock.figures.palette import FAINT, INK, STYLE, WIDTH_IN, marks, stroke

COLUMNS = 3
POINTS, FAINT_POINTS = 130, 30
"""Points of the curve of a panel, and of one in the background: as many as its size can show."""


def velocity_multiples(ensemble: pl.DataFrame, trajectory: str) -> Figure:
    """RMS over runs of the velocity error against time, a panel for each method.

    Args:
        ensemble: `tables.campaign.ENSEMBLE`.
        trajectory: one of its trajectories.
    """
    here = ensemble.filter(pl.col("trajectory") == trajectory)
    curves = {str(name): part for (name,), part in here.group_by("method", maintain_order=True)}
    rows = math.ceil(len(curves) / COLUMNS)
    with mpl.rc_context(STYLE):
        height = 0.55 + 1.35 * rows
        figure = Figure(figsize=(WIDTH_IN, height))
        panels = figure.subplots(rows, COLUMNS, sharex=True, sharey=True, squeeze=False).ravel()
        figure.subplots_adjust(
            left=0.1, right=0.985, top=1.0 - 0.42 / height, bottom=0.45 / height, wspace=0.09, hspace=0.24
        )
        every = here["velocity_rms_over_runs_mps"].to_numpy()
        for panel, method in zip(panels, curves, strict=False):
            for other, part in curves.items():
                if other != method:
                    few = _thinned(part, FAINT_POINTS)
                    panel.plot(
                        few["time_s"],
                        few["velocity_rms_over_runs_mps"],
                        color=FAINT,
                        linewidth=0.6,
                        alpha=0.55,
                    )
            own = _thinned(curves[method], POINTS)
            low, high = (own[f"velocity_rms_over_runs_{end}_mps"] for end in ("lo", "hi"))
            panel.fill_between(
                own["time_s"], low, high, color=stroke(method).colour, alpha=0.2, linewidth=0.0
            )
            panel.plot(
                own["time_s"],
                own["velocity_rms_over_runs_mps"],
                linewidth=1.7,
                **marks(method, own.height, count=4),
            )
            panel.set_title(method, loc="left", fontsize=9.0, color=INK, pad=3.0)
            panel.set_xlim(0.0, float(own["time_s"][-1]))
        scale_errors(panels[0], np.asarray(every), [])
        for panel in panels[len(curves) :]:
            panel.set_axis_off()
        for number in range(len(curves)):
            # With shared axes the panels above an empty place would have no times.
            panels[number].tick_params(labelbottom=number + COLUMNS >= len(curves))
            panels[number].tick_params(axis="both", labelsize=8.0)
        figure.text(0.012, 1.0 - 0.05 / height, "velocity error, m/s RMS", va="top", fontsize=10.0, color=INK)
        figure.text(0.985, 0.06 / height, "time, s", ha="right", va="bottom", fontsize=9.0, color=INK)
    return figure


def _thinned(curve: pl.DataFrame, points: int) -> pl.DataFrame:
    """About so many points of a curve, its end included."""
    step = max(1, curve.height // points)
    return pl.concat([curve.gather_every(step), curve.tail(1)]).unique("time_s", maintain_order=True)
