"""Figures of errors against claimed standard deviations."""

from collections.abc import Mapping

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bottomlock.figures.curves import log_ticks
from bottomlock.figures.labels import Line, coincident, draw_lines, label_ends
from bottomlock.figures.palette import FAINT, INK, STYLE, draw_order, new_figure, stroke
from bottomlock.figures.series import Floats
from bottomlock.tables.campaign import COMPONENTS

_MARKERS = {"velocity": ("o", "velocity"), "misalignment": ("^", "attitude"), "position": ("s", "position")}


def calibration_figure(curves: Mapping[str, tuple[Floats, Floats]]) -> Figure:
    """Velocity error against its claimed standard deviation over time; consistent methods lie on the diagonal.

    Args:
        curves: for each method the claimed standard deviation and the error, RMS over runs, m/s, (times,) each.
    """
    methods = draw_order(list(curves))
    paths = {method: np.concatenate(curves[method]) for method in methods}
    with mpl.rc_context(STYLE):
        figure = new_figure()
        axes = figure.add_axes((0.115, 0.125, 0.645, 0.785))
        _diagonal(axes, np.concatenate(list(paths.values())))
        axes.set_title("velocity error, m/s RMS (shaded: overconfident)", loc="left")
        axes.set_xlabel("claimed σ of velocity, m/s RMS")
        lines = [Line(group, *curves[group[0]]) for group in coincident(paths)]
        draw_lines(axes, lines, width=1.2, alpha=0.8)
        for line in lines:
            # Where it ends: a ring around the last mark.
            axes.plot(
                line.x[-1], line.y[-1], "o", color=stroke(line.methods[0]).colour, markersize=9.0,
                markerfacecolor="none", zorder=4,
            )  # fmt: skip
        label_ends(axes, lines)
    return figure


def _diagonal(axes: Axes, values: Floats) -> None:
    """Equal logarithmic axes around the values, with the diagonal and the half above it shaded."""
    positive = values[np.isfinite(values) & (values > 0.0)]
    low, high = float(positive.min()) / 1.3, float(positive.max()) * 1.3
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(low, high)
    axes.set_ylim(low, high)
    for axis in (axes.xaxis, axes.yaxis):
        log_ticks(axis, 12)
    axes.plot([low, high], [low, high], color=INK, linewidth=1.0, zorder=1)
    axes.fill_between([low, high], [low, high], [high, high], color=FAINT, alpha=0.14, linewidth=0.0)


def normalised_figure(normalised_rms: Mapping[str, Floats]) -> Figure:
    """RMS over runs and times of error/σ, a mark for each component; a consistent filter has 1.

    Args:
        normalised_rms: (9,) for each method, in the order of `tables.campaign.COMPONENTS`.
    """
    methods = list(normalised_rms)
    values = np.array([normalised_rms[method] for method in methods])
    with mpl.rc_context(STYLE):
        figure = new_figure(height_in=0.9 + 0.27 * len(methods))
        height = figure.get_figheight()
        axes = figure.add_axes((0.19, 0.5 / height, 0.78, 1.0 - 0.82 / height))
        _normalised_axis(axes, values)
        axes.set_ylim(len(methods) - 0.4, -0.6)
        for row, method in enumerate(methods):
            colour = stroke(method).colour
            ends = [values[row].min(), values[row].max()]
            axes.plot(ends, [row, row], color=colour, linewidth=1.0, alpha=0.5)
            for component, value in zip(COMPONENTS, values[row], strict=True):
                marker, _ = _MARKERS[component.split("_")[0]]
                axes.plot(value, row, marker, color=colour, markersize=5.0, alpha=0.85, markeredgewidth=0.0)
        axes.set_yticks(range(len(methods)), methods)
        for label, method in zip(axes.get_yticklabels(), methods, strict=True):
            label.set_color(stroke(method).colour)
        axes.tick_params(axis="y", length=0.0)
        axes.grid(visible=False, axis="y")
        marks = [
            Line2D([], [], color=FAINT, marker=marker, linestyle="", markersize=5.0, label=label)
            for marker, label in _MARKERS.values()
        ]
        figure.legend(
            handles=marks, loc="upper left", bbox_to_anchor=(0.175, 1.0), ncols=3, frameon=False, fontsize=9.0,
            handletextpad=0.2, columnspacing=1.4,
        )  # fmt: skip
    return figure


def _normalised_axis(axes: Axes, values: Floats) -> None:
    """A logarithmic axis of error/σ, shaded where a filter is overconfident."""
    finite = values[np.isfinite(values) & (values > 0.0)]
    axes.set_xscale("log")
    axes.set_xlim(min(0.45, float(finite.min()) / 1.2), max(2.2, float(finite.max()) * 1.2))
    axes.axvline(1.0, color=INK, linewidth=1.0, zorder=1)
    axes.axvspan(1.0, axes.get_xlim()[1], color=FAINT, alpha=0.14, linewidth=0.0)
    steps = (1.0, 2.0, 5.0) if axes.get_xlim()[1] < 30 else (1.0,)
    log_ticks(axes.xaxis, 8, steps)
    axes.set_xlabel("error/σ, RMS (shaded: overconfident)")
