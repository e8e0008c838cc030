"""Figures against time: RMS error with its interval, NEES with its band."""

import math
from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from bottomlock.figures.labels import Line, coincident, draw_lines, label_ends
from bottomlock.figures.palette import (
    FAINT,
    INK,
    SMALL_HEIGHT_IN,
    SMALL_WIDTH_IN,
    STYLE,
    WIDTH_IN,
    draw_order,
    marks,
    new_figure,
    stroke,
)
from bottomlock.figures.series import Floats

LOG_SPREAD = 12.0
"""Ratio of the largest to the smallest value above which the axis is logarithmic."""

PLACE = (0.115, 0.12, 0.645, 0.785)
"""Of the axes in their figure: the names of the methods stand to the right of them."""

SMALL_PLACE = (0.135, 0.145, 0.595, 0.755)
"""Of the axes in a small figure."""

_COLUMNS = {
    quantity: [f"{quantity}_rms_over_runs{end}_{unit}" for end in ("", "_lo", "_hi")]
    for quantity, unit in (("velocity", "mps"), ("attitude", "deg"))
}
_AXIS = {"velocity": "velocity error, m/s RMS", "attitude": "misalignment, degrees RMS"}


def own_axes(*, small: bool = False) -> tuple[Figure, Axes]:
    """A figure of its own for one of the drawings below, and the axes to draw on."""
    with mpl.rc_context(STYLE):
        figure = new_figure(SMALL_HEIGHT_IN, SMALL_WIDTH_IN) if small else new_figure()
        return figure, figure.add_axes(SMALL_PLACE if small else PLACE)


def draw_rms(
    axes: Axes,
    ensemble: pl.DataFrame,
    trajectory: str,
    quantity: str,
    printed: Sequence[tuple[str, float, float]] = (),
    *,
    methods: Sequence[str] | None = None,
    banded: Sequence[str] | None = None,
    titled: bool = False,
) -> None:
    """RMS over runs of methods against time, 95 % bootstrap intervals shaded.

    Args:
        axes: to draw on.
        ensemble: `tables.campaign.ENSEMBLE`.
        trajectory: one of its trajectories.
        quantity: "velocity" or "attitude".
        printed: method, time in s and value of what a paper prints; drawn as hollow diamonds.
        methods: which to draw; all by default.
        banded: methods whose interval is shaded; all that are drawn by default.
        titled: whether the title names the trajectory, for a figure that stands beside those of others.
    """
    columns = _COLUMNS[quantity]
    rows = _rows(ensemble, trajectory, methods)
    middle, low, high = (_by_method(rows, column) for column in columns)
    time_s = rows.filter(pl.col("method") == rows["method"][0])["time_s"].to_numpy()
    shaded = set(middle) if banded is None else set(banded)
    printed = [one for one in printed if one[0] in middle]
    with mpl.rc_context(STYLE):
        _label(axes, titled * f"{trajectory.replace('_', ' ')}: " + _AXIS[quantity], time_s)
        lines = []
        bounds = [values[name] for values in (low, high) for name in middle if name in shaded]
        scale_errors(axes, np.array([*middle.values(), *bounds]), [value for _, _, value in printed])
        # Overlapping bands must stay transparent.
        alpha = 0.14 if axes.get_yscale() == "log" or len(shaded) < 3 else 0.06
        for group in coincident({method: middle[method] for method in draw_order(list(middle))}):
            if shaded.intersection(group):
                axes.fill_between(
                    time_s,
                    low[group[0]],
                    high[group[0]],
                    color=stroke(group[0]).colour,
                    alpha=alpha,
                    linewidth=0.0,
                )
            lines.append(Line(group, time_s, middle[group[0]]))
        draw_lines(axes, lines)
        for method, at_s, value in printed:
            axes.plot(
                at_s, value, marker="D", markersize=7.0, markerfacecolor="none", markeredgewidth=1.5,
                color=stroke(method).colour, clip_on=False, zorder=4,
            )  # fmt: skip
        label_ends(axes, lines)


