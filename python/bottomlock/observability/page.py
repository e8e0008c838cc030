"""Observability as a page: the figures, the ranks and what is unobservable, and what a manoeuvre leaves."""

from collections.abc import Sequence

import polars as pl

from bottomlock.kernel import kernel_version
from bottomlock.pages.numbers import number
from bottomlock.pages.page import Page, Part, Picture, Table, folded

_FIGURES = (
    "A state whose line falls is estimated; one whose line stays where it began is not seen by what aids."
)
_RANKS = (
    "Rank of the window: the number of independent combinations of the states that the measurements determine; and the "
    "directions that they leave free, SI units."
)
_COLUMNS = ["Aiding", "Case and motion", "Model", "Rank", "Unobservable"]


def page(table: pl.DataFrame, manoeuvres: pl.DataFrame | None, pictures: Sequence[Picture]) -> Page:
    """The page of `observe`.

    Args:
        table: `tables.observability.OBSERVABILITY`.
        manoeuvres: `tables.observability.MANOEUVRE_RANKING`, or None.
        pictures: of the deviations of a case, and of masks by manoeuvres.
    """
    rows = [
        [
            row["aiding"] or row["mask"],
            f"{row['case']}, {row['motion']}",
            row["model"],
            f"{'undecided' if row['rank'] is None else row['rank']} of {row['states']}",
            "; ".join(row["unobservable"] or []) or "nothing",
        ]
        for row in table.iter_rows(named=True)
    ]
    parts = [
        Part("figures", "Figures", [_FIGURES, *pictures]),
        Part("ranks", "Which states can be estimated", [_RANKS, Table(_COLUMNS, rows, left=len(_COLUMNS))]),
    ]
    if manoeuvres is not None:
        left = [
            [row["manoeuvre"], row["state"], row["verdict"], f"{number(100.0 * row['fraction_left'])} %"]
            for row in manoeuvres.iter_rows(named=True)
        ]
        words = (
            f"Standard deviation left by a manoeuvre of about a minute with {manoeuvres['aiding'][0]}, in percent of "
            "the initial one."
        )
        columns = ["Manoeuvre", "State", "Observable", "Left"]
        parts.append(
            Part("manoeuvres", "Which manoeuvre helps", [words, folded(Table(columns, left, left=3))])
        )
    return Page("Observability", [], parts, f"bottomlock {kernel_version()}")
