"""Figures of observability: the filter's standard deviations by group of states, and rank against time."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from bottomlock.figures.labels import spread
from bottomlock.figures.palette import FAINT, INK, STYLE
from bottomlock.tables.check import check
from bottomlock.tables.observability import DEVIATIONS, RANKS
from bottomlock.truth.truth import Array
from bottomlock.units import mps2_from_mg, radps_from_deg_per_h

_BLUE, _ORANGE, _GREEN = "#0072b2", "#d55e00", "#009e73"
_COLOURS = (_BLUE, _ORANGE, _GREEN)
# A line for each window; what is constant from the start is solid.
_DASHES = ("-", (0, (4, 1.6)))


@dataclass(frozen=True)
class Group:
    """States that share a panel: their common word, the panel's title and the size of its unit in SI."""

    word: str
    title: str
    unit_si: float


GROUPS: tuple[Group, ...] = (
    Group("position", "position, m", 1.0),
    Group("velocity", "velocity, m/s", 1.0),
    Group("tilt", "misalignment, deg", math.radians(1.0)),
    Group("accel bias", "accelerometer bias, mg", mps2_from_mg(1.0)),
    Group("gyro bias", "gyro bias, deg/h", radps_from_deg_per_h(1.0)),
    Group("beam bias", "beam bias, m/s", 1.0),
    Group("scale factor", "scale factor, %", 0.01),
)
"""Groups of states in the order of the panels; yaw stands with the tilts."""


@dataclass(frozen=True)
class _Line:
    """A line with its name."""

    name: str
    colour: str
    dash: Any
    time_s: Array
    value: Array


def deviation_figure(
    deviations: pl.DataFrame, ranks: pl.DataFrame, case: str, *, title: str, unobservable: Sequence[str] = ()
) -> Figure:
    """Standard deviations of every group of states and the rank, against time, for each window of a case.

    Args:
        deviations: `tables.observability.DEVIATIONS`.
        ranks: `tables.observability.RANKS`; the rank is left out where it has no rows of the case.
        case: the case.
        title: text above the figure.
        unobservable: unobservable directions, written beside the panels.

    Raises:
        DataError: for tables of other columns.
    """
    check(deviations, DEVIATIONS, place="deviations")
    check(ranks, RANKS, place="ranks")
    rows, rank_rows = deviations.filter(case=case), ranks.filter(case=case)
    windows = rows["motion"].unique(maintain_order=True).to_list()
    members = {
        group: [state for state in rows["state"].unique(maintain_order=True) if _group_of(state) is group]
        for group in GROUPS
    }
    panels = [group for group in GROUPS if members[group]]
    with mpl.rc_context(STYLE):
        count = len(panels) + (1 if rank_rows.height else 0) + (1 if unobservable else 0)
        deep = math.ceil(count / 2)
        figure = Figure(figsize=(9.4, 0.75 + 2.25 * deep))
        low, high = 0.5 / figure.get_figheight(), 1.0 - 0.8 / figure.get_figheight()
        grid = figure.add_gridspec(
            deep, 2, left=0.065, right=0.875, bottom=low, top=high, wspace=0.52, hspace=0.42
        )
        cells = [grid[k // 2, k % 2] for k in range(count)]
        for group, cell in zip(panels, cells, strict=False):
            axes = figure.add_subplot(cell)
            _draw(axes, group, _lines(rows, group, members[group], windows))
        if rank_rows.height:
            _draw_rank(figure.add_subplot(cells[len(panels)]), rank_rows, windows)
        if unobservable:
            _draw_words(figure.add_subplot(cells[-1]), unobservable)
        for axes in figure.axes[-2:]:
            if axes.axison:
                axes.set_xlabel("time, s")
        figure.text(0.065, 1.0 - 0.24 / figure.get_figheight(), title, fontsize=11.0, color=INK, va="center")
        if len(windows) > 1:
            words = f"solid: manoeuvre from the start ({windows[0]}); dashed: {windows[1]}"
            figure.text(
                0.065, 1.0 - 0.46 / figure.get_figheight(), words, fontsize=8.5, color=INK, va="center"
            )
    return figure


def _group_of(state: str) -> Group | None:
    name = "tilt" if state == "yaw" else state
    return next((group for group in GROUPS if name.startswith(group.word)), None)


def _lines(rows: pl.DataFrame, group: Group, states: Sequence[str], windows: Sequence[str]) -> list[_Line]:
    """Lines of a panel; axes that fall together in a window share one."""
    lines: list[_Line] = []
    for window, dash in zip(windows, _DASHES, strict=False):
        part = rows.filter(motion=window)
        alike: dict[int, list[int]] = {}
        values = {}
        for k, state in enumerate(states):
            series = part.filter(state=state).sort("time_ns")
            values[k] = series["sd"].to_numpy() / group.unit_si
            time_s = series["time_ns"].to_numpy() * 1e-9
            same = next((j for j in alike if np.allclose(values[j], values[k], rtol=0.01)), k)
            alike.setdefault(same, []).append(k)
        for first, all_of_them in alike.items():
            name = ", ".join(states[k].removeprefix(group.word).strip() or states[k] for k in all_of_them)
            lines.append(_Line(name, _COLOURS[first % 3], dash, time_s, values[first]))
    return lines


def _draw(axes: Axes, group: Group, lines: Sequence[_Line]) -> None:
    for line in lines:
        axes.plot(line.time_s, line.value, color=line.colour, linestyle=line.dash, linewidth=1.5)
    axes.set_title(group.title, loc="left", fontsize=9.0, pad=4.0)
    axes.set_xlim(0.0, float(lines[0].time_s[-1]))
    _scale(axes, np.concatenate([line.value for line in lines]))
    _label(axes, lines)


def _scale(axes: Axes, values: Array) -> None:
    positive = values[np.isfinite(values) & (values > 0.0)]
    low, high = (float(positive.min()), float(positive.max())) if positive.size else (0.1, 1.0)
    if high > 8.0 * low:
        axes.set_yscale("log")
        axes.set_ylim(low / 1.3, high * 1.3)
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 3.0) if high < 100.0 * low else (1.0,)))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.yaxis.set_minor_formatter(NullFormatter())
    elif high > 1.5 * low:
        axes.set_ylim(0.0, 1.08 * high)
    else:
        # Hardly any change: an axis from zero would merge the lines; the panel spans at least a tenth of their size.
        middle, half = 0.5 * (low + high), max(0.6 * (high - low), 0.05 * high)
        axes.set_ylim(middle - half, middle + half)
        axes.yaxis.set_major_locator(MaxNLocator(nbins=5))


