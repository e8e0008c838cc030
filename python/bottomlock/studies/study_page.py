"""The page of a study: what each method does under every set of beams, with its verdict, a table a trajectory."""

from collections.abc import Iterator, Sequence

import polars as pl

from bottomlock.figures.campaign import WIDE, places_of
from bottomlock.figures.series import Figure
from bottomlock.kernel import RECOMMENDED_METHOD
from bottomlock.pages.page import Block, Page, Part, Picture, Pictures, Table, folded, listed
from bottomlock.pages.pieces import featured, title_of
from bottomlock.statistics.chi_squared import (
    CONSERVATIVE,
    CONSISTENT,
    FALSE_ALARM,
    OVERCONFIDENT,
    detectable_factor,
    each_probability,
    judged_samples,
)
from bottomlock.studies.study import AS_CONFIGURED
from bottomlock.text import plain

MARKS = {CONSISTENT: "", OVERCONFIDENT: " ▲", CONSERVATIVE: " ▽"}

_JUDGED = """\
A method is **overconfident** (▲) in a cell where the mean NEES over the runs is above its chi-squared band at any of
{times} times, in velocity and attitude or in the whole state; **conservative** (▽) where that of velocity and attitude
is below it. All {tests} means are one family: methods that are all consistent have another verdict anywhere in
{alarm:g} % of studies (Bonferroni). With {runs} runs a true variance of {factor:.2f} times the claimed one, in velocity
and attitude, is found nine times in ten."""


def summary(table: pl.DataFrame) -> pl.DataFrame:
    """A row a method of `files.columns.STUDY`: its cells by verdict, least and greatest velocity error, m/s."""
    verdict, velocity = pl.col("verdict"), pl.col("velocity_rms_over_runs_mps")
    return table.group_by("method", maintain_order=True).agg(
        pl.len().alias("cells"),
        (verdict == CONSISTENT).sum().alias("consistent"),
        (verdict == OVERCONFIDENT).sum().alias("overconfident"),
        (verdict == CONSERVATIVE).sum().alias("conservative"),
        velocity.min().alias("velocity_least_mps"),
        velocity.max().alias("velocity_most_mps"),
    )


def summary_table(table: pl.DataFrame) -> Table:
    """`summary` for a reader."""
    rows = [
        [f"`{method}`", *map(str, counts), plain(least), plain(most)]
        for method, *counts, least, most in summary(table).rows()
    ]
    columns = [
        "method",
        "cells",
        "consistent",
        "overconfident",
        "conservative",
        "least, m/s",
        "greatest, m/s",
    ]
    return Table(columns, rows)


def page(table: pl.DataFrame, run: Sequence[str], made_with: str, pictures: Pictures) -> Page:
    """The page of a study.

    Args:
        table: `files.columns.STUDY`.
        run: what was run, a line each.
        made_with: names and versions.
        pictures: to which its figures are added.
    """
    names = table["trajectory"].unique(maintain_order=True)
    return Page(
        "Methods by the beams that return",
        [
            Part("methods", "Methods", [summary_table(table), _judged(table)]),
            Part(
                "velocity",
                "Velocity error at the end, m/s RMS",
                [*_pictures(table, pictures), *_tables(table)],
            ),
            Part("run", "What was run", [listed(run)]),
        ],
        made_with,
        headline=[_headline(table)],
        about=f"{', '.join(names)}; {table['runs'].to_numpy().max()} runs".replace("_", " "),
    )


def _headline(table: pl.DataFrame) -> str:
    """The method of least worst error among those that are overconfident in no cell and were flown in every one."""
    rows = summary(table)
    rows = rows.filter(cells=rows["cells"].max(), overconfident=0).sort("velocity_most_mps")
    if rows.is_empty():
        return "Every method that was flown with every set of beams is overconfident in some of them."
    method, most = rows["method"][0], rows["velocity_most_mps"][0]
    return f"`{method}` is overconfident in no cell; its velocity error is {plain(most)} m/s at most."


def _judged(table: pl.DataFrame) -> str:
    runs, times = int(table["runs"].to_numpy().min()), len(judged_samples(10**6))
    tests = times * sum(int(table[name].is_not_null().sum()) for name in ("nees_velocity_attitude", "nees"))
    factor = detectable_factor(6, runs, each_probability(FALSE_ALARM, max(tests, 1)))
    return _JUDGED.format(times=times, tests=tests, alarm=100 * FALSE_ALARM, runs=runs, factor=factor)


def _place(table: pl.DataFrame) -> pl.DataFrame:
    """The table with `place`: the beams, and the sensors where the study varies them."""
    beams = pl.col("beams").str.replace_all(",", "")
    varied = table["sensors"].n_unique() > 1
    return table.with_columns(place=pl.concat_str(beams, "sensors", separator=" ") if varied else beams)


def _tables(table: pl.DataFrame) -> Iterator[Block]:
    methods = table["method"].unique(maintain_order=True).to_list()
    for (trajectory,), rows in _place(table).group_by("trajectory", maintain_order=True):
        shown = []
        for (place,), group in rows.group_by("place", maintain_order=True):
            cells = {
                row["method"]: plain(row["velocity_rms_over_runs_mps"]) + MARKS.get(row["verdict"], "")
                for row in group.iter_rows(named=True)
            }
            shown.append([str(place), *(cells.get(method, "") for method in methods)])
        yield folded(Table([str(trajectory), *(f"`{method}`" for method in methods)], shown))


def _pictures(table: pl.DataFrame, pictures: Pictures) -> Iterator[Picture]:
    """Some methods on each trajectory; the tables have all."""
    for (trajectory,), rows in _place(table).group_by("trajectory", maintain_order=True):
        error = "velocity error at the end by what returns, RMS over runs; bars: 95 % interval"
        caption = f"{title_of(str(trajectory))}: {error}."
        yield pictures.add(figure(rows), f"study_{trajectory}", caption, kind="")


def figure(rows: pl.DataFrame) -> Figure:
    """Velocity error of some methods in every place of a trajectory, with 95 % intervals."""
    methods = featured(rows["method"].unique(maintain_order=True).to_list(), [RECOMMENDED_METHOD])
    named = rows.with_columns(pl.col("place").replace(AS_CONFIGURED, "configured"))
    title = f"{rows['trajectory'][0]}: velocity error, m/s RMS".replace("_", " ")
    return Figure("", [places_of(named, methods, title)], size_in=WIDE)
