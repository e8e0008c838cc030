"""Figures of what a filter claims against what it does: deviation claimed and error made, and their ratio."""

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from bottomlock.figures.curves import plain_number
from bottomlock.figures.labels import Line, coincident, label_ends
from bottomlock.figures.palette import FAINT, INK, STYLE, draw_order, new_figure, stroke
from bottomlock.tables.results import COMPONENTS, Errors

_MARKERS = {
    "velocity": ("o", "velocity"),
    "misalignment": ("^", "attitude"),
    "position": ("s", "position"),
}


def claimed_figure(errors: Errors, methods: list[str]) -> Figure:
    """Velocity RMS over runs against the claimed sigma, one point per second; consistent methods lie on the diagonal.

    Above the diagonal a method claims more accuracy than it has.
    """
    made = {method: np.sqrt(np.mean(errors.velocity_mps[method] ** 2, axis=0)) for method in methods}
    claimed = {
        method: np.sqrt(np.mean(errors.claimed_velocity_mps[method] ** 2, axis=0)) for method in methods
    }
    paths = {method: np.concatenate([claimed[method], made[method]]) for method in draw_order(methods)}
    with mpl.rc_context(STYLE):
        figure = new_figure()
        axes = figure.add_axes((0.115, 0.125, 0.645, 0.785))
        axes.set_xscale("log")
        axes.set_yscale("log")
        every = np.concatenate(list(paths.values()))
        every = every[np.isfinite(every) & (every > 0.0)]
        low, high = float(every.min()) / 1.3, float(every.max()) * 1.3
        axes.set_xlim(low, high)
        axes.set_ylim(low, high)
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(LogLocator(numticks=12))
            axis.set_major_formatter(FuncFormatter(plain_number))
            axis.set_minor_formatter(NullFormatter())
        axes.plot([low, high], [low, high], color=INK, linewidth=1.0, zorder=1)
        axes.fill_between([low, high], [low, high], [high, high], color=FAINT, alpha=0.14, linewidth=0.0)
        axes.set_title("velocity error made, m/s RMS (shaded: more than claimed)", loc="left")
        axes.set_xlabel("velocity error claimed, m/s RMS")
        lines = []
        for group in coincident(paths):
            for method in group:
                look = stroke(method)
                axes.plot(
                    claimed[method],
                    made[method],
                    color=look.colour,
                    linestyle=look.dash,
                    linewidth=1.2,
                    alpha=0.75,
                )
            axes.plot(
                claimed[group[0]][-1],
                made[group[0]][-1],
                "o",
                color=stroke(group[0]).colour,
                markersize=5.0,
                zorder=4,
            )
            lines.append(Line(group, claimed[group[0]], made[group[0]]))
        label_ends(axes, lines)
    return figure


def normalised_figure(errors: Errors, methods: list[str]) -> Figure:
    """RMS over runs and times of error / claimed standard deviation, a mark for each component; honest is 1."""
    with mpl.rc_context(STYLE):
        figure = new_figure(height_in=0.9 + 0.27 * len(methods))
        height = figure.get_figheight()
        axes = figure.add_axes((0.19, 0.5 / height, 0.78, 1.0 - 0.82 / height))
        values = np.array([errors.ratio_rms[method] for method in methods])
        finite = values[np.isfinite(values) & (values > 0.0)]
        axes.set_xscale("log")
        axes.set_xlim(min(0.45, float(finite.min()) / 1.2), max(2.2, float(finite.max()) * 1.2))
        axes.set_ylim(len(methods) - 0.4, -0.6)
        axes.axvline(1.0, color=INK, linewidth=1.0, zorder=1)
        axes.axvspan(1.0, axes.get_xlim()[1], color=FAINT, alpha=0.14, linewidth=0.0)
        for row, method in enumerate(methods):
            colour = stroke(method).colour
            axes.plot(
                [values[row].min(), values[row].max()], [row, row], color=colour, linewidth=1.0, alpha=0.5
            )
            for component, value in zip(COMPONENTS, values[row], strict=True):
                marker, _ = _MARKERS[component.split("_")[0]]
                axes.plot(value, row, marker, color=colour, markersize=5.0, alpha=0.85, markeredgewidth=0.0)
        axes.set_yticks(range(len(methods)), methods)
        for label, method in zip(axes.get_yticklabels(), methods, strict=True):
            label.set_color(stroke(method).colour)
        axes.tick_params(axis="y", length=0.0)
        axes.grid(visible=False, axis="y")
        axes.xaxis.set_major_locator(
            LogLocator(numticks=8, subs=(1.0, 2.0, 5.0) if axes.get_xlim()[1] < 30 else (1.0,))
        )
        axes.xaxis.set_major_formatter(FuncFormatter(plain_number))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_xlabel("error / claimed deviation, RMS (right of 1: claims too much)")
        marks = [
            Line2D([], [], color=FAINT, marker=marker, linestyle="", markersize=5.0, label=label)
            for marker, label in _MARKERS.values()
        ]
        figure.legend(
            handles=marks, loc="upper left", bbox_to_anchor=(0.175, 1.0), ncols=3, frameon=False, fontsize=9.0,
            handletextpad=0.2, columnspacing=1.4,
        )  # fmt: skip
    return figure
