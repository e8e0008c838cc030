"""A figure on paper: a map, and panels above one another with one horizontal axis, drawn by matplotlib."""

import datetime as dt
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
from matplotlib.figure import Figure as Paper
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter
from numpy.typing import NDArray

from bottomlock.figures.labels import Line, draw_lines, name_beside
from bottomlock.figures.map import draw_map
from bottomlock.figures.palette import FAINT, INK, STYLE, WIDTH_IN, draw_order, new_figure, shown_figure
from bottomlock.figures.series import Curve, Figure, Floats, Panel, is_utc

HEIGHT_IN, COMPARED_IN = 1.05, 2.4
"""Of a panel, and of one that compares methods, with the title above it."""
MAP = 0.68
"""Height of a map as a part of the width of its figure."""
LEFT_IN, RIGHT_IN, NAMES_IN, BOTTOM_IN, SLANTED_IN, TITLE_IN = 0.58, 0.14, 1.28, 0.52, 0.34, 0.25
"""Around panels: to the right where nothing or names stand, below, in addition for slanted names, for a title."""
ORDERS = 6.0
"""Most decades of an axis that compares: an error that starts at 0 would stretch it without limit."""
LEAST = 5.0
"""Least extent of an axis, in units of the last decimal that is read off."""
PARTS = 600
"""Of the time: more than one in two pixels."""
SLANTED_FROM = 5
"""Letters of a name on the horizontal axis from which names are written at a slant."""


def on_paper(figure: Figure) -> Paper:
    """The figure as matplotlib has it."""
    with mpl.rc_context(STYLE):
        width, height = size_in(figure)
        paper = new_figure(height_in=height, width_in=width)
        draw(_stacked(paper, figure), figure)
        paper.text(0.012, 1.0 - 0.06 / height, figure.title, ha="left", va="top", fontsize=10.0, color=INK)
    return paper


def shown(figure: Figure, axes: Sequence[Axes] | None = None) -> list[Axes]:
    """Draws the panels on these axes, or on those of a new figure that pyplot shows."""
    drawn = _stacked(shown_figure(size_in(figure)), figure) if axes is None else list(axes)
    draw(drawn, figure)
    return drawn


def size_in(figure: Figure) -> tuple[float, float]:
    """Width and height of a figure, inches."""
    if figure.size_in is not None:
        return figure.size_in
    return WIDTH_IN, _below_in(figure) + TITLE_IN * bool(figure.title) + sum(_heights_in(figure))


def _heights_in(figure: Figure) -> list[float]:
    """Heights that a map, with its axis below where panels follow, and the panels need."""
    width = WIDTH_IN if figure.size_in is None else figure.size_in[0]
    maps = [] if figure.frame is None else [MAP * width + BOTTOM_IN * bool(figure.panels)]
    return [*maps, *map(_height_in, figure.panels)]


def _height_in(panel: Panel) -> float:
    return COMPARED_IN if panel.compared else HEIGHT_IN


def _below_in(figure: Figure) -> float:
    return BOTTOM_IN + SLANTED_IN * any(_is_slanted(panel) for panel in figure.panels)


def _is_slanted(panel: Panel) -> bool:
    return any(len(name) >= SLANTED_FROM for name in panel.places)


def _stacked(paper: Paper, figure: Figure) -> list[Axes]:
    """Axes of map and panels, the first at the top; they share the room in proportion to the heights that they need."""
    width, height = size_in(figure)
    named = len(figure.tracks) > 1 or any(panel.compared for panel in figure.panels)
    right = NAMES_IN if named else RIGHT_IN
    bottom, heights = height - TITLE_IN * bool(figure.title), _heights_in(figure)
    share = (bottom - _below_in(figure)) / sum(heights)
    axes: list[Axes] = []
    with mpl.rc_context(STYLE):
        for panel, natural in zip(
            [None] * (figure.frame is not None) + [*figure.panels], heights, strict=True
        ):
            bottom -= share * natural
            above, below = 0.38 if panel and panel.compared else 0.29, 0.0
            if panel is None:
                above, below = 0.06, BOTTOM_IN * bool(figure.panels)
            place = (LEFT_IN, bottom + below, width - LEFT_IN - right, share * natural - above - below)
            of_paper = (place[0] / width, place[1] / height, place[2] / width, place[3] / height)
            over = axes[-1] if panel is not None and axes[figure.frame is not None :] else None
            axes.append(paper.add_axes(of_paper, sharex=over))
            if panel is not None and panel is not figure.panels[-1]:
                axes[-1].tick_params(labelbottom=False)
    return axes


