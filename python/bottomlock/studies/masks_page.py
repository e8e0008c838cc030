"""The page of a masks study: velocity under every mask, method by method, and the recovery when beams return.

An RMS over runs can rest on one of them, and a verdict on where the band ends. Both are marked: an interval stands
where its ends are far apart; a verdict that a narrower or a wider band would change has a question mark.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import polars as pl
from matplotlib.figure import Figure

from bottomlock.figures.by_category import category_figure
from bottomlock.pages.featured import featured
from bottomlock.pages.numbers import plain
from bottomlock.pages.page import Folded, Page, Part, Picture, Table, folded, listed
from bottomlock.statistics import chi_squared
from bottomlock.studies import study_folder
from bottomlock.studies.consistency_table import MARKS
from bottomlock.studies.curves import by_method
from bottomlock.studies.masks_answer import answer, worst_of_pairs

SHOWN_SPAN = 1.5
"""An interval whose ends differ by a greater factor is printed below its value."""
GREATEST_SPAN = 2.0
"""Beyond this factor a few runs decide the value, and it is listed with the median over runs."""
EDGE_PROBABILITIES = (0.90, 0.99)
"""Of the bands between which a verdict is at the edge; the verdict's own band is 95 %."""
DEGREES = 6
"""Of the NEES that the verdicts are about."""


RECOMMENDED = ("sway_current",)
"""Shown in the figures of a study that flew it."""


def page(
    table: pl.DataFrame, summary: pl.DataFrame | None, run: Sequence[str], limits: Sequence[str]
) -> Page:
    """The page of a masks study.

    Args:
        table: `tables.studies.MASKS`.
        summary: `tables.studies.RECOVERY_SUMMARY`; None without outages.
        run: what was run, a line each.
        limits: what follows from it for the reading.
    """
    names = ", ".join(table["trajectory"].unique(maintain_order=True))
    parts = [
        Part("run", "What was run", [listed(run), "Limits:", listed(limits)]),
        Part(
            "masks", "Velocity under every mask", [*_pictures(table), *legend(table), *_masks(table), *_few_runs(table)]
        ),
    ]  # fmt: skip
    if summary is not None:
        parts.append(Part("recovery", "When the beams come back", [*_recovery(summary)]))
    return Page(
        "Masks and recovery",
        answer(table, summary),
        parts,
        about=f"{names}; {table['runs'].to_numpy().max()} runs of each case",
        made_with=study_folder.made_with(),
    )


def verdict_at_edge(row: Mapping[str, Any]) -> tuple[str, bool]:
    """The verdict of a row of `tables.studies.MASKS`, and whether it is at the edge of the band.

    At the edge the band of 90 % and the band of 99 % give different verdicts; that of the former is returned.
    """
    mean = row["nees_velocity_attitude_mean_over_runs_and_time"]
    found = []
    for probability in EDGE_PROBABILITIES:
        low, high = chi_squared.mean_band(DEGREES, row["runs"], probability)
        found.append(chi_squared.verdict(low, mean, mean, high))
    at_edge = found[0] != found[1]
    return (found[0] if at_edge else row["verdict"]), at_edge


def span(row: Mapping[str, Any]) -> float:
    """Upper over lower end of the interval of the velocity RMS; 1 where both are zero."""
    low, high = (row[f"velocity_rms_over_runs_{end}_mps"] for end in ("lo", "hi"))
    if high == low:
        return 1.0
    return float(high / low) if low > 0.0 else math.inf


def _pictures(table: pl.DataFrame) -> Iterator[Picture]:
    """Some methods on each trajectory; the tables have all."""
    for (trajectory,), rows in table.group_by("trajectory", maintain_order=True):
        methods = rows["method"].unique(maintain_order=True).to_list()
        shown = featured(methods, RECOMMENDED)
        heading = str(trajectory).replace("_", " ").capitalize()
        caption = f"{heading}: velocity error at the end by the beams that return, RMS over runs; bars: 95 % interval."
        if len(shown) < len(methods):
            caption += f" In the table only: {', '.join(one for one in methods if one not in shown)}."
        yield Picture.of(masks_figure(rows, shown), f"masks_{trajectory}", caption)


def masks_figure(rows: pl.DataFrame, methods: Sequence[str]) -> Figure:
    """Velocity error of methods in every case of a trajectory, from its rows of MASKS."""
    named = rows.with_columns(
        name=pl.struct("case", "beams").map_elements(
            lambda row: case_name(row["case"], row["beams"]).replace(",", ""), return_dtype=pl.String
        )
    )
    cases = named["name"].unique(maintain_order=True).to_list()
    chosen = named.filter(pl.col("method").is_in(list(methods)))
    middle, low, high = (
        by_method(chosen, "name", cases, f"velocity_rms_over_runs{end}_mps") for end in ("", "_lo", "_hi")
    )
    intervals = {method: (low[method], high[method]) for method in middle}
    return category_figure(middle, cases, "velocity error, m/s RMS", intervals=intervals)


