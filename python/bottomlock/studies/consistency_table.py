"""The consistency study as a table and as a page in Markdown."""

from collections.abc import Iterator, Mapping, Sequence
from importlib import resources
from typing import Any

import polars as pl
from jinja2 import Environment, StrictUndefined

from bottomlock.pages.numbers import plain
from bottomlock.statistics.chi_squared import CONSERVATIVE, CONSISTENT, OVERCONFIDENT, detectable_factor
from bottomlock.tables.studies import QUANTITIES

_SUFFIX = {CONSISTENT: "consistent", OVERCONFIDENT: "overconfident", CONSERVATIVE: "conservative"}
MARKS = {CONSISTENT: "", OVERCONFIDENT: " ▲", CONSERVATIVE: " ▽"}


def consistent_cells(table: pl.DataFrame) -> pl.DataFrame:
    """A row per method, trajectory and mask with `consistent`.

    It is where the NEES of velocity and attitude is consistent and no quantity is overconfident.
    """
    core = (pl.col("quantity") == "nees_velocity_attitude") & (pl.col("verdict") != CONSISTENT)
    return table.group_by("method", "trajectory", "beams", maintain_order=True).agg(
        (~(core.any() | (pl.col("verdict") == OVERCONFIDENT).any())).alias("consistent")
    )


def methods_summary(table: pl.DataFrame) -> pl.DataFrame:
    """A row per method: cells (trajectory and mask), those consistent, and the verdicts by quantity.

    Columns: method, cells, consistent, and for each quantity Q: Q_consistent, Q_overconfident, Q_conservative.
    """
    summary = (
        consistent_cells(table)
        .group_by("method", maintain_order=True)
        .agg(pl.len().alias("cells"), pl.col("consistent").sum())
    )
    counts = [
        ((pl.col("quantity") == quantity) & (pl.col("verdict") == verdict))
        .sum()
        .alias(f"{quantity}_{suffix}")
        for quantity in QUANTITIES
        for verdict, suffix in _SUFFIX.items()
    ]
    return summary.join(table.group_by("method").agg(counts), on="method", how="left", maintain_order="left")


def counts_of(row: Mapping[str, Any]) -> list[str]:
    """`consistent / overconfident / conservative` for each quantity, from a row of `methods_summary`."""
    return [
        " / ".join(str(row[f"{quantity}_{suffix}"]) for suffix in _SUFFIX.values()) for quantity in QUANTITIES
    ]


def decisive(row: Mapping[str, Any]) -> float:
    """The mean that decides a verdict: the greatest or least where it is outside, else the mean over the times."""
    name = {OVERCONFIDENT: "greatest", CONSERVATIVE: "least"}.get(row["verdict"], "mean")
    return float(row[name])


def markdown(table: pl.DataFrame, facts: Mapping[str, Any]) -> str:
    """The consistency study as Markdown: the answer, the verdicts, what was run, how it is judged, and the limits.

    `facts` are the names that the template uses besides the tables: trajectories, methods, beams, seed, versions,
    configuration_hash, command, degrees (of the whole state), times_s, tests, each_probability, false_alarm, and the
    sentences `settings` and `limits` of `world_words`.
    """
    runs, each = int(table["runs"].to_numpy().min()), facts["each_probability"]
    text = (resources.files("bottomlock.pages") / "templates" / "consistency.md.j2").read_text(
        encoding="utf-8"
    )
    # Markdown is not HTML: there is nothing to escape.
    environment = Environment(undefined=StrictUndefined, autoescape=False, keep_trailing_newline=True)  # noqa: S701
    return environment.from_string(text).render(
        **facts,
        runs=runs,
        factor_velocity_attitude=detectable_factor(6, runs, each),
        factor_whole=detectable_factor(facts["degrees"], runs, each),
        answer="\n".join(f"{place}. {line}" for place, line in enumerate(answer(table), start=1)),
        methods_table="\n".join(_methods(table)),
        consistent_list="\n".join(_consistent(table)),
        matrices="\n".join(_matrices(table)).rstrip(),
    )


