"""The masks study in Markdown: velocity under every mask, method by method, and the recovery when beams return."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import polars as pl

from bottomlock.pages.numbers import plain
from bottomlock.statistics import chi_squared

_MARKS = {chi_squared.CONSISTENT: "", chi_squared.OVERCONFIDENT: " ▲", chi_squared.CONSERVATIVE: " ▽"}


def markdown(table: pl.DataFrame, summary: pl.DataFrame | None) -> str:
    """The tables of a masks study, `tables.studies.MASKS` and `RECOVERY_SUMMARY` (None without outages)."""
    runs = "" if summary is None else f"{summary['runs'].to_numpy().max()} runs each; "
    lines = [
        "## Velocity under every mask",
        "",
        (
            "RMS over the runs at the end, m/s. ▲ overconfident, ▽ conservative in the NEES of velocity and "
            f"attitude, by the campaign's 95 % band; of {table.height} verdicts some fall outside by chance."
        ),
        "",
        *_masks(table),
    ]
    if summary is not None:
        lines += [
            "## When the beams come back",
            "",
            (
                f"The worst of the pairs, {runs}greatest step of the velocity estimate at the first five fixes, "
                "in units of the σ claimed before it; mean NIS at the first and the fifth fix, and its expectation, "
                "the number of rows; the fix from which the mean NIS stays in its band."
            ),
            "",
            *_recovery(summary),
        ]
    return "\n".join(lines).rstrip() + "\n"


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


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _masks(table: pl.DataFrame) -> Iterator[str]:
    methods = table["method"].unique(maintain_order=True).to_list()
    for (trajectory,), rows in table.group_by("trajectory", maintain_order=True):
        yield _row([str(trajectory), *(f"`{method}`" for method in methods)])
        yield _row(["---", *("---:" for _ in methods)])
        for (case, beams), group in rows.group_by("case", "beams", maintain_order=True):
            found = {row["method"]: row for row in group.iter_rows(named=True)}
            name = str(beams) if str(case).startswith("beams_") else str(case)
            yield _row([name, *(_cell(found.get(method)) for method in methods)])
        yield ""


def _cell(row: Mapping[str, Any] | None) -> str:
    return "" if row is None else plain(row["velocity_rms_over_runs_mps"]) + _MARKS[row["verdict"]]


def _recovery(summary: pl.DataFrame) -> Iterator[str]:
    for (trajectory,), rows in worst_of_pairs(summary).group_by("trajectory", maintain_order=True):
        heads = ["greatest step, σ", "runs > 3 σ", "NIS, fix 1", "NIS, fix 5", "rows", "in band from fix"]
        heads += ["rejected, %", "pairs recovered"]
        yield _row([str(trajectory), *heads])
        yield _row(["---", *("---:" for _ in heads)])
        for row in rows.iter_rows(named=True):
            back = row["back_at_epoch"]
            yield _row(
                [
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
            )
        yield ""
