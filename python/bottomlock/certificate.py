"""The honesty certificate as a table and as a text for people."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import polars as pl

from bottomlock.bands import CAUTIOUS, CONSISTENT, OVERCONFIDENT, detectable_factor

CERTIFICATE: Mapping[str, pl.DataType] = {
    "trajectory": pl.String(),
    "beams": pl.String(),
    "arm": pl.String(),
    "quantity": pl.String(),
    "degrees": pl.Float64(),
    "runs": pl.Int64(),
    "values": pl.Int64(),
    "mean": pl.Float64(),
    "least": pl.Float64(),
    "greatest": pl.Float64(),
    "band_lo": pl.Float64(),
    "band_hi": pl.Float64(),
    "verdict": pl.String(),
}
"""A row per trajectory, mask, arm and quantity: expected value, number of runs, independent values behind each judged mean,
mean over runs and times, the least and the greatest of the judged means, their band, and the verdict."""

QUANTITIES = {
    "nees_velocity_attitude": "NEES of velocity and attitude",
    "nees": "NEES of the whole state",
    "nis": "NIS of the DVL fixes",
}
_MARKS = {CONSISTENT: "", OVERCONFIDENT: " ▲", CAUTIOUS: " ▽"}


def arms_summary(table: pl.DataFrame) -> pl.DataFrame:
    """A row per arm: cells (trajectory and mask), those where every quantity is consistent, and verdicts by quantity.

    Columns: arm, cells, certified, and for each quantity Q: Q_consistent, Q_overconfident, Q_cautious.
    """
    by_cell = table.group_by("arm", "trajectory", "beams", maintain_order=True).agg(
        (pl.col("verdict") == CONSISTENT).all().alias("certified")
    )
    summary = by_cell.group_by("arm", maintain_order=True).agg(
        pl.len().alias("cells"), pl.col("certified").sum()
    )
    for quantity in QUANTITIES:
        counts = (
            table.filter(pl.col("quantity") == quantity)
            .group_by("arm")
            .agg(
                *(
                    (pl.col("verdict") == verdict).sum().alias(f"{quantity}_{verdict.split()[-1]}")
                    for verdict in (CONSISTENT, OVERCONFIDENT, CAUTIOUS)
                )
            )
        )
        summary = summary.join(counts, on="arm", how="left", maintain_order="left")
    return summary


def decisive(row: Mapping[str, Any]) -> float:
    """The mean that decides a row's verdict: the greatest or the least outside its band, else the mean over the times."""
    name = {OVERCONFIDENT: "greatest", CAUTIOUS: "least"}.get(row["verdict"], "mean")
    return float(row[name])


def number(value: float | None) -> str:
    """Three digits or so, a dash for nothing.

    >>> number(6.0), number(258.4), number(5.29e6), number(None)
    ('6.0', '258', '5e6', '-')
    """
    if value is None:
        return "-"
    if abs(value) >= 1e4:
        return f"{value:.0e}".replace("e+0", "e").replace("e+", "e")
    return f"{value:.0f}" if abs(value) >= 100.0 else f"{value:.1f}"


def markdown(table: pl.DataFrame, facts: Mapping[str, Any]) -> str:
    """The certificate as Markdown: what was run, how it is judged, the verdicts, and what it does not say."""
    return "\n".join(
        [*_head(table, facts), *_arms(table), *_departures(table), *_matrices(table), *_limits(), ""]
    )


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _head(table: pl.DataFrame, facts: Mapping[str, Any]) -> Iterator[str]:
    tests, each = facts["tests"], facts["each_probability"]
    runs = int(table["runs"].to_numpy().min())
    factors = [
        f"{detectable_factor(degrees, runs, each):.2f} on {what}"
        for degrees, what in ((6, "velocity and attitude"), (facts["degrees"], "the whole state"))
    ]
    made = ", ".join(f"{name} {version}" for name, version in facts["versions"].items())
    yield from (
        "# Honesty certificate",
        "",
        "Does each method know how wrong it is? For every arm, set of returning beams and trajectory the errors of a Monte Carlo",
        "campaign are held against the covariance that the filter claims.",
        "",
        "## What was run",
        "",
        f"- Trajectories: {', '.join(facts['trajectories'])}; arms: {', '.join(facts['arms'])}; "
        f"{len(facts['beams'])} sets of beams that return from first to last. `ins` and `lc` do not look at which beams are",
        "  lost and stand once, with all of them.",
        f"- {runs} runs of each, seed {facts['seed']}; run k has the same sensor errors in every cell of a trajectory.",
        f"- Made with {made}; configuration `{facts['configuration_hash'][:16]}`.",
        f"- Again with: `{facts['command']}`",
        "",
        "## How it is judged",
        "",
        "- NEES, the error weighted with the inverse of the claimed covariance, has the mean 6 for velocity and attitude and the",
        f"  mean {facts['degrees']} for the whole state where the claim is right. It is correlated over a run, so it is judged at"
        " fixed times",
        f"  ({', '.join(f'{time_s:g}' for time_s in facts['times_s'])} s) only: there the mean over runs, which are independent, "
        "is chi-squared over the",
        "  number of runs.",
        "- NIS, the innovations weighted likewise, has as its mean the number of rows that are fused. Innovations of a right filter",
        "  are independent in time as well, so every fix of every run counts.",
        f"- {tests} values are judged. Each has a two-sided band of {100.0 * each:.5f} %, so that all of a table of honest arms lie",
        f"  within theirs with {100.0 * (1.0 - facts['false_alarm']):g} % or more, however they depend on one another (Bonferroni): "
        f"the false-alarm rate of the",
        f"  whole certificate is {100.0 * facts['false_alarm']:g} % at the most.",
        "- *Overconfident* is a value above its band at any of the times, *too cautious* one below and none above, *consistent* is",
        f"  neither. With {runs} runs a true variance of {' and '.join(factors)} times the claimed one",
        "  is found nine times in ten; what is smaller may pass.",
        "- An arm is **certified** in a cell where all three quantities are consistent.",
        "",
    )


