"""Figures of a replay: errors with their standard deviations, innovations, NIS, valid beams."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray
from scipy.stats import chi2

from bottomlock.figures.beams import BEAM_COLOURS
from bottomlock.figures.curves import plain_number
from bottomlock.figures.labels import Line, coincident, draw_lines, label_ends
from bottomlock.figures.palette import (
    FAINT,
    INK,
    STYLE,
    WIDTH_IN,
    draw_order,
    new_figure,
    stroke,
)
from bottomlock.figures.series import scattered_rows, thinned_rows
from bottomlock.statistics.replay import error_norms
from bottomlock.tables.replay import FORWARD

Floats = NDArray[np.float64]
Times = NDArray[np.int64]
_QUANTITIES = (
    ("position", "m", "position, m"),
    ("velocity", "mps", "velocity, m/s"),
    ("attitude", "deg", "attitude, degrees"),
)
PARTS = 300
"""Parts of the time of each of which a curve shows its least and greatest value: about the pixels of a panel."""
ORDERS = 6.0
"""Most decades of an error axis: an error that starts at 0 would stretch a logarithmic axis without limit."""


def _thinned(method: tuple[str, ...], time_s: Floats, value: Floats) -> Line:
    """A curve of methods without the points that its panel cannot show."""
    rows = thinned_rows(np.rint(time_s * 1e9).astype(np.int64), [value], PARTS)
    return Line(method, time_s[rows], value[rows])


def _left_title(figure: Figure, title: str) -> None:
    figure.text(0.012, 0.992, title, ha="left", va="top", fontsize=10.0, color=INK)


def error_figure(
    samples: pl.DataFrame, *, methods: Sequence[str], title: str, which: str = FORWARD
) -> Figure:
    """Errors against the reference, norms over axes; dotted the standard deviation of each filter.

    Args:
        samples: `tables.replay.REPLAY_SAMPLES` of one what-if case.
        methods: which to draw.
        title: text above the figure.
        which: pass.
    """
    since_s = (pl.col("time_ns") - pl.col("time_ns").min()) * 1e-9
    rows = error_norms(samples).with_columns(time_s=since_s)
    rows = rows.filter((pl.col("pass") == which) & pl.col("method").is_in(list(methods)))
    methods = [method for method in methods if method in set(rows["method"])]
    shown = [q for q in _QUANTITIES if rows[f"{q[0]}_{q[1]}"].is_not_null().any()]
    with mpl.rc_context(STYLE):
        height = 0.75 + 2.05 * len(shown)
        figure = new_figure(height_in=height)
        each = (height - 0.85) / len(shown)
        for index, (name, unit, label) in enumerate(shown):
            bottom = (0.48 + (len(shown) - 1 - index) * each + 0.1) / height
            axes = figure.add_axes((0.115, bottom, 0.645, (each - 0.28) / height))
            _one_error(axes, rows, methods, name, unit)
            axes.set_title(label, loc="left", fontsize=9.5)
            if index == len(shown) - 1:
                axes.set_xlabel("time from the start, s")
            else:
                axes.tick_params(labelbottom=False)
        _left_title(figure, title)
    return figure


def _one_error(axes: Axes, rows: pl.DataFrame, methods: Sequence[str], name: str, unit: str) -> None:
    rms, sd, time_s = {}, {}, np.zeros(0)
    for method in draw_order(list(methods)):
        one = rows.filter(pl.col("method") == method)
        time_s = one["time_s"].to_numpy()
        rms[method] = one[f"{name}_{unit}"].fill_null(np.nan).to_numpy()
        sd[method] = one[f"{name}_sd_{unit}"].fill_null(np.nan).to_numpy()
    axes.set_yscale("log")
    every = np.concatenate([*rms.values(), *sd.values()])
    every = every[np.isfinite(every) & (every > 0.0)]
    high = float(every.max()) * 1.4
    axes.set_ylim(max(float(np.percentile(every, 1.0)) / 1.5, high / 10.0**ORDERS), high)
    axes.set_xlim(float(time_s[0]), float(time_s[-1]))
    axes.yaxis.set_major_locator(LogLocator(numticks=6))
    axes.yaxis.set_major_formatter(FuncFormatter(plain_number))
    axes.yaxis.set_minor_formatter(NullFormatter())
    lines = []
    for group in coincident(rms, tolerance=1e-2):
        look = stroke(group[0])
        claimed = _thinned(group, time_s, sd[group[0]])
        axes.plot(claimed.x, claimed.y, color=look.colour, linewidth=0.9, linestyle=(0, (1, 1.6)))
        lines.append(_thinned(group, time_s, rms[group[0]]))
    draw_lines(axes, lines, width=1.3)
    label_ends(axes, lines)


_DOT: Any = {"linestyle": "", "marker": ".", "markersize": 2.5}
_RING: Any = {
    "linestyle": "",
    "marker": "o",
    "markersize": 3.0,
    "markerfacecolor": "none",
    "markeredgewidth": 0.7,
}


def innovation_figure(innovations: pl.DataFrame, start_ns: int, *, method: str, title: str) -> Figure:
    """Innovations of the beams of one method with their ±2 sigma; rejected pings are hollow."""
    rows = innovations.filter(pl.col("method") == method)
    beams = sum(name.endswith("_innovation_mps") for name in rows.columns)
    times_ns = rows["time_ns"].to_numpy()
    time_s = (times_ns - start_ns) * 1e-9
    accepted = (rows["status"] != "rejected").to_numpy()
    with mpl.rc_context(STYLE):
        height = 0.8 + 0.95 * beams
        figure = Figure(figsize=(WIDTH_IN, height))
        panels = figure.subplots(beams, 1, sharex=True, sharey=True, squeeze=False)[:, 0]
        figure.subplots_adjust(
            left=0.145, right=0.985, top=1.0 - 0.36 / height, bottom=0.46 / height, hspace=0.12
        )
        spans = []
        for k, axes in enumerate(panels):
            value = rows[f"beam{k + 1}_innovation_mps"].fill_null(np.nan).to_numpy()
            sd = rows[f"beam{k + 1}_innovation_sd_mps"].fill_null(np.nan).to_numpy()
            kept = thinned_rows(times_ns, [sd], PARTS)
            axes.fill_between(
                time_s[kept], -2.0 * sd[kept], 2.0 * sd[kept], color=FAINT, alpha=0.3, linewidth=0.0
            )
            colour = BEAM_COLOURS[k % len(BEAM_COLOURS)]
            for which, look in ((accepted, _DOT), (~accepted, _RING)):
                there = np.flatnonzero(which & np.isfinite(value))
                if there.size:
                    kept = there[scattered_rows(times_ns[there], value[there], PARTS)]
                    axes.plot(time_s[kept], value[kept], color=colour, **look)
            axes.text(0.008, 0.93, f"beam {k + 1}", transform=axes.transAxes, va="top", fontsize=9.0)
            sizes = np.abs(np.concatenate([value, 2.0 * sd]))
            spans.append(float(np.nanpercentile(sizes, 99.0)) if np.isfinite(sizes).any() else 0.0)
            if not np.isfinite(value).any():
                axes.text(
                    0.5, 0.5, "no innovation", transform=axes.transAxes, ha="center", va="center", color=FAINT
                )
        limit = 1.15 * max(*spans, 1e-3)
        panels[-1].set_ylim(-limit, limit)
        if len(time_s) > 1:
            panels[-1].set_xlim(float(time_s[0]), float(time_s[-1]))
        panels[-1].set_xlabel("time from the start, s")
        figure.text(0.008, 0.5, "innovation, m/s", rotation=90, va="center", fontsize=9.5)
        _left_title(figure, title)
    return figure


WINDOW = 30
"""Pings over which NIS is averaged."""


def nis_ratios(fixes: pl.DataFrame) -> tuple[Times, Floats] | None:
    """Times and NIS over its degrees, sliding mean over `WINDOW` of a method's fixes; None for fewer than two windows.

    Args:
        fixes: `tables.replay.innovations_schema` of one method, those that have a NIS.
    """
    if fixes.height < 2 * WINDOW:
        return None
    ratio = (fixes["nis"] / fixes["degrees"]).to_numpy()
    mean = np.convolve(ratio, np.full(WINDOW, 1.0 / WINDOW), mode="valid")
    return fixes["time_ns"].to_numpy()[WINDOW - 1 :], np.asarray(mean, dtype=np.float64)


def nis_band(fixes: pl.DataFrame, least_ratio: float) -> tuple[float, float]:
    """The 95 % band of that mean for a consistent filter; its lower end is of noise as claimed under heavy tails."""
    degrees = WINDOW * float(fixes["degrees"].to_numpy().mean())
    low, high = chi2.ppf([0.025, 0.975], degrees) / degrees
    return least_ratio * float(low), float(high)


def nis_table(innovations: pl.DataFrame, methods: Sequence[str], least_ratio: float) -> pl.DataFrame:
    """What `draw_nis` draws: `method`, `time_ns`, `nis_ratio` and the method's band of it, `band_lo` and `band_hi`."""
    parts = [pl.DataFrame(schema=NIS_TABLE)]
    for method in draw_order(list(methods)):
        rows = innovations.filter(
            (pl.col("method") == method) & pl.col("nis").is_not_null() & (pl.col("degrees") > 0)
        )
        ratios = nis_ratios(rows)
        if ratios is not None:
            low, high = nis_band(rows, least_ratio)
            values = ([method] * len(ratios[0]), *ratios, low, high)
            parts.append(pl.DataFrame(dict(zip(NIS_TABLE, values, strict=True)), schema=NIS_TABLE))
    return pl.concat(parts)


