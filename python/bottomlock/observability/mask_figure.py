"""Figure of masks by manoeuvres: the number of observable states of each."""

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, to_rgba
from matplotlib.figure import Figure

from bottomlock.figures.palette import INK, STYLE
from bottomlock.tables.check import check
from bottomlock.tables.observability import OBSERVABILITY

_UNDECIDED = to_rgba("#d55e00", 0.3)
# Shades let the page through, so that numbers in its ink are legible in either of its colour schemes.
_LEAST, _MOST = to_rgba("#0072b2", 0.0), to_rgba("#0072b2", 0.6)
_SHADES = LinearSegmentedColormap.from_list("shades", [_LEAST, _MOST]).with_extremes(bad=_UNDECIDED)


def mask_figure(table: pl.DataFrame, *, title: str) -> Figure:
    """Ranks of every mask (rows) by every manoeuvre (columns), a panel for each Earth and set of further sensors.

    Args:
        table: `tables.observability.OBSERVABILITY` as `observability.tables.manoeuvre_table` makes it.
        title: text above the figure.

    Raises:
        DataError: for a table of other columns.
    """
    check(table, OBSERVABILITY, place="manoeuvres")
    others = pl.col("aiding").str.replace(r"^beams \d+", "beams")
    rows = table.with_columns(sensors=others)
    earths, sensors, masks, motions = (
        rows[name].unique(maintain_order=True).to_list() for name in ("case", "sensors", "mask", "motion")
    )
    height = 1.5 + len(earths) * (0.62 + 0.215 * len(masks))
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.4, height))
        grid = figure.add_gridspec(
            len(earths), len(sensors), left=0.075, right=0.99, top=1.0 - 0.85 / height, bottom=1.05 / height,
            wspace=0.06, hspace=0.62 / (0.215 * len(masks)),
        )  # fmt: skip
        for i, earth in enumerate(earths):
            for j, which in enumerate(sensors):
                axes = figure.add_subplot(grid[i, j])
                _panel(axes, rows.filter(case=earth, sensors=which), masks, motions)
                axes.set_title(f"{earth}, {which}", loc="left", fontsize=9.0, pad=4.0)
                axes.set_yticks(range(len(masks)), masks if j == 0 else [""] * len(masks))
                words = [motion.replace("_", " ") for motion in motions] if i == len(earths) - 1 else []
                axes.set_xticks(range(len(motions)), words or [""] * len(motions), rotation=40, ha="right")
        figure.text(0.02, 1.0 - 0.24 / height, title, fontsize=11.0, color=INK, va="center")
        below = "number of observable states; rows are the valid beams, ? is undecided"
        figure.text(0.02, 1.0 - 0.46 / height, below, fontsize=8.5, color=INK, va="center")
    return figure


def _panel(axes: Axes, rows: pl.DataFrame, masks: Sequence[str], motions: Sequence[str]) -> None:
    states = rows["states"][0]
    ranks = np.full((len(masks), len(motions)), np.nan)
    for row in rows.iter_rows(named=True):
        if row["rank"] is not None:
            ranks[masks.index(row["mask"]), motions.index(row["motion"])] = row["rank"]
    edges = [np.arange(count + 1) - 0.5 for count in (len(motions), len(masks))]
    axes.pcolormesh(*edges, np.ma.masked_invalid(ranks), cmap=_SHADES, vmin=0, vmax=states)
    axes.invert_yaxis()
    for (i, j), rank in np.ndenumerate(ranks):
        words = f"{rank:.0f}" if np.isfinite(rank) else "?"
        axes.text(j, i, words, ha="center", va="center", fontsize=8.0, color=INK)
    axes.tick_params(length=0, labelsize=8.0)
    axes.grid(visible=False)
    for edge in axes.spines.values():
        edge.set_visible(False)