def draw_nees(
    axes: Axes,
    ensemble: pl.DataFrame,
    consistency: pl.DataFrame,
    trajectory: str,
    *,
    methods: Sequence[str] | None = None,
) -> None:
    """Mean NEES of the whole state against time, with the chi-squared band that the verdict holds it against."""
    rows = _rows(ensemble, trajectory, methods)
    band = consistency.filter((pl.col("trajectory") == trajectory) & (pl.col("quantity") == "nees"))
    nees = _by_method(rows.drop_nulls("nees_mean_over_runs"), "nees_mean_over_runs")
    time_s = rows.filter(pl.col("method") == rows["method"][0])["time_s"].to_numpy()
    with mpl.rc_context(STYLE):
        _label(axes, "mean NEES of the whole state", time_s)
        axes.axhspan(band["band_lo"][0], band["band_hi"][0], color=FAINT, alpha=0.35, linewidth=0.0)
        lines = [
            Line(group, time_s, nees[group[0]])
            for group in coincident({method: nees[method] for method in draw_order(list(nees))})
        ]
        draw_lines(axes, lines)
        scale_errors(
            axes, np.array(list(nees.values())), [float(band["band_lo"][0]), float(band["band_hi"][0])]
        )
        axes.text(
            0.0, 1.02, f"grey: consistent filter ({band['degrees'][0]} states, {band['runs'][0]} runs)",
            transform=axes.transAxes, fontsize=8.5, color=INK, va="bottom",
        )  # fmt: skip
        label_ends(axes, lines)


def _rows(ensemble: pl.DataFrame, trajectory: str, methods: Sequence[str] | None) -> pl.DataFrame:
    rows = ensemble.filter(pl.col("trajectory") == trajectory)
    return rows if methods is None else rows.filter(pl.col("method").is_in(list(methods)))


def _by_method(rows: pl.DataFrame, column: str) -> dict[str, Floats]:
    return {
        str(method): part.sort("time_s")[column].to_numpy()
        for (method,), part in rows.group_by("method", maintain_order=True)
    }


def _label(axes: Axes, label: str, time_s: Floats) -> None:
    axes.set_xlim(0.0, float(time_s[-1]))
    axes.set_xlabel("time, s")
    axes.set_title(label, loc="left", pad=16.0 if "NEES" in label else 6.0)


def scale_errors(axes: Axes, curves: Floats, marks: Sequence[float]) -> None:
    """Limits with a margin; a logarithmic axis where the spread exceeds `LOG_SPREAD`."""
    values = np.append(curves.ravel(), marks)
    finite = values[np.isfinite(values) & (values > 0.0)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.5, 1.0)
    if high > LOG_SPREAD * low:
        axes.set_yscale("log")
        axes.set_ylim(low / 1.25, high * 1.25)
        log_ticks(axes.yaxis, 12)
        axes.grid(visible=True, which="minor", axis="y", alpha=0.10)
    else:
        air = 0.05 * (high - low) or 0.05 * high
        axes.set_ylim(max(0.0, low - air), high + air)


def log_ticks(axis: Axis, most: int, subs: Sequence[float] = (1.0,)) -> None:
    """Ticks of a logarithmic axis: at most so many with numbers, at these multiples of powers of ten."""
    axis.set_major_locator(LogLocator(numticks=most, subs=subs))
    axis.set_major_formatter(FuncFormatter(plain_number))
    axis.set_minor_formatter(NullFormatter())


def plain_number(value: float, _: int) -> str:
    """Tick label of a power of ten: 0.01, 100, 10⁵.

    >>> [plain_number(10.0**k, 0) for k in (-2, 0, 3, 6)]
    ['0.01', '1', '1000', '$10^{6}$']
    """
    return f"{value:g}" if 1e-3 <= value <= 1e4 else f"$10^{{{round(np.log10(value))}}}$"


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