NIS_TABLE: Mapping[str, pl.DataType] = {
    "method": pl.String(),
    "time_ns": pl.Int64(),
    "nis_ratio": pl.Float64(),
    "band_lo": pl.Float64(),
    "band_hi": pl.Float64(),
}


def nis_figure(
    innovations: pl.DataFrame,
    start_ns: int,
    *,
    methods: Sequence[str],
    title: str,
    least_ratio: float = 1.0,
) -> Figure:
    """As `draw_nis`, in a figure of its own."""
    with mpl.rc_context(STYLE):
        figure = new_figure(height_in=NIS_HEIGHT_IN)
        draw_nis(figure.add_axes(NIS_PLACE), innovations, start_ns, methods=methods, least_ratio=least_ratio)
        _left_title(figure, title)
    return figure


NIS_HEIGHT_IN, NIS_PLACE = 3.2, (0.115, 0.15, 0.645, 0.72)
"""Height of the figure of NIS, and the place of its axes in it."""


def draw_nis(
    axes: Axes,
    innovations: pl.DataFrame,
    start_ns: int,
    *,
    methods: Sequence[str],
    least_ratio: float = 1.0,
) -> None:
    """NIS over its degrees of freedom, sliding mean over pings, with the 95 % band of that mean.

    Args:
        axes: to draw on.
        innovations: `tables.replay.innovations_schema` of one what-if case.
        start_ns: start of the navigation.
        methods: which to draw.
        least_ratio: what Gaussian noise as claimed leads to under the weights of heavy tails.
    """
    table = nis_table(innovations, methods, least_ratio)
    lines: dict[str, Floats] = {}
    times: dict[str, Floats] = {}
    for (method,), rows in table.group_by("method", maintain_order=True):
        times[str(method)] = np.asarray((rows["time_ns"].to_numpy() - start_ns) * 1e-9, dtype=np.float64)
        lines[str(method)] = rows["nis_ratio"].to_numpy()
    with mpl.rc_context(STYLE):
        if not lines:
            axes.text(0.5, 0.5, "too few fixes", transform=axes.transAxes, ha="center", color=FAINT)
            return
        axes.axhspan(*table.select("band_lo", "band_hi").row(-1), color=FAINT, alpha=0.35, linewidth=0.0)
        axes.set_yscale("log")
        every = np.concatenate(list(lines.values()))
        axes.set_ylim(max(min(float(every.min()), 0.5) / 1.4, 1e-4), max(float(every.max()), 2.0) * 1.4)
        axes.set_xlim(min(t[0] for t in times.values()), max(t[-1] for t in times.values()))
        axes.yaxis.set_major_locator(LogLocator(numticks=8))
        axes.yaxis.set_major_formatter(FuncFormatter(plain_number))
        axes.yaxis.set_minor_formatter(NullFormatter())
        axes.set_title(
            f"NIS over its degrees, mean of {WINDOW} pings (band: consistent, 95 %)",
            loc="left",
            fontsize=9.5,
        )
        axes.set_xlabel("time from the start, s")
        drawn: list[Line] = []
        for method, line in lines.items():
            alike = next(
                (d for d in drawn if len(d.y) == len(line) and np.allclose(d.y, line, rtol=1e-2)), None
            )
            if alike is not None:
                drawn[drawn.index(alike)] = Line((*alike.methods, method), alike.x, alike.y)
                continue
            drawn.append(Line((method,), times[method], line))
        drawn = [_thinned(tuple(one.methods), one.x, one.y) for one in drawn]
        draw_lines(axes, drawn, width=1.2)
        label_ends(axes, drawn)
