"""The page of a consistency study: the answer, the verdicts, what was run, how it is judged, and the limits."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import polars as pl

from bottomlock.pages.numbers import plain
from bottomlock.pages.page import Page, Part, Table, folded, listed
from bottomlock.statistics.chi_squared import detectable_factor
from bottomlock.studies.consistency_table import MARKS, consistent_cells, counts_of, decisive, methods_summary
from bottomlock.tables.studies import QUANTITIES

_INTRO = """\
A method is consistent where its errors agree with the covariance that it claims. The study tests this for every
method, set of returning beams and trajectory, with the errors of a Monte Carlo campaign."""

_COUNTED = """\
The three right columns count the cells whose quantity is consistent / overconfident / conservative. A cell counts as
consistent where velocity and attitude are consistent and no quantity is overconfident."""

_JUDGED = """\
- **NEES** is the squared estimation error in units of the claimed covariance. For a consistent filter its mean is 6
  for velocity and attitude and {degrees} for the whole state. Within a run NEES is strongly correlated in time, so it
  is judged at fixed times only ({times} s). Runs are independent: the sum over runs is chi-squared with the number of
  runs times 6 or {degrees} degrees of freedom.
- **NIS** is the squared innovation in units of its claimed covariance. For a consistent filter its mean is the number
  of rows. Innovations of a consistent filter are independent in time as well, so every fix of every run counts.
- {tests} means are judged, each against a two-sided band of {each:.5f} %. By Bonferroni's inequality a matrix of
  consistent methods lies within all of them with {held:g} % or more, however the cells depend on one another: **the
  false-alarm rate of the whole study is at most {alarm:g} %**.
- *Overconfident*: above the band at any of the times. *Conservative*: below it at some time and above it at none.
  *Consistent*: neither.
- Power: with {runs} runs, a true variance of {core:.2f} times the claimed one (velocity and attitude) or {whole:.2f}
  times (whole state) is detected nine times in ten. A smaller departure may pass.
- A method is **consistent** in a cell where the NEES of velocity and attitude is consistent and no quantity is
  overconfident. A conservative NIS or whole state does not count against it: an assumption with a deliberately large
  variance has that effect."""

_LIMITS = """\
- The trajectories are those of one vehicle, and each mask holds from first to last.
- *Consistent* means that these runs show no departure as large as the one stated above, not that there is none.
- The NEES of the whole state is taken in [linear coordinates](linear_range.md). Where the beams leave a direction
  unobserved for minutes, products of errors are no longer small and the filter, which is linearised, can be
  overconfident all the same.
- With three or four beams the loose methods are all least squares and have the same numbers."""


_BLIND = "`ins` and `lc` do not depend on which beams are lost; they are run once, with all beams."
_PAIRED = "Run k has the same sensor errors in every cell of a trajectory."
_LEGEND = (
    "▲ overconfident, ▽ conservative, with the value that decides; no mark: consistent, mean over the times."
)


def page(table: pl.DataFrame, facts: Mapping[str, Any]) -> Page:
    """The page of a study.

    `facts` are the names that the texts use besides the tables: trajectories, methods, beams, seed, versions,
    configuration_hash, command, degrees (of the whole state), times_s, tests, each_probability, false_alarm, and the
    sentences `settings` and `limits` of `world_words`.
    """
    made_with = ", ".join(f"{name} {version}" for name, version in facts["versions"].items())
    parts = [
        methods_part(table),
        Part("where", "Where each method is consistent", [listed(list(_consistent(table)))]),
        *_matrices(table),
        Part("run", "What was run", [listed(_run(table, facts, made_with))]),
        Part("judged", "How it is judged", [_judged(table, facts)]),
        Part("limits", "Limits", ["\n".join([*(f"- {line}" for line in facts["limits"]), _LIMITS])]),
    ]
    about = f"{', '.join(facts['trajectories'])}; beams {'; '.join(facts['beams'])}; seed {facts['seed']}"
    return Page("Consistency of the methods", answer(table), parts, made_with, intro=[_INTRO], about=about)


def _run(table: pl.DataFrame, facts: Mapping[str, Any], made_with: str) -> list[str]:
    runs = int(table["runs"].to_numpy().min())
    return [
        f"Trajectories: {', '.join(facts['trajectories'])}.",
        f"Methods: {', '.join(facts['methods'])}. {_BLIND}",
        f"Beams that return, from first to last: {'; '.join(facts['beams'])}.",
        *facts["settings"],
        f"{runs} runs of each cell, seed {facts['seed']}. {_PAIRED}",
        f"Made with {made_with}; configuration `{facts['configuration_hash'][:16]}`.",
        f"Command: `{facts['command']}`",
    ]


def _judged(table: pl.DataFrame, facts: Mapping[str, Any]) -> str:
    runs, each = int(table["runs"].to_numpy().min()), facts["each_probability"]
    return _JUDGED.format(
        degrees=facts["degrees"],
        times=", ".join(facts["times_s"]),
        tests=facts["tests"],
        each=100 * each,
        held=100 * (1 - facts["false_alarm"]),
        alarm=100 * facts["false_alarm"],
        runs=runs,
        core=detectable_factor(6, runs, each),
        whole=detectable_factor(facts["degrees"], runs, each),
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


def methods_part(table: pl.DataFrame) -> Part:
    """Cells and verdicts of each method."""
    rows = [
        [f"`{row['method']}`", str(row["cells"]), str(row["consistent"]), *counts_of(row)]
        for row in methods_summary(table).iter_rows(named=True)
    ]
    columns = ["method", "cells", "consistent", "velocity and attitude", "whole state", "NIS"]
    return Part("methods", "Methods", [_COUNTED, Table(columns, rows)])


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
        yield f"`{method}`: {'; '.join(parts)}."


def _matrices(table: pl.DataFrame) -> Iterator[Part]:
    """A part for each quantity, in it a table for each trajectory."""
    methods = table["method"].unique(maintain_order=True).to_list()
    for quantity, words in QUANTITIES.items():
        chosen = table.filter(pl.col("quantity") == quantity)
        if chosen.is_empty():
            continue
        if quantity == "nis":
            expected = "Mean NIS over the number of fused rows: 1 for a consistent filter."
        else:
            low, high = chosen["band_lo"][0], chosen["band_hi"][0]
            expected = f"Expected {chosen['degrees'][0]:g}, band {low:.2f} to {high:.2f}."
        tables = []
        for (trajectory,), rows in chosen.group_by("trajectory", maintain_order=True):
            shown = []
            for (beams,), group in rows.group_by("beams", maintain_order=True):
                found = {row["method"]: row for row in group.iter_rows(named=True)}
                shown.append([str(beams), *(_matrix_cell(found.get(method), quantity) for method in methods)])
            tables.append(folded(Table([str(trajectory), *methods], shown)))
        yield Part(quantity, words, [f"{expected}\n{_LEGEND}", *tables])


def _matrix_cell(row: Mapping[str, Any] | None, quantity: str) -> str:
    """The value that decides, with the mark of its verdict; empty where there is no row."""
    if row is None:
        return ""
    value = decisive(row) / (row["degrees"] if quantity == "nis" else 1.0)
    shown = f"{value:.3f}" if quantity == "nis" and value < 10.0 else plain(value, decimals=1)
    return shown + MARKS[row["verdict"]]
