"""What a replay shows of several methods: errors with their standard deviations, and NIS."""

from collections.abc import Sequence

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.stats import chi2

from bottomlock.figures.palette import draw_order, stroke
from bottomlock.figures.series import Curve, Panel
from bottomlock.statistics.replay import error_norms
from bottomlock.tables.replay import FORWARD

Floats = NDArray[np.float64]
Times = NDArray[np.int64]
_QUANTITIES = (
    ("position", "m", "position, m"),
    ("velocity", "mps", "velocity, m/s"),
    ("attitude", "deg", "attitude, degrees"),
)


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
