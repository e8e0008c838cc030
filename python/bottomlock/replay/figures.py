"""What a replay shows of several methods: errors with their standard deviations, NIS; and innovations."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
import polars as pl
from matplotlib.figure import Figure
from scipy.stats import chi2

from bottomlock.figures.palette import FAINT, INK, STYLE, WIDTH_IN, draw_order, stroke
from bottomlock.figures.series import BEAM_COLOURS, Curve, Panel, scattered_rows, thinned_rows
from bottomlock.recordings.streams import Floats, Times
from bottomlock.statistics.replay import error_norms
from bottomlock.tables.replay import FORWARD

_QUANTITIES = (
    ("position", "m", "position, m"),
    ("velocity", "mps", "velocity, m/s"),
    ("attitude", "deg", "attitude, degrees"),
)
PARTS = 300
"""Parts of the time of each of which a curve shows its least and greatest value: about the pixels of a panel."""


@dataclass(frozen=True)
class Drawing:
    """A figure of the page.

    Attributes:
        name: of its files.
        caption: below it.
        figure: itself.
        what_if: case that it is of, None for all.
        folded: whether it has every method.
    """

    name: str
    caption: str
    figure: Figure
    what_if: str | None = None
    folded: bool = False


def error_panels(samples: pl.DataFrame, methods: Sequence[str], which: str = FORWARD) -> list[Panel]:
    """Errors against the reference, norms over axes; dotted the standard deviation of each filter.

    Args:
        samples: `tables.replay.REPLAY_SAMPLES` of one what-if case.
        methods: which to draw.
        which: pass.
    """
    rows = error_norms(samples).filter(pl.col("pass") == which)
    of = {method: rows.filter(pl.col("method") == method) for method in draw_order(list(methods))}
    panels = []
    for name, unit, title in _QUANTITIES:
        curves = []
        for method, one in of.items():
            error, sd = (
                one[column].fill_null(np.nan).to_numpy() for column in (f"{name}_{unit}", f"{name}_sd_{unit}")
            )
            if np.isfinite(error).any():
                look = (stroke(method).colour, one["time_ns"].to_numpy())
                curves += [Curve("", *look, sd, dash=(0.9, 1.5), width=0.9), Curve(method, *look, error)]
        if curves:
            panels.append(Panel(title, curves, log=True, compared=True))
    return panels


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
        figure.text(0.012, 0.992, title, ha="left", va="top", fontsize=10.0, color=INK)
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


def nis_panel(innovations: pl.DataFrame, methods: Sequence[str], least_ratio: float) -> Panel:
    """NIS over its degrees of freedom, sliding mean over pings, with the 95 % band of that mean.

    Args:
        innovations: `tables.replay.innovations_schema` of one what-if case.
        methods: which to draw.
        least_ratio: what Gaussian noise as claimed leads to under the weights of heavy tails.
    """
    curves, band = [], None
    for method in draw_order(list(methods)):
        rows = innovations.filter(
            (pl.col("method") == method) & pl.col("nis").is_not_null() & (pl.col("degrees") > 0)
        )
        mean = nis_ratios(rows)
        if mean is not None:
            band = nis_band(rows, least_ratio)
            curves.append(Curve(method, stroke(method).colour, *mean))
    title = f"NIS over its degrees, mean of {WINDOW} pings (band: consistent, 95 %)"
    return Panel(title, curves, decimals=3, log=True, band=band, compared=True)
