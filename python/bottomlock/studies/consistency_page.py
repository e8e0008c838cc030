"""The consistency study as a page: the answer, a row for each method, a matrix for each quantity and trajectory."""

from collections.abc import Mapping
from typing import Any

import polars as pl

from bottomlock.pages.sheet import Part, sheet
from bottomlock.studies.consistency_table import answer, counts_of, matrix_cell, methods_summary
from bottomlock.tables.studies import QUANTITIES


def page(table: pl.DataFrame, facts: Mapping[str, Any]) -> str:
    """The study as HTML; the arguments are those of `consistency_table.markdown`."""
    lines = [line.replace("**", "").replace("`", "") for line in answer(table)]
    rows = [
        [row["method"], str(row["cells"]), str(row["consistent"]), *counts_of(row)]
        for row in methods_summary(table).iter_rows(named=True)
    ]
    parts = [
        Part("answer", "Answer", lines),
        Part(
            "methods",
            "Methods",
            caption="Cells are trajectories by sets of returning beams; the right columns count consistent / "
            "overconfident / conservative.",
            columns=["Method", "Cells", "Consistent", "Velocity and attitude", "Whole state", "NIS"],
            rows=rows,
            methods=True,
        ),
        *(_matrix(table, quantity, words) for quantity, words in QUANTITIES.items()),
        Part("run", "What was run", [*facts["settings"], f"Command: {facts['command']}"]),
        Part("limits", "Limits", facts["limits"]),
    ]
    about = [f"{', '.join(facts['trajectories'])}; beams {'; '.join(facts['beams'])}; seed {facts['seed']}"]
    made_with = ", ".join(f"{name} {version}" for name, version in facts["versions"].items())
    return sheet("Consistency of the methods", about, parts, made_with=made_with)


def _matrix(table: pl.DataFrame, quantity: str, words: str) -> Part:
    """A row for each method, trajectory by trajectory; a column for each set of beams."""
    chosen = table.filter(pl.col("quantity") == quantity)
    beams = chosen["beams"].unique(maintain_order=True).to_list()
    rows = []
    for (method, trajectory), group in chosen.group_by("method", "trajectory", maintain_order=True):
        found = {row["beams"]: row for row in group.iter_rows(named=True)}
        rows.append([str(method), str(trajectory), *(matrix_cell(found.get(one), quantity) for one in beams)])
    return Part(
        quantity,
        words,
        caption="▲ overconfident, ▽ conservative, with the value that decides; no mark: consistent, mean over the "
        "times.",
        columns=["Method", "Trajectory", *(one.replace(",", "") for one in beams)],
        rows=rows,
        methods=True,
        folded=True,
    )
