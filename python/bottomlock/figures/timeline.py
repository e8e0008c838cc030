"""Panels against one time, on paper: what the page's script draws, as a figure."""

import datetime as dt
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from bottomlock.figures.curves import log_ticks
from bottomlock.figures.labels import Line, coincident, draw_lines, label_ends
from bottomlock.figures.palette import FAINT, INK, STYLE, WIDTH_IN, new_figure
from bottomlock.figures.series import Curve, Floats, Panel, Times

HEIGHT_IN, COMPARED_IN = 1.05, 2.3
"""Of a panel, and of one that compares methods."""
ORDERS = 6.0
"""Most decades of an axis that compares: an error that starts at 0 would stretch it without limit."""
LEAST = 5.0
"""Least extent of an axis, in units of the last decimal that is read off."""
PARTS = 600
"""Of the time: more than one in two pixels."""


def timeline_figure(panels: Sequence[Panel], start_ns: int, *, utc: bool, title: str) -> Figure:
    """Every panel above the next, against UTC or seconds from the start.

    Args:
        panels: what to draw, each with its title above it and the names of its curves.
        start_ns: beginning of the time that is counted.
        utc: whether the times are of the calendar.
        title: text above the figure.
    """
    with mpl.rc_context(STYLE):
        width, height = timeline_size_in(panels)
        figure = new_figure(height_in=height, width_in=width)
        draw_panels(stacked_axes(figure, panels), panels, start_ns, utc=utc)
        figure.text(0.012, 1.0 - 0.06 / height, title, ha="left", va="top", fontsize=10.0, color=INK)
    return figure


def timeline_size_in(panels: Sequence[Panel]) -> tuple[float, float]:
    """Width and height of a figure of these panels, inches."""
    return WIDTH_IN, 0.75 + sum(map(_height_in, panels))


def _height_in(panel: Panel) -> float:
    return COMPARED_IN if panel.compared else HEIGHT_IN


def stacked_axes(figure: Figure, panels: Sequence[Panel]) -> list[Axes]:
    """Axes of panels with one time axis, the first at the top, in a figure of `timeline_size_in`."""
    _, height = timeline_size_in(panels)
    width, bottom = 0.68 if any(panel.compared for panel in panels) else 0.885, height - 0.25
    made: list[Axes] = []
    with mpl.rc_context(STYLE):
        for panel in panels:
            bottom -= _height_in(panel)
            place = (0.09, bottom / height, width, (_height_in(panel) - 0.28 * HEIGHT_IN) / height)
            made.append(figure.add_axes(place, sharex=made[0] if made else None))
            made[-1].tick_params(labelbottom=len(made) == len(panels))
    return made


def draw_panels(axes: Sequence[Axes], panels: Sequence[Panel], start_ns: int, *, utc: bool) -> None:
    """Each panel on axes of its own, all over the same time; the last axes name it.

    Args:
        axes: as many as panels.
        panels, start_ns, utc: as of `timeline_figure`.
    """
    with mpl.rc_context(STYLE):
        lines = [_panel(one, panel, start_ns, utc=utc) for one, panel in zip(axes, panels, strict=True)]
        for one, compared in zip(axes, lines, strict=True):
            _time_axis(one, panels, start_ns, utc=utc)
            label_ends(one, compared)
        if axes:
            day = dt.datetime.fromtimestamp(start_ns * 1e-9, tz=dt.UTC)
            axes[-1].set_xlabel(f"UTC, from {day:%Y-%m-%d}" if utc else "time from the start, s")


def _time_axis(axes: Axes, panels: Sequence[Panel], start_ns: int, *, utc: bool) -> None:
    ends = [curve.time_ns[[0, -1]] for panel in panels for curve in panel.curves if len(curve.time_ns)]
    if ends:
        low, high = _shown(np.array([np.min(ends), np.max(ends)]), start_ns, utc=utc)
        axes.set_xlim(low, high if high > low else low + 1.0)
    if utc:
        locator = AutoDateLocator(tz=dt.UTC)  # type: ignore[no-untyped-call]
        axes.xaxis.set_major_locator(locator)
        axes.xaxis.set_major_formatter(
            ConciseDateFormatter(  # type: ignore[no-untyped-call]
                locator,
                tz=dt.UTC,
                show_offset=False,
                zero_formats=["", "%Y", "%b", "%d %b", "%H:%M", "%H:%M"],
            )
        )


def _shown(time_ns: Times, start_ns: int, *, utc: bool) -> Floats:
    """Times as the axis counts them: days of Unix time, or seconds from the start."""
    return np.asarray(time_ns / 86400e9 if utc else (time_ns - start_ns) * 1e-9, dtype=np.float64)