def _masks(table: pl.DataFrame) -> Iterator[Folded]:
    methods = table["method"].unique(maintain_order=True).to_list()
    for (trajectory,), rows in table.group_by("trajectory", maintain_order=True):
        shown = []
        for (case, beams), group in rows.group_by("case", "beams", maintain_order=True):
            found = {row["method"]: row for row in group.iter_rows(named=True)}
            shown.append([case_name(str(case), str(beams)), *(cell(found.get(method)) for method in methods)])
        yield folded(Table([str(trajectory), *(f"`{method}`" for method in methods)], shown))


def legend(table: pl.DataFrame) -> list[str]:
    """How the values and the marks of `cell` are read, in Markdown."""
    narrow, wide = (f"{100.0 * probability:g} %" for probability in EDGE_PROBABILITIES)
    runs = ", ".join(str(count) for count in table["runs"].unique().sort())
    return [
        (
            f"RMS over {runs} runs at the end, m/s. The 95 % interval (bootstrap over runs) stands below a value where "
            f"its ends differ by more than a factor of {SHOWN_SPAN:g}; **†** where they differ by more than "
            f"{GREATEST_SPAN:g}, because a few runs decide the value."
        ),
        (
            "▲ overconfident, ▽ conservative in the NEES of velocity and attitude, by the campaign's 95 % band; of "
            f"{table.height} verdicts some fall outside by chance. ▲? and ▽? are at the edge of the band: the band of "
            f"{narrow} gives this verdict, that of {wide} does not."
        ),
    ]


def cell(row: Mapping[str, Any] | None) -> str:
    """The velocity error with its marks, and below it the interval where that is wide; "" without a row."""
    if row is None:
        return ""
    verdict, at_edge = verdict_at_edge(row)
    few = " †" if span(row) > GREATEST_SPAN else ""
    value = plain(row["velocity_rms_over_runs_mps"]) + MARKS[verdict] + ("?" if at_edge else "") + few
    return f"{value}<br>{interval(row)}" if span(row) > SHOWN_SPAN else value


def interval(row: Mapping[str, Any]) -> str:
    """The 95 % interval of the velocity RMS, m/s."""
    low, high = (plain(row[f"velocity_rms_over_runs_{end}_mps"]) for end in ("lo", "hi"))
    return f"{low}–{high}"


def _few_runs(table: pl.DataFrame) -> Iterator[str | Folded]:
    """The values that a few runs decide: what the other runs do, and how much the worst one makes."""
    found = [row for row in table.iter_rows(named=True) if span(row) > GREATEST_SPAN]
    if not found:
        return
    yield (
        f"† {len(found)} of {table.height} values rest on a few runs. Another seed gives another value within the "
        "interval or beyond. Half of the runs stay below the median."
    )
    heads = ["RMS, m/s", "95 % interval", "median, m/s", "worst run's share of the mean square"]
    rows = [
        [
            row["trajectory"],
            case_name(row["case"], row["beams"]),
            f"`{row['method']}`",
            plain(row["velocity_rms_over_runs_mps"]),
            interval(row),
            plain(row["velocity_median_mps"]),
            f"{100.0 * row['velocity_greatest_share']:.0f} %",
        ]
        for row in found
    ]
    yield folded(Table(["trajectory", "beams", "method", *heads], rows, left=3))


def case_name(case: str, beams: str) -> str:
    """The beams that return, or the name of a case in which they vary."""
    return beams if case.startswith("beams_") else case


def _recovery(summary: pl.DataFrame) -> Iterator[str | Table]:
    yield (
        f"The worst of the pairs, {summary['runs'].to_numpy().max()} runs each; greatest step of the velocity estimate "
        "at the first five fixes, in units of the σ claimed before it; mean NIS at the first and the fifth fix, and "
        "its expectation, the number of rows; the fix from which the mean NIS stays in its band."
    )
    heads = ["greatest step, σ", "runs > 3 σ", "NIS, fix 1", "NIS, fix 5", "rows", "in band from fix"]
    heads += ["rejected, %", "pairs"]
    for (trajectory,), rows in worst_of_pairs(summary).group_by("trajectory", maintain_order=True):
        yield Table([str(trajectory), *heads], [_recovery_cells(row) for row in rows.iter_rows(named=True)])


def _recovery_cells(row: Mapping[str, Any]) -> list[str]:
    """The method, and its cells, of a row of `worst_of_pairs`."""
    back = row["back_at_epoch"]
    return [
        f"`{row['method']}`",
        f"{row['step_sigmas_max']:.2f}",
        str(row["jumps"]),
        plain(row["nis_1"]),
        plain(row["nis_5"]),
        str(row["degrees"]),
        "never" if back is None else str(back),
        f"{100.0 * row['rejected_fraction']:.1f}",
        f"{row['pairs_recovered']} of {row['pairs']}",
    ]