def answer(table: pl.DataFrame) -> list[str]:
    """The conclusions of a study with their figures, one line each."""
    core = "nees_velocity_attitude"
    counts = list(methods_summary(table).iter_rows(named=True))
    ranked = sorted(counts, key=lambda row: -row["consistent"])
    never = [
        f"`{row['method']}`"
        for row in counts
        if not any(row[f"{quantity}_overconfident"] for quantity in QUANTITIES)
    ]
    # `ins` uses no beams: it has no innovations of a DVL and stays out of the masks.
    aided = table.filter(pl.col("quantity") == "nis")["method"].unique().to_list()
    cells = consistent_cells(table.filter(pl.col("method").is_in(aided)))
    masks = cells.group_by("beams", maintain_order=True).agg(pl.col("consistent").all())
    whole = masks.filter("consistent")["beams"].to_list()
    return [
        f"**Consistent cells:** {_listed(ranked, 'consistent')}.",
        f"**Never overconfident**, in any quantity: {', '.join(never) or 'no method'}.",
        f"**Overconfident in velocity and attitude**, cells: {_listed(counts, f'{core}_overconfident')}.",
        f"**Conservative in velocity and attitude**, cells: {_listed(counts, f'{core}_conservative')}.",
        f"**Every method that uses beams is consistent** with the beams {'; '.join(whole) or 'of no mask'}.",
    ]


def _listed(rows: Sequence[Mapping[str, Any]], count: str) -> str:
    """Methods with their counts, those without any left out: "`tc` 2 of 45, `vb` 30 of 45"."""
    found = [f"`{row['method']}` {row[count]} of {row['cells']}" for row in rows if row[count]]
    return ", ".join(found) or "none"


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _methods(table: pl.DataFrame) -> Iterator[str]:
    yield _row(["method", "cells", "consistent", "velocity and attitude", "whole state", "NIS"])
    yield _row(["---", "---:", "---:", "---:", "---:", "---:"])
    for row in methods_summary(table).iter_rows(named=True):
        yield _row([f"`{row['method']}`", str(row["cells"]), str(row["consistent"]), *counts_of(row)])


def _consistent(table: pl.DataFrame) -> Iterator[str]:
    for (method,), rows in consistent_cells(table).group_by("method", maintain_order=True):
        parts = []
        for (trajectory,), group in rows.group_by("trajectory", maintain_order=True):
            good = [beams.replace(",", "") for beams in group.filter("consistent")["beams"]]
            bad = [beams.replace(",", "") for beams in group.filter(~pl.col("consistent"))["beams"]]
            if not bad or not good:
                words = "nowhere" if bad else "everywhere"
            elif len(good) > len(bad):
                words = f"everywhere but {' '.join(bad)}"
            else:
                words = " ".join(good)
            parts.append(f"{trajectory}: {words}")
        yield f"- `{method}`: {'; '.join(parts)}."


def _matrices(table: pl.DataFrame) -> Iterator[str]:
    methods = table["method"].unique(maintain_order=True).to_list()
    for quantity, words in QUANTITIES.items():
        chosen = table.filter(pl.col("quantity") == quantity)
        if chosen.is_empty():
            continue
        yield from (f"## {words}", "")
        if quantity == "nis":
            yield "Mean NIS over the number of fused rows: 1 for a consistent filter."
        else:
            low, high = chosen["band_lo"][0], chosen["band_hi"][0]
            yield f"Expected {chosen['degrees'][0]:g}, band {low:.2f} to {high:.2f}."
        yield "▲ overconfident, ▽ conservative, with the value that decides; no mark: consistent, mean over the times."
        yield ""
        for (trajectory,), rows in chosen.group_by("trajectory", maintain_order=True):
            yield _row([str(trajectory), *methods])
            yield _row(["---", *("---:" for _ in methods)])
            for (beams,), group in rows.group_by("beams", maintain_order=True):
                found = {row["method"]: row for row in group.iter_rows(named=True)}
                yield _row([str(beams), *(matrix_cell(found.get(method), quantity) for method in methods)])
            yield ""


def matrix_cell(row: Mapping[str, Any] | None, quantity: str) -> str:
    """The value that decides, with the mark of its verdict; empty where there is no row."""
    if row is None:
        return ""
    value = decisive(row) / (row["degrees"] if quantity == "nis" else 1.0)
    shown = f"{value:.3f}" if quantity == "nis" and value < 10.0 else plain(value, decimals=1)
    return shown + MARKS[row["verdict"]]
