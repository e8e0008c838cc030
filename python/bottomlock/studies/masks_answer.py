"""What a masks study answers, with its figures, and what was run."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import polars as pl
from scipy.stats import binom

from bottomlock.config.scenario import Scenario
from bottomlock.pages.numbers import plain
from bottomlock.statistics.campaign import BAND_PROBABILITY
from bottomlock.statistics.chi_squared import OVERCONFIDENT
from bottomlock.studies import study_folder, world_words
from bottomlock.studies.consistency import BLIND

ABOVE_BAND = 0.5 * (1.0 - BAND_PROBABILITY)
"""Probability that a consistent method is above the band of a row."""

FALSE_ALARM = 0.01
"""Probability that a consistent method has more such rows than are allowed it."""


def what_was_run(scenarios: Sequence[Scenario], command: str) -> list[str]:
    """Trajectories, settings, runs and command, a line each."""
    runs, seeds = (study_folder.campaign_values(scenarios, key) for key in ("runs", "seed"))
    return [
        f"Trajectories: {', '.join(one.name for one in scenarios)}.",
        *world_words.settings(scenarios),
        f"{runs} runs of each case, seed {seeds}.",
        f"Made with {study_folder.made_with()}.",
        f"Command: `{command}`",
    ]


def answer(table: pl.DataFrame, summary: pl.DataFrame | None) -> list[str]:
    """The conclusions of a masks study with their figures, one line each; `summary` is None without outages."""
    beams = table.with_columns(
        pl.when(pl.col("case").str.starts_with("beams_"))
        .then(pl.col("beams").str.split(",").list.len())
        .otherwise(None)
        .alias("returning")
    )
    # A method that does not depend on the mask says nothing of few beams.
    partial = beams.filter(~pl.col("method").is_in(BLIND))
    groups = {
        "Three beams or more": beams.filter(pl.col("returning") >= 3),
        "Two beams": partial.filter(pl.col("returning") == 2),
        "One beam": partial.filter(pl.col("returning") == 1),
    }
    lines = [
        f"**{words}**, velocity RMS at the end in m/s, of the methods overconfident in no more rows than chance "
        f"allows: {_ranges(rows)}."
        for words, rows in groups.items()
    ]
    counts = table.group_by("method", maintain_order=True).agg(
        pl.len().alias("rows"), (pl.col("verdict") == OVERCONFIDENT).sum().alias("overconfident")
    )
    over = [
        f"`{row['method']}` {row['overconfident']} of {row['rows']}"
        for row in counts.iter_rows(named=True)
        if row["overconfident"]
    ]
    lines.append(
        f"**Overconfident in velocity and attitude**, rows of the table: {', '.join(over) or 'none'}."
    )
    lines.append(f"**When lost beams return** after a minute of two: {_recovered(summary)}.")
    return lines


def worst_of_pairs(summary: pl.DataFrame) -> pl.DataFrame:
    """A row per trajectory and method: of all pairs the worst of each column of `tables.studies.RECOVERY_SUMMARY`."""
    return summary.group_by("trajectory", "method", maintain_order=True).agg(
        pl.col("step_sigmas_max", "nis_1", "nis_5", "rejected_fraction").max(),
        pl.col("jumps").sum(),
        pl.col("degrees").first(),
        # Null stands for "never".
        pl.when(pl.col("back_at_epoch").is_not_null().all())
        .then(pl.col("back_at_epoch").max())
        .alias("back_at_epoch"),
        pl.col("recovered").sum().alias("pairs_recovered"),
        pl.len().alias("pairs"),
    )


def _ranges(rows: pl.DataFrame) -> str:
    """Least and greatest velocity error of each method that is not overconfident; methods of one range together."""
    by_range: dict[str, list[str]] = {}
    for (method,), group in rows.group_by("method", maintain_order=True):
        overconfident = group["verdict"].to_list().count(OVERCONFIDENT)
        if overconfident > binom.ppf(1.0 - FALSE_ALARM, group.height, ABOVE_BAND):
            continue
        errors = group["velocity_rms_over_runs_mps"].to_numpy()
        least, greatest = plain(float(errors.min())), plain(float(errors.max()))
        by_range.setdefault(least if least == greatest else f"{least}–{greatest}", []).append(f"`{method}`")
    if rows.is_empty():
        return "not run"
    return "; ".join(f"{', '.join(methods)} {text}" for text, methods in by_range.items()) or "no method"


def _recovered(summary: pl.DataFrame | None) -> str:
    if summary is None:
        return "not run"
    return "; ".join(_verdicts(worst_of_pairs(summary).iter_rows(named=True)))


def _verdicts(rows: Iterator[Mapping[str, Any]]) -> Iterator[str]:
    """Methods that recover for every pair on every trajectory, then the others with their count."""
    counts: dict[str, list[int]] = {}
    for row in rows:
        found = counts.setdefault(row["method"], [0, 0])
        found[0] += row["pairs_recovered"]
        found[1] += row["pairs"]
    good = [f"`{method}`" for method, (recovered, pairs) in counts.items() if recovered == pairs]
    yield f"{', '.join(good) or 'no method'} recover for every pair"
    for method, (recovered, pairs) in counts.items():
        if recovered != pairs:
            yield f"`{method}` for {recovered} of {pairs}"