def _arms(table: pl.DataFrame) -> Iterator[str]:
    yield from ("## Arms", "")
    yield "Cells by verdict: consistent / overconfident / too cautious."
    yield ""
    yield _row(["arm", "cells", "certified", "velocity and attitude", "whole state", "NIS"])
    yield _row(["---", "---:", "---:", "---:", "---:", "---:"])
    for row in arms_summary(table).iter_rows(named=True):
        counts = [
            " / ".join(
                str(row[f"{quantity}_{part}"] or 0) for part in ("consistent", "overconfident", "cautious")
            )
            for quantity in QUANTITIES
        ]
        yield _row([f"`{row['arm']}`", str(row["cells"]), str(row["certified"]), *counts])
    yield ""


def _departures(table: pl.DataFrame) -> Iterator[str]:
    """Where each arm is certified, in words."""
    yield from ("## Certified where", "")
    cells = table.group_by("arm", "trajectory", "beams", maintain_order=True).agg(
        (pl.col("verdict") == CONSISTENT).all().alias("good")
    )
    for (arm,), rows in cells.group_by("arm", maintain_order=True):
        parts = []
        for (trajectory,), group in rows.group_by("trajectory", maintain_order=True):
            good = group.filter("good")["beams"].to_list()
            what = (
                "everywhere"
                if len(good) == group.height
                else "nowhere"
                if not good
                else " ".join(beams.replace(",", "") for beams in good)
            )
            parts.append(f"{trajectory}: {what}")
        yield f"- `{arm}`: {'; '.join(parts)}."
    yield ""


def _matrices(table: pl.DataFrame) -> Iterator[str]:
    arms = table["arm"].unique(maintain_order=True).to_list()
    for quantity, words in QUANTITIES.items():
        yield from (f"## {words}", "")
        chosen = table.filter(pl.col("quantity") == quantity)
        if quantity == "nis":
            yield "Mean NIS over the number of fused rows: 1 where the claim is right."
        else:
            low, high = chosen["band_lo"][0], chosen["band_hi"][0]
            yield f"Expected {chosen['degrees'][0]:g}, band {low:.2f} to {high:.2f}."
        yield "▲ overconfident, ▽ too cautious (with the value that decides); without a mark consistent (mean over the times)."
        yield ""
        for (trajectory,), rows in chosen.group_by("trajectory", maintain_order=True):
            yield _row([str(trajectory), *arms])
            yield _row(["---", *("---:" for _ in arms)])
            for (beams,), group in rows.group_by("beams", maintain_order=True):
                found = {row["arm"]: row for row in group.iter_rows(named=True)}
                yield _row([str(beams), *(_cell(found.get(arm), quantity) for arm in arms)])
            yield ""


def _cell(row: Mapping[str, Any] | None, quantity: str) -> str:
    if row is None:
        return ""
    value = decisive(row)
    shown = f"{value / row['degrees']:.3f}" if quantity == "nis" and value < 100.0 else number(value)
    return shown + _MARKS[row["verdict"]]


def _limits() -> Iterator[str]:
    yield from (
        "## What it does not say",
        "",
        "- The simulated sensors have exactly the errors that the filter assumes. A real instrument with other errors, outliers,",
        "  latency or a wrong alignment is another matter.",
        "- Three trajectories of one vehicle, without current; masks that stay from first to last. Methods that assume that sway is",
        "  zero fare worse where there is a current.",
        "- *Consistent* means that these runs show no departure as large as the one stated above, not that there is none.",
        "- The NEES of the whole state holds position too. Where beams leave a direction unobserved the velocity drifts by metres per",
        "  second, the covariance is propagated along a wrong velocity, and position is claimed too well although velocity and",
        "  attitude are not: the filter is a linearised one. `ins` shows the same, and more of it.",
        "- The gate takes part: a method that locks its own fixes out flies on inertially, and its NIS counts the rejected fixes as",
        "  well.",
    )
