"""Draw the figures of README and of the pages of the methods, from campaigns that this script runs.

    python -m tools.site_figures                  # docs/figures/*.svg, a minute of one core
    python -m tools.site_figures --runs 4 --out out/figures     # a trial

The same version of the kernel gives the same figures. Each method's figure shows its velocity error and the σ that it
claims, beside those of `tc` (the same two beams) and `lc` (all four), on three legs.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cyclopts
import matplotlib as mpl
import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import bottomlock
from bottomlock.figures.palette import FAINT, INK, STYLE, stroke, svg_text
from bottomlock.files.atomic_write import write_text

FOLDER = Path(__file__).resolve().parent.parent / "docs" / "figures"
LEGS = ("straight, still water", "straight, 0.3 m/s across", "figure of eight, still water")
SECONDS = 200.0
DARK = {INK: "#e6edf3", FAINT: "#7d8590"}
"""Ink of the dark scheme; the paper is that of the page in both."""
WORDS = {
    "nsv": "sway set to zero",
    "tc": "tight coupling",
    "sway_current": "sway_current",
    "lc": "all four beams",
}
"""Methods of the figure in the README."""
_STYLE: Any = STYLE | {
    "svg.fonttype": "none", "font.family": "sans-serif", "figure.facecolor": "none", "savefig.facecolor": "none",
}  # fmt: skip


def flown(runs: int) -> pl.DataFrame:
    """RMS over runs of the velocity error and of the claimed σ: leg, method, time_s, error_mps, claimed_mps."""
    straight = bottomlock.load_scenario("straight").with_trajectory(duration_s=SECONDS)
    eight = bottomlock.load_scenario("figure_eight").with_trajectory(duration_s=SECONDS)
    across = straight.replace({"mission.current": {"speed_mps": 0.3, "towards_deg": 90.0}})
    parts = []
    for leg, scenario in zip(LEGS, (straight, across, eight), strict=True):
        every = scenario.with_overrides(runs=runs, methods=list(bottomlock.METHODS))
        samples = bottomlock.run_campaign([every]).samples.group_by("method", "time_ns", maintain_order=True)
        norms = samples.agg(error_mps=_norm("err"), claimed_mps=_norm("sd"))
        parts.append(norms.with_columns(leg=pl.lit(leg), time_s=pl.col("time_ns") / 1e9))
    return pl.concat(parts).select("leg", "method", "time_s", "error_mps", "claimed_mps").collect()


def _norm(kind: str) -> pl.Expr:
    """RMS over rows of the norm of a velocity."""
    squares = [pl.col(f"{kind}_velocity_{axis}_mps") ** 2 for axis in ("surge", "sway", "heave")]
    return pl.sum_horizontal(squares).mean().sqrt()


def _curve(axes: Axes, table: pl.DataFrame, method: str, column: str, **style: Any) -> None:  # noqa: ANN401 - matplotlib's
    rows = table.filter(pl.col("method") == method)
    axes.plot(rows["time_s"], rows[column], **style)


def method_figure(table: pl.DataFrame, method: str) -> Figure:
    """Error and claimed σ of a method on the three legs; `tc` and `lc` in grey."""
    figure = Figure(figsize=(7.6, 2.9), layout="constrained")
    panels = figure.subplots(1, len(LEGS), sharey=True)
    for axes, leg in zip(panels, LEGS, strict=True):
        of_leg = table.filter(pl.col("leg") == leg)
        for other, dash in (("tc", "-"), ("lc", (0, (1, 1.4)))):
            if other != method:
                style: Any = {"color": FAINT, "linestyle": dash, "linewidth": 1.0, "label": other}
                _curve(axes, of_leg, other, "error_mps", **style)
        for column, word, width, dash in (
            ("error_mps", "error", 2.0, "-"),
            ("claimed_mps", "claimed σ", 1.4, "--"),
        ):
            style = {"linewidth": width, "linestyle": dash, "label": f"{method}, {word}"}
            _curve(axes, of_leg, method, column, color=stroke(method).colour, **style)
        axes.set(title=leg, xlabel="time, s", yscale="log", ylim=(0.02, 60.0), xlim=(0.0, SECONDS))
    panels[0].set_ylabel("velocity, RMS over runs, m/s")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    return figure


def first_figure(table: pl.DataFrame) -> Figure:
    """The figure of the README: two of four beams, in still water and across a current."""
    figure = Figure(figsize=(7.6, 3.2), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    for axes, leg in zip(panels, LEGS[:2], strict=True):
        of_leg = table.filter(pl.col("leg") == leg)
        for method in WORDS:
            dash = (0, (1, 1.4)) if method == "lc" else "-"
            colour = FAINT if method == "lc" else stroke(method).colour
            _curve(axes, of_leg, method, "error_mps", color=colour, linewidth=2.0, linestyle=dash)
        axes.set(title=leg, xlabel="time, s", yscale="log", ylim=(0.03, 30.0), xlim=(0.0, SECONDS))
        axes.set_yticks([0.1, 1.0, 10.0], ["0.1", "1", "10"])
    panels[0].set_ylabel("velocity error, m/s")
    _names(panels[1], table.filter(pl.col("leg") == LEGS[1]))
    return figure


def _names(axes: Axes, table: pl.DataFrame) -> None:
    """Names at the ends of the lines, parted where they would meet."""
    last = table.filter(pl.col("time_s") == pl.col("time_s").max())
    ends = {method: last.filter(pl.col("method") == method)["error_mps"].item() for method in WORDS}
    height = -np.inf
    for method in sorted(WORDS, key=lambda name: ends[name]):
        height = max(np.log10(ends[method]), height + 0.2)
        colour = FAINT if method == "lc" else stroke(method).colour
        place: Any = {"xycoords": ("axes fraction", "data"), "va": "center"}
        axes.annotate(WORDS[method], (1.02, 10.0**height), color=colour, fontsize=10, **place)


def svg(figure: Figure, *, dark: bool = False) -> str:
    """The figure as SVG without a background, for a light or a dark page."""
    text = svg_text(figure, _STYLE)
    for light, other in DARK.items() if dark else ():
        text = text.replace(light, other)
    return text


def main(*, runs: int = 40, out: Path = FOLDER) -> None:
    """Draw the figures of README and of the pages of the methods, from campaigns that this script runs."""
    table = flown(runs)
    out.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context(_STYLE):
        figures = {"two_beams": first_figure(table)}
        figures |= {f"method_{method}": method_figure(table, method) for method in bottomlock.METHODS}
        for name, figure in figures.items():
            write_text(out / f"{name}_light.svg", svg(figure))
            write_text(out / f"{name}_dark.svg", svg(figure, dark=True))
    last = table.filter(pl.col("time_s") == pl.col("time_s").max())
    with pl.Config(tbl_rows=-1):
        print(last.select("leg", "method", pl.col("error_mps", "claimed_mps").round(4)))


if __name__ == "__main__":
    cyclopts.run(main)
