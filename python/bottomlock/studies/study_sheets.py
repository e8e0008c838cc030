"""The masks study and the sensor law as pages: the answer, figures, and the tables behind a summary."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import polars as pl
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bottomlock.figures.by_category import category_figure
from bottomlock.pages.featured import featured
from bottomlock.pages.numbers import plain
from bottomlock.pages.sheet import Part, Picture, sheet
from bottomlock.studies import masks_page, sensor_law_page
from bottomlock.studies.masks_opening import answer as masks_answer

RECOMMENDED = ("sway_current",)
"""Shown in the figures of a study that flew it."""


def masks_sheet(
    table: pl.DataFrame, summary: pl.DataFrame | None, run: Sequence[str], limits: Sequence[str]
) -> str:
    """The page of a masks study.

    Args:
        table: `tables.studies.MASKS`.
        summary: `tables.studies.RECOVERY_SUMMARY`; None without outages.
        run: what was run, a line each.
        limits: what follows from it for the reading.
    """
    few = table.filter(
        pl.Series(
            [masks_page.span(row) > masks_page.GREATEST_SPAN for row in table.iter_rows(named=True)],
            dtype=pl.Boolean,
        )
    )
    parts = [
        Part("answer", "Answer", [_plain_text(line) for line in masks_answer(table, summary)]),
        *(
            _masks_part(str(name), rows)
            for (name,), rows in table.group_by("trajectory", maintain_order=True)
        ),
    ]
    if not few.is_empty():
        parts.append(_few_runs_part(few, table.height))
    if summary is not None:
        parts += _recovery_parts(summary)
    parts += [Part("run", "What was run", run), Part("limits", "Limits", limits)]
    names = ", ".join(table["trajectory"].unique(maintain_order=True))
    about = [f"{names}; {table['runs'].to_numpy().max()} runs of each case"]
    return sheet("Masks and recovery", about, parts, made_with="bottomlock")


def sensor_law_sheet(table: pl.DataFrame, summary: pl.DataFrame, facts: Mapping[str, Any]) -> str:
    """The page of a sensor law study; the arguments are those of `sensor_law_page.markdown`."""
    sensors = summary["sensors"].unique(maintain_order=True).to_list()
    pictures = []
    for size, words in (("median", "Median"), ("greatest", "Greatest")):
        curves = _curves(summary, "sensors", sensors, f"velocity_{size}_mps")
        title = f"{words.lower()} velocity error at the end, m/s"
        figure = category_figure(curves, sensors, title, is_first_a_level=True)
        caption = f"{words} velocity error of all cells and runs by the further sensors; dotted: without any."
        pictures.append(Picture.of(figure, f"sensor_law_{size}", caption))
    rows = [
        [
            row["method"],
            row["sensors"],
            *(str(row[key]) for key in sensor_law_page.COUNTS),
            *(plain(row[f"velocity_{size}_mps"]) for size in ("median", "greatest")),
        ]
        for row in summary.iter_rows(named=True)
    ]
    parts = [
        Part("answer", "Answer", [_plain_text(line) for line in sensor_law_page.answer(summary)], pictures),
        Part(
            "summary",
            "Every method and set of sensors",
            caption="Worse: cells (mask, trajectory, current) whose median velocity error rises beyond chance above "
            "that of a smaller set of these sensors. Runaways: cells with a run whose velocity error does. Left band: "
            "cells whose NEES of velocity and attitude is overconfident and was not with a smaller set. Median and "
            "greatest velocity error at the end, m/s.",
            columns=[
                "Method",
                "Sensors",
                "Cells",
                "Worse",
                "Runaways",
                "Left band",
                "Overconfident",
                "Median",
                "Greatest",
            ],
            rows=rows,
            methods=True,
            folded=True,
        ),
        *_cell_parts(table, sensors),
        Part("judged", "How it is judged", [_plain_text(line) for line in sensor_law_page.judged(facts)]),
    ]
    made_with = _plain_text(str(facts["made_with"]))
    return sheet("What a further sensor changes", [], parts, made_with=made_with)


def _plain_text(markdown: str) -> str:
    """A line of Markdown without its marks."""
    return markdown.replace("**", "").replace("`", "").replace("*", "").removeprefix("- ")


def _curves(
    rows: pl.DataFrame, key: str, categories: Sequence[str], column: str
) -> dict[str, NDArray[np.float64]]:
    """The column by method, in the order of the categories; NaN where a method has none."""
    found = {}
    for (method,), part in rows.group_by("method", maintain_order=True):
        values = dict(zip(part[key], part[column], strict=True))
        found[str(method)] = np.array([values.get(one, np.nan) for one in categories], dtype=np.float64)
    return found


def _masks_part(trajectory: str, rows: pl.DataFrame) -> Part:
    """The figure of some methods, and every method in a table."""
    named = rows.with_columns(name=pl.struct("case", "beams").map_elements(_case, return_dtype=pl.String))
    cases = named["name"].unique(maintain_order=True).to_list()
    methods = named["method"].unique(maintain_order=True).to_list()
    cells = {(row["method"], row["name"]): row for row in named.iter_rows(named=True)}
    shown = featured(methods, RECOMMENDED)
    heading = trajectory.replace("_", " ").capitalize()
    caption = (
        f"{heading}: velocity error at the end by the beams that return, RMS over runs; bars: 95 % interval."
    )
    if len(shown) < len(methods):
        caption += f" In the table only: {', '.join(one for one in methods if one not in shown)}."
    return Part(
        f"masks_{trajectory}",
        heading,
        pictures=[Picture.of(masks_figure(named, cases, shown), f"masks_{trajectory}", caption)],
        caption=" ".join(_plain_text(line) for line in masks_page.legend(rows)),
        columns=["Method", *cases],
        rows=[
            [method, *(masks_page.cell(cells.get((method, case))).replace("<br>", " ") for case in cases)]
            for method in methods
        ],
        methods=True,
        folded=True,
    )


def masks_figure(rows: pl.DataFrame, cases: Sequence[str], methods: Sequence[str]) -> Figure:
    """Velocity error of methods in every case of a trajectory; `rows` is MASKS with the `name` of each case."""
    chosen = rows.filter(pl.col("method").is_in(list(methods)))
    middle, low, high = (
        _curves(chosen, "name", cases, f"velocity_rms_over_runs{end}_mps") for end in ("", "_lo", "_hi")
    )
    intervals = {method: (low[method], high[method]) for method in middle}
    return category_figure(middle, cases, "velocity error, m/s RMS", intervals=intervals)


def _case(row: Mapping[str, str]) -> str:
    return masks_page.case_name(row["case"], row["beams"]).replace(",", "")


def _few_runs_part(few: pl.DataFrame, total: int) -> Part:
    heads = ["Trajectory", "Beams", "Method", "RMS, m/s", "95 % interval", "Median, m/s", "Worst run's share"]
    rows = [
        [
            row["trajectory"],
            _case(row),
            row["method"],
            plain(row["velocity_rms_over_runs_mps"]),
            masks_page.interval(row),
            plain(row["velocity_median_mps"]),
            f"{100.0 * row['velocity_greatest_share']:.0f} %",
        ]
        for row in few.iter_rows(named=True)
    ]
    words = (
        f"{few.height} of {total} values rest on a few runs: another seed gives another value within the interval or "
        "beyond. Half of the runs stay below the median; the share is of the mean square."
    )
    return Part("few", "Values that a few runs decide", [words], columns=heads, rows=rows, folded=True)


def _recovery_parts(summary: pl.DataFrame) -> list[Part]:
    worst = masks_page.worst_of_pairs(summary)
    words = (
        "The worst of the pairs of beams: greatest step of the velocity estimate at the first five fixes, in units of "
        "the σ claimed before it; mean NIS at the first and the fifth fix, and its expectation, the number of rows; "
        "the fix from which the mean NIS stays in its band."
    )
    heads = [
        "Method",
        "Greatest step, σ",
        "Runs > 3 σ",
        "NIS, fix 1",
        "NIS, fix 5",
        "Rows",
        "In band from fix",
    ]
    heads += ["Rejected, %", "Pairs recovered"]
    parts: list[Part] = []
    for (trajectory,), rows in worst.group_by("trajectory", maintain_order=True):
        parts.append(
            Part(
                f"recovery_{trajectory}",
                f"When the beams come back: {str(trajectory).replace('_', ' ')}",
                [] if parts else [words],
                columns=heads,
                rows=[masks_page.recovery_cells(row) for row in rows.iter_rows(named=True)],
                methods=True,
            )
        )
    return parts


def _cell_parts(table: pl.DataFrame, sensors: Sequence[str]) -> list[Part]:
    parts = []
    for method in sensor_law_page.SHOWN:
        rows = []
        own = table.filter(pl.col("method") == method)
        for (trajectory, current, beams), group in own.group_by(
            "trajectory", "current_mps", "beams", maintain_order=True
        ):
            cells = {one["sensors"]: sensor_law_page.cell(one) for one in group.iter_rows(named=True)}
            where = f"{trajectory}, {sensor_law_page.water(float(str(current)))}, beams {beams}"
            rows.append([where, *(cells[name] for name in sensors)])
        if rows:
            parts.append(
                Part(
                    f"cells_{method}",
                    f"{method}: velocity RMS at the end, m/s",
                    caption="▲ overconfident in velocity and attitude, △ in the whole state alone; rises: worse than "
                    "without.",
                    columns=["Cell", *sensors],
                    rows=rows,
                    folded=True,
                )
            )
    return parts