def _label(axes: Axes, lines: Sequence[_Line]) -> None:
    """Names in the right margin; one name for the windows of a state where both end at the same place."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    to_axes = axes.transData + axes.transAxes.inverted()
    ends: list[tuple[str, str, float]] = []
    for line in lines:
        up = float(np.clip(to_axes.transform((line.time_s[-1], line.value[-1]))[1], 0.0, 1.0))
        alike = [other for other in ends if other[0] == line.name]
        if not any(abs(other[2] - up) < 0.03 for other in alike):
            dashed = alike and line.dash != _DASHES[0]
            ends.append((f"{line.name}, dashed" if dashed else line.name, line.colour, up))
    size = 8.5
    row = 1.2 * size / (axes.get_position().height * figure.get_figheight() * 72.0)
    places = spread([up for _, _, up in ends], [row] * len(ends), -0.05, 1.08)
    for (name, colour, up), place in zip(ends, places, strict=True):
        axes.plot(
            [1.005, 1.02, 1.035, 1.045], [up, up, place, place],
            transform=axes.transAxes, color=colour, linewidth=0.7, clip_on=False,
        )  # fmt: skip
        axes.text(
            1.055, place, name, transform=axes.transAxes, color=colour, fontsize=size,
            va="center", ha="left", clip_on=False,
        )  # fmt: skip


def _draw_rank(axes: Axes, ranks: pl.DataFrame, windows: Sequence[str]) -> None:
    """Steps of the rank; an undecided window leaves a gap in its line."""
    printed = ranks["printed_rank"].drop_nulls()
    lines: list[_Line] = []
    models = ranks["model"].unique(maintain_order=True).to_list()
    for (model, window), part in ranks.group_by("model", "motion", maintain_order=True):
        rows = part.sort("time_ns")
        time_s = rows["time_ns"].to_numpy() * 1e-9
        value = np.where(rows["decided"].to_numpy(), rows["rank"].to_numpy(), np.nan)
        # Lines that lie on one another are shifted apart by a little.
        shift = 0.07 * (len(lines) - 0.5)
        name = str(model) if len(models) > 1 else str(window) if len(windows) > 1 else "rank"
        colour = (_BLUE, _ORANGE)[models.index(model)]
        lines.append(
            _Line(name.removeprefix("2015, "), colour, _DASHES[windows.index(str(window))], time_s, value)
        )
        axes.step(
            time_s, value + shift, where="post", color=colour, linestyle=lines[-1].dash, linewidth=1.5,
        )  # fmt: skip
    if len(printed):
        axes.axhline(float(printed[0]), color=FAINT, linewidth=0.8)
        end = lines[0].time_s
        lines.append(_Line("rank in print", FAINT, "-", end, np.full(len(end), float(printed[0]))))
    top = max(float(np.nanmax(line.value)) for line in lines)
    axes.set_ylim(0.0, top + 1.0)
    axes.set_xlim(0.0, float(lines[0].time_s[-1]))
    axes.yaxis.set_major_locator(MaxNLocator(integer=True, nbins=6))
    axes.set_title("rank of the window until then (no line: undecided)", loc="left", fontsize=9.0, pad=4.0)
    _label(axes, [line for line in lines if np.isfinite(line.value[-1])])


def _draw_words(axes: Axes, unobservable: Sequence[str]) -> None:
    axes.set_axis_off()
    axes.set_title("unobservable", loc="left", fontsize=9.0, pad=4.0)
    for k, line in enumerate(unobservable):
        axes.text(0.0, 0.95 - 0.105 * k, line, transform=axes.transAxes, fontsize=8.0, color=INK, va="top")


def figure_names(cases: Sequence[str]) -> Mapping[str, str]:
    """A file name for each case.

    >>> figure_names(["DVL, at rest"])
    {'DVL, at rest': 'figure_1_dvl_at_rest'}
    """
    return {
        case: f"figure_{k}_{case.lower().replace(',', '').replace('/', '').replace(' ', '_')}"
        for k, case in enumerate(cases, start=1)
    }