def draw(axes: Sequence[Axes], figure: Figure) -> None:
    """The map, and each panel over the same time, on axes of their own whose place is final; the last name the time."""
    with mpl.rc_context(STYLE):
        if figure.frame is not None:
            draw_map(axes[0], figure.tracks, figure.frame)
        below = axes[figure.frame is not None :]
        utc = is_utc(figure.start_ns)
        x = [
            _across(figure, panel, curve.x)
            for panel in figure.panels
            for curve in panel.curves
            if len(curve.x)
        ]
        for its, panel in zip(below, figure.panels, strict=True):
            _horizontal(its, panel, x)
            if panel.over_time and utc:
                _calendar(its)
            _panel(its, panel, figure)
        if figure.panels and figure.panels[-1].over_time:
            day = dt.datetime.fromtimestamp(figure.start_ns * 1e-9, tz=dt.UTC)
            axes[-1].set_xlabel(f"UTC, from {day:%Y-%m-%d}" if utc else "time from the start, s")


def _across(figure: Figure, panel: Panel, x: NDArray[Any]) -> Floats:
    """(n,) x as the axis counts it: days of Unix time, seconds from the start, or numbers as they are."""
    if not panel.over_time:
        return np.asarray(x, dtype=np.float64)
    return np.asarray(x / 86400e9 if is_utc(figure.start_ns) else (x - figure.start_ns) / 1e9)


def _horizontal(axes: Axes, panel: Panel, x: Sequence[Floats]) -> None:
    """Limits and ticks of the horizontal axis, which holds all these x."""
    if panel.places:
        margin, slanted = 0.15 if panel.joined else 0.4, _is_slanted(panel)
        axes.set_xlim(-margin, len(panel.places) - 1 + margin)
        look = {"rotation": 30, "ha": "right"} if slanted else {"rotation": 0, "ha": "center"}
        axes.set_xticks(range(len(panel.places)), panel.places, **look)  # type: ignore[arg-type]
    elif panel.diagonal:
        every = np.concatenate([*x, *(curve.value for curve in panel.curves)])
        every = every[np.isfinite(every) & (every > 0.0)]
        low, high = float(every.min()) / 1.3, float(every.max()) * 1.3
        axes.set(xscale="log", yscale="log", xlim=(low, high), ylim=(low, high))
        log_ticks(axes.xaxis, 12)
    elif x:
        low, high = min(float(part.min()) for part in x), max(float(part.max()) for part in x)
        if panel.over_time and 0.0 < low < 0.05 * high:
            low = 0.0
        axes.set_xlim(low, high if high > low else low + 1.0)
    if panel.x_label:
        axes.set_xlabel(panel.x_label)


def _calendar(axes: Axes) -> None:
    locator = AutoDateLocator(tz=dt.UTC)  # type: ignore[no-untyped-call]
    axes.xaxis.set_major_locator(locator)
    axes.xaxis.set_major_formatter(
        ConciseDateFormatter(  # type: ignore[no-untyped-call]
            locator, tz=dt.UTC, show_offset=False, zero_formats=["", "%Y", "%b", "%d %b", "%H:%M", "%H:%M"]
        )
    )


