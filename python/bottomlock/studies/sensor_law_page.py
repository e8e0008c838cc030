"""The page of a sensor law study: the answer, the summary, and every cell."""

from collections.abc import Iterator, Mapping
from typing import Any

import polars as pl

from bottomlock.pages.numbers import plain
from bottomlock.statistics.chi_squared import OVERCONFIDENT

COUNTS = ("cells", "worse", "runaways", "left_band", "overconfident")
"""Columns of the summary that count cells, in the order of the page."""

SHOWN = ("sway_current", "tc")
"""Methods whose cells stand on the page: one with assumptions, one without. The table of the study has all."""


def markdown(table: pl.DataFrame, summary: pl.DataFrame, facts: Mapping[str, Any]) -> str:
    """The page in Markdown.

    Args:
        table: `tables.studies.SENSOR_LAW`.
        summary: `sensor_law.summary` of it.
        facts: runs, seed, false_alarm, made_with and command.
    """
    parts = [
        ["# What a further sensor changes"],
        [f"{place}. {line}" for place, line in enumerate(answer(summary), start=1)],
        ["## Every method and set of sensors"],
        list(_summary_rows(summary)),
        [
            "*Worse*: cells (mask, trajectory, current) whose median velocity error rises beyond chance above that",
            "of a smaller set of these sensors.",
            "*Runaways*: cells with a run whose velocity error does.",
            "*Left band*: cells whose NEES of velocity and attitude is overconfident and was not with a smaller set.",
            "Median and greatest velocity error at the end, m/s.",
        ],
        *_cells(table),
        ["## How it is judged"],
        judged(facts),
    ]
    return "\n\n".join("\n".join(part) for part in parts) + "\n"


def judged(facts: Mapping[str, Any]) -> list[str]:
    """How cells are judged and what was run, as a list in Markdown."""
    return [
        f"- {facts['runs']} runs of each cell, seed {facts['seed']}.",
        "- Every set of sensors meets the same runs and is compared with every smaller set that it contains.",
        "- *Rises*: the lower end of the 99.9 % bootstrap interval of the difference of the medians is above zero.",
        "- *Runaway*: in a run, at one of five times, a component of the error grows by more than fewer sensors claim.",
        f"- NEES at five times; false-alarm rate {facts['false_alarm']:.0%} for all cells together.",
        "- ▲ overconfident in velocity and attitude, △ in the whole state alone.",
        f"- Made with {facts['made_with']}.",
        f"- Command: `{facts['command']}`",
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


def _summary_rows(summary: pl.DataFrame) -> Iterator[str]:
    yield "| Method | Sensors | Cells | Worse | Runaways | Left band | Overconfident | Median | Greatest |"
    yield "|---|---|---:|---:|---:|---:|---:|---:|---:|"
    for row in summary.iter_rows(named=True):
        counts = " | ".join(str(row[key]) for key in COUNTS)
        sizes = " | ".join(plain(row[f"velocity_{size}_mps"]) for size in ("median", "greatest"))
        yield f"| `{row['method']}` | {row['sensors']} | {counts} | {sizes} |"


def _cells(table: pl.DataFrame) -> Iterator[list[str]]:
    """A heading and a table for each method shown, trajectory and current: velocity RMS by mask and sensors, m/s."""
    sensors = table["sensors"].unique(maintain_order=True).to_list()
    for method in SHOWN:
        own = table.filter(pl.col("method") == method)
        if own.is_empty():
            continue
        yield [f"## `{method}`: velocity RMS at the end, m/s"]
        for (trajectory, current), group in own.group_by("trajectory", "current_mps", maintain_order=True):
            lines = [
                f"| {trajectory}, {water(float(str(current)))} | {' | '.join(sensors)} |",
                f"|---|{'---:|' * len(sensors)}",
            ]
            for (beams,), row in group.group_by("beams", maintain_order=True):
                cells = {one["sensors"]: cell(one) for one in row.iter_rows(named=True)}
                lines.append(f"| {beams} | {' | '.join(cells[name] for name in sensors)} |")
            yield lines


def water(current_mps: float) -> str:
    """The current in words."""
    return "still water" if current_mps == 0.0 else f"{current_mps:g} m/s across"


def cell(row: Mapping[str, Any]) -> str:
    """The velocity error with its marks."""
    if row["verdict_velocity_attitude"] == OVERCONFIDENT:
        mark = " ▲"
    elif row["verdict_whole_state"] == OVERCONFIDENT:
        mark = " △"
    else:
        mark = ""
    rises = (" rises" if row["median_rises_above"] else "") + (" runaway" if row["run_rises_above"] else "")
    return f"{plain(row['velocity_rms_over_runs_mps'])}{mark}{rises}"