def _panel(axes: Axes, panel: Panel, start_ns: int, *, utc: bool) -> list[Line]:
    """Draws a panel; gives the lines that are to be named at their ends, once the axes are final."""
    if panel.band is not None:
        axes.axhspan(*panel.band, color=FAINT, alpha=0.35, linewidth=0.0)
    if not panel.curves:
        axes.text(0.5, 0.5, "too few values", transform=axes.transAxes, ha="center", color=FAINT)
    named = [curve for curve in panel.curves if panel.compared and curve.label]
    for curve in panel.curves:
        if curve not in named:
            shown = _thinned(curve)
            _draw(axes, shown, _shown(shown.time_ns, start_ns, utc=utc))
    lines = _compared(axes, named, start_ns, utc=utc)
    if panel.log:
        axes.set_yscale("log")
        if named:
            axes.set_ylim(*_decades(panel))
        log_ticks(axes.yaxis, 5)
    elif panel.names:
        axes.set_yticks(np.arange(1, len(panel.names) + 1), panel.names)
        axes.set_ylim(len(panel.names) + 0.6, 0.4)
        axes.grid(visible=False, axis="y")
    elif panel.period:
        axes.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 1.8, 3.6, 4.5, 9, 10]))
        axes.yaxis.set_major_formatter(FuncFormatter(partial(_within, panel.period)))
    else:
        # What is constant looks constant: an axis is no finer than the values that are read off it.
        (low, high), least = axes.get_ylim(), LEAST * 10.0**-panel.decimals
        if high - low < least:
            axes.set_ylim(0.5 * (low + high - least), 0.5 * (low + high + least))
        axes.yaxis.set_major_locator(MaxNLocator(4))
    axes.set_title(panel.title, loc="left", fontsize=9.0, pad=3.0)
    if not panel.names and not panel.compared:
        _legend(axes, panel.curves)
    return lines


def _compared(axes: Axes, curves: Sequence[Curve], start_ns: int, *, utc: bool) -> list[Line]:
    """Draws curves of methods; those that coincide are one line."""
    by_method = {curve.label: curve for curve in curves}
    lines = []
    for group in coincident({method: curve.value for method, curve in by_method.items()}, tolerance=1e-2):
        shown = _thinned(by_method[group[0]])
        lines.append(Line(group, _shown(shown.time_ns, start_ns, utc=utc), shown.value))
    draw_lines(axes, lines, width=1.3)
    return lines


def _decades(panel: Panel) -> tuple[float, float]:
    """Limits of a logarithmic axis, its band within."""
    every = np.concatenate([*(curve.value for curve in panel.curves), np.array(panel.band or ())])
    every = every[np.isfinite(every) & (every > 0.0)]
    high = 1.4 * float(every.max(initial=1e-9))
    low = min([float(np.percentile(every, 1.0)), *(panel.band or ())]) if every.size else high
    return max(low / 1.5, high / 10.0**ORDERS), high


def _within(period: float, value: float, _: int) -> str:
    """A value within one period, as the label of a tick."""
    return f"{value % period:g}"


def _thinned(curve: Curve) -> Curve:
    """The curve without what no eye can tell apart, and with its extremes."""
    rows = curve.rows(PARTS)
    sd = None if curve.sd is None else curve.sd[rows]
    return replace(curve, time_ns=curve.time_ns[rows], value=curve.value[rows], sd=sd)


def _draw(axes: Axes, curve: Curve, x: Floats) -> None:
    if curve.sd is not None:
        low, high = curve.value - curve.sd, curve.value + curve.sd
        axes.fill_between(x, low, high, color=curve.colour, alpha=0.2, linewidth=0.0)
    dash = (0, tuple(one / curve.width for one in curve.dash)) if curve.dash else "-"
    if curve.kind == "dots":
        axes.plot(x, curve.value, ".", markersize=2.0, color=curve.colour, label=curve.label)
    else:
        style = "steps-post" if curve.kind == "held" else "default"
        axes.plot(
            x, curve.value, drawstyle=style, linestyle=dash, linewidth=curve.width, color=curve.colour,
            label=curve.label, solid_capstyle="butt",
        )  # fmt: skip


def _legend(axes: Axes, curves: Sequence[Curve]) -> None:
    """Names of the curves at the right, above the panel."""
    x, width_pt = 1.0, axes.get_window_extent().width * 72.0 / axes.figure.dpi
    for curve in reversed(curves):
        text = axes.annotate(
            curve.label, (x, 1.0), xycoords="axes fraction", xytext=(0.0, 4.0), textcoords="offset points",
            ha="right", va="baseline", fontsize=8.5, color=curve.colour,
        )  # fmt: skip
        x -= (len(text.get_text()) * 5.2 + 12.0) / width_pt