def _panel(axes: Axes, panel: Panel, figure: Figure) -> None:
    """Draws a panel whose horizontal axis is final."""
    _background(axes, panel)
    if not panel.curves:
        axes.text(0.5, 0.5, "too few values", transform=axes.transAxes, ha="center", color=FAINT)
    thinned = [_thinned(curve) if panel.over_time else curve for curve in panel.curves]
    curves = [replace(curve, x=_across(figure, panel, curve.x)) for curve in thinned]
    named = [curve for curve in curves if panel.compared and curve.label]
    for curve in curves:
        if curve not in named:
            _draw(axes, curve)
    _vertical(axes, panel)
    size, pad = 10.0 if panel.compared else 9.0, 4.0 + 11.0 * bool(panel.band_label)
    axes.set_title(panel.title, loc="left", fontsize=size, pad=pad)
    if named:
        name_beside(axes, _compared(axes, panel, named))
    elif not panel.names:
        _legend(axes, panel.curves)


def _background(axes: Axes, panel: Panel) -> None:
    """The diagonal, the band with its words, and borders between what stands side by side."""
    if panel.diagonal:
        low, high = axes.get_xlim()
        axes.plot([low, high], [low, high], color=INK, linewidth=1.0, zorder=1)
        axes.fill_between([low, high], [low, high], [high, high], color=FAINT, alpha=0.14, linewidth=0.0)
    if panel.band is not None:
        axes.axhspan(*panel.band, color=FAINT, alpha=0.35, linewidth=0.0)
        axes.text(0.0, 1.02, panel.band_label, transform=axes.transAxes, fontsize=8.5, color=INK, va="bottom")
    if not panel.joined:
        axes.grid(visible=False, axis="x")
        for border in np.arange(1, len(panel.places)) - 0.5:
            axes.axvline(border, color=FAINT, alpha=0.25, linewidth=0.6)


def _vertical(axes: Axes, panel: Panel) -> None:
    """Limits and ticks of the vertical axis."""
    if panel.diagonal:
        log_ticks(axes.yaxis, 12)
    elif panel.log:
        axes.set_yscale("log")
        if panel.compared:
            axes.set_ylim(*_decades(panel))
            axes.grid(visible=True, which="minor", axis="y", alpha=0.10)
        elif any(curve.kind == "bars" for curve in panel.curves):
            axes.set_ylim(0.5, 1.6 * float(_drawn(panel).max()))
        log_ticks(axes.yaxis, 12 if panel.compared else 5)
    elif panel.names:
        axes.set_yticks(np.arange(1, len(panel.names) + 1), panel.names)
        axes.set_ylim(len(panel.names) + 0.6, 0.4)
        axes.grid(visible=False, axis="y")
    elif panel.period:
        axes.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 1.8, 3.6, 4.5, 9, 10]))
        axes.yaxis.set_major_formatter(FuncFormatter(partial(_within, panel.period)))
    elif panel.compared:
        every = _drawn(panel)
        low, high = (float(every.min()), float(every.max())) if every.size else (0.5, 1.0)
        air = 0.05 * (high - low) or 0.05 * high
        axes.set_ylim(max(0.0, low - air), high + air)
    else:
        # What is constant looks constant: an axis is no finer than the values that are read off it.
        axes.update_datalim([(axes.get_xlim()[0], value) for value in panel.least], updatex=False)
        axes.autoscale_view(scalex=False)
        (low, high), least = axes.get_ylim(), LEAST * 10.0**-panel.decimals
        if high - low < least:
            axes.set_ylim(0.5 * (low + high - least), 0.5 * (low + high + least))
        axes.yaxis.set_major_locator(MaxNLocator(4))
    if panel.downwards:
        axes.invert_yaxis()


def _drawn(panel: Panel) -> Floats:
    """Every finite value of a panel that compares, with its intervals and band; of a logarithmic axis those above 0."""
    shaded = [end for curve in panel.curves for end in curve.bounds or ()]
    every = np.concatenate([*(curve.value for curve in panel.curves), *shaded, np.array(panel.band or ())])
    return np.asarray(every[np.isfinite(every) & ((every > 0.0) | (not panel.log))])


