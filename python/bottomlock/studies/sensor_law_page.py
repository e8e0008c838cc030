"""The page of a sensor law study: the answer, the summary, and every cell."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import polars as pl

from bottomlock.figures.by_category import category_figure
from bottomlock.pages.numbers import plain
from bottomlock.pages.page import Folded, Page, Part, Picture, Table, folded, listed
from bottomlock.statistics.chi_squared import OVERCONFIDENT
from bottomlock.studies.curves import by_method

COUNTS = ("cells", "worse", "runaways", "left_band", "overconfident")
"""Columns of the summary that count cells, in the order of the page."""

SHOWN = ("sway_current", "tc")
"""Methods whose cells stand on the page: one with assumptions, one without. The table of the study has all."""

_WORDS = (
    "*Worse*: cells (mask, trajectory, current) whose median velocity error rises beyond chance above that\n"
    "of a smaller set of these sensors.\n"
    "*Runaways*: cells with a run whose velocity error does.\n"
    "*Left band*: cells whose NEES of velocity and attitude is overconfident and was not with a smaller set.\n"
    "*Over*: cells where it is.\n"
    "Median and greatest velocity error at the end, m/s."
)


def page(table: pl.DataFrame, summary: pl.DataFrame, facts: Mapping[str, Any]) -> Page:
    """The page.

    Args:
        table: `tables.studies.SENSOR_LAW`.
        summary: `sensor_law.summary` of it.
        facts: runs, seed, false_alarm, made_with and command.
    """
    parts = [
        summary_part(summary, list(_pictures(summary))),
        *_cells(table),
        Part("judged", "How it is judged", [listed(_judged(facts))]),
    ]
    return Page("What a further sensor changes", list(answer(summary)), parts, made_with=facts["made_with"])


def _judged(facts: Mapping[str, Any]) -> list[str]:
    """How cells are judged and what was run."""
    return [
        f"{facts['runs']} runs of each cell, seed {facts['seed']}.",
        "Every set of sensors meets the same runs and is compared with every smaller set that it contains.",
        "*Rises*: the lower end of the 99.9 % bootstrap interval of the difference of the medians is above zero.",
        "*Runaway*: in a run, at one of five times, a component of the error grows by more than fewer sensors claim.",
        f"NEES at five times; false-alarm rate {facts['false_alarm']:.0%} for all cells together.",
        "▲ overconfident in velocity and attitude, △ in the whole state alone.",
        f"Made with {facts['made_with']}.",
        f"Command: `{facts['command']}`",
    ]


def answer(summary: pl.DataFrame) -> Iterator[str]:
    """The conclusions, a line of Markdown for each method."""
    sensors = summary.filter(pl.col("sensors") != "none")
    for method in summary["method"].unique(maintain_order=True):
        own = sensors.filter(pl.col("method") == method)
        cells, worse, tail, left = (
            int(own[key].sum()) for key in ("cells", "worse", "runaways", "left_band")
        )
        yield (
            f"**`{method}`**: of {cells} cells with a further sensor the median velocity error rises in {worse}, the "
            f"error of a run in {tail}, and {left} become overconfident in velocity and attitude; greatest error "
            f"{plain(own['velocity_greatest_mps'].max())} m/s."  # type: ignore[arg-type]
        )


def summary_part(summary: pl.DataFrame, pictures: Sequence[Picture] = ()) -> Part:
    """Every method and set of sensors."""
    return Part("summary", "Every method and set of sensors", [*pictures, _summary(summary), _WORDS])


def _pictures(summary: pl.DataFrame) -> Iterator[Picture]:
    sensors = summary["sensors"].unique(maintain_order=True).to_list()
    for size, words in (("median", "Median"), ("greatest", "Greatest")):
        curves = by_method(summary, "sensors", sensors, f"velocity_{size}_mps")
        title = f"{words.lower()} velocity error at the end, m/s"
        figure = category_figure(curves, sensors, title, is_first_a_level=True)
        caption = f"{words} velocity error of all cells and runs by the further sensors; dotted: without any."
        yield Picture.of(figure, f"sensor_law_{size}", caption)


def _summary(summary: pl.DataFrame) -> Folded:
    rows = [
        [
            f"`{row['method']}`",
            row["sensors"],
            *(str(row[key]) for key in COUNTS),
            *(plain(row[f"velocity_{size}_mps"]) for size in ("median", "greatest")),
        ]
        for row in summary.iter_rows(named=True)
    ]
    counts = ["Cells", "Worse", "Runaways", "Left band", "Over"]
    return folded(Table(["Method", "Sensors", *counts, "Median", "Greatest"], rows, left=2))


def _cells(table: pl.DataFrame) -> Iterator[Part]:
    """A part for each method shown: velocity RMS by mask and sensors, a table for each trajectory and current."""
    sensors = table["sensors"].unique(maintain_order=True).to_list()
    for method in SHOWN:
        own = table.filter(pl.col("method") == method)
        tables = []
        for (trajectory, current), group in own.group_by("trajectory", "current_mps", maintain_order=True):
            rows = []
            for (beams,), row in group.group_by("beams", maintain_order=True):
                cells = {one["sensors"]: _cell(one) for one in row.iter_rows(named=True)}
                rows.append([str(beams), *(cells[name] for name in sensors)])
            tables.append(folded(Table([f"{trajectory}, {_water(float(str(current)))}", *sensors], rows)))
        if tables:
            yield Part(f"cells_{method}", f"`{method}`: velocity RMS at the end, m/s", tables)


def _water(current_mps: float) -> str:
    """The current in words."""
    return "still water" if current_mps == 0.0 else f"{current_mps:g} m/s across"


def _cell(row: Mapping[str, Any]) -> str:
    """The velocity error with its marks."""
    if row["verdict_velocity_attitude"] == OVERCONFIDENT:
        mark = " ▲"
    elif row["verdict_whole_state"] == OVERCONFIDENT:
        mark = " △"
    else:
        mark = ""
    rises = (" rises" if row["median_rises_above"] else "") + (" runaway" if row["run_rises_above"] else "")
    return f"{plain(row['velocity_rms_over_runs_mps'])}{mark}{rises}"