def _decades(panel: Panel) -> tuple[float, float]:
    """Limits of a logarithmic axis, its band within."""
    every = _drawn(panel)
    high = 1.3 * float(every.max(initial=1e-9))
    low = min([float(np.percentile(every, 0.1)), *(panel.band or ())]) if every.size else high
    return max(low / 1.4, high / 10.0**ORDERS), high


def _compared(axes: Axes, panel: Panel, curves: Sequence[Curve]) -> list[Artist]:
    """Draws curves of methods, and gives what the legend names."""
    areas = [curve for curve in curves if curve.kind == "area"]
    for curve in areas:
        _shade(axes, curve, 1.0)
    of = {curve.label: curve for curve in curves if curve.kind != "area"}
    names = draw_order(list(of))
    if not panel.joined:
        for k, name in enumerate(names):
            of[name] = replace(of[name], x=of[name].x + 0.7 * ((k + 0.5) / len(names) - 0.5))
    # Overlapping bands must stay transparent.
    alpha = 0.14 if panel.log or sum(curve.bounds is not None for curve in curves) < 3 else 0.06
    for name in names:
        _shade(axes, of[name], alpha)
    lines = [Line(name, of[name].x, of[name].value) for name in names]
    drawn = draw_lines(axes, lines, every=bool(panel.places), joined=panel.joined)
    return [*drawn, *(Patch(color=curve.colour, label=curve.label) for curve in areas)]


def _shade(axes: Axes, curve: Curve, alpha: float) -> None:
    """The interval of a curve as an area; nothing where it has none."""
    if curve.bounds is not None:
        axes.fill_between(curve.x, *curve.bounds, color=curve.colour, alpha=alpha, linewidth=0.0)


def _within(period: float, value: float, _: int) -> str:
    """A value within one period, as the label of a tick."""
    return f"{value % period:g}"


def _thinned(curve: Curve) -> Curve:
    """The curve without what no eye can tell apart, and with its extremes."""
    rows = curve.rows(PARTS)
    sd = None if curve.sd is None else curve.sd[rows]
    interval = None if curve.interval is None else (curve.interval[0][rows], curve.interval[1][rows])
    return replace(curve, x=curve.x[rows], value=curve.value[rows], sd=sd, interval=interval)


def _draw(axes: Axes, curve: Curve) -> None:
    x = curve.x
    _shade(axes, curve, 0.2)
    if curve.kind == "dots":
        axes.plot(x, curve.value, ".", markersize=2.0, color=curve.colour, label=curve.label)
    elif curve.kind == "rings":
        axes.plot(
            x, curve.value, "o", markersize=7.0, markerfacecolor="none", markeredgewidth=1.5, color=curve.colour,
            clip_on=False, zorder=4,
        )  # fmt: skip
    elif curve.kind == "bars":
        width = float(x[1] - x[0])
        axes.bar(x, curve.value, width=width, color=curve.colour, alpha=0.75, linewidth=0.0)
        axes.set_xlim(x[0] - 0.5 * width, x[-1] + 0.5 * width)
    else:
        dash = (0, tuple(length / curve.width for length in curve.dash)) if curve.dash else "-"
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


def log_ticks(axis: Axis, most: int) -> None:
    """Ticks of a logarithmic axis: at most so many, at powers of ten."""
    axis.set_major_locator(LogLocator(numticks=most, subs=(1.0,)))
    axis.set_major_formatter(FuncFormatter(plain_number))
    axis.set_minor_formatter(NullFormatter())


def plain_number(value: float, _: int) -> str:
    """Tick label of a power of ten: 0.01, 100, 10⁵.

    >>> [plain_number(10.0**k, 0) for k in (-2, 0, 3, 6)]
    ['0.01', '1', '1000', '$10^{6}$']
    """
    return f"{value:g}" if 1e-3 <= value <= 1e4 else f"$10^{{{round(np.log10(value))}}}$"
