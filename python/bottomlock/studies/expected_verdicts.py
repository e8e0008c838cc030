"""Expected verdicts of a consistency study: a TOML file, and the cells that depart from it."""

from collections.abc import Collection
from pathlib import Path
from typing import Literal

import polars as pl
from pydantic import ValidationError

from bottomlock.config.scenario_sections import Section
from bottomlock.config.toml_file import parse_toml, read_text
from bottomlock.config.validation import explain
from bottomlock.errors import DataError, ScenarioError
from bottomlock.statistics.chi_squared import OVERCONFIDENT


class Expectation(Section):
    """Expected verdict of all cells of some methods, trajectories and masks; an empty list means all.

    "not overconfident" allows both of the other verdicts.
    """

    methods: tuple[str, ...]
    trajectories: tuple[str, ...] = ()
    beams: tuple[str, ...] = ()
    quantity: Literal["nees_velocity_attitude", "nees", "nis"] = "nees_velocity_attitude"
    verdict: Literal["consistent", "overconfident", "conservative", "not overconfident"]


class Expectations(Section):
    """A file of expectations."""

    expect: tuple[Expectation, ...]


def read_expectations(path: str | Path) -> tuple[Expectation, ...]:
    """The expectations in a TOML file.

    Raises:
        DataError: for a file that is not there, ill-formed TOML, unknown keys or verdicts, and an empty list.
    """
    path = Path(path)
    if not path.is_file():
        raise DataError(f"{path}: no such file of expected verdicts")
    try:
        content = parse_toml(read_text(path), place=str(path))
    except ScenarioError as error:
        raise DataError(str(error)) from error
    try:
        read = Expectations.model_validate(content)
    except ValidationError as error:
        raise DataError(explain(error, str(path), Expectations)) from error
    if not read.expect:
        raise DataError(f"{path}: expects nothing, expected one [[expect]] or more")
    return read.expect


def check_names(
    expectations: tuple[Expectation, ...],
    *,
    methods: Collection[str],
    trajectories: Collection[str],
    beams: Collection[str],
) -> None:
    """Rejects an expectation for a cell that is not in a consistency study; it would always pass.

    Raises:
        DataError: naming the method, trajectory or mask.
    """
    for wanted in expectations:
        for column, names, known in (
            ("method", wanted.methods, methods),
            ("trajectory", wanted.trajectories, trajectories),
            ("beams", wanted.beams, beams),
        ):
            for name in names:
                if name not in known:
                    raise DataError(f"expected verdicts: {column} '{name}' is not in the consistency study")


def departures(table: pl.DataFrame, expectations: tuple[Expectation, ...]) -> list[str]:
    """The cells whose verdict is another than expected, a line each.

    Raises:
        DataError: as `check_names`, and for a combination that the table does not hold.
    """
    check_names(
        expectations,
        methods=set(table["method"]),
        trajectories=set(table["trajectory"]),
        beams=set(table["beams"]),
    )
    found = []
    for wanted in expectations:
        rows = table.filter(pl.col("quantity") == wanted.quantity)
        for column, names in (
            ("method", wanted.methods),
            ("trajectory", wanted.trajectories),
            ("beams", wanted.beams),
        ):
            if names:
                rows = rows.filter(pl.col(column).is_in(names))
        if rows.is_empty():
            raise DataError(
                f"expected verdicts: no cell has methods {list(wanted.methods)} and beams {list(wanted.beams)}"
            )
        for row in rows.iter_rows(named=True):
            good = (
                row["verdict"] != OVERCONFIDENT
                if wanted.verdict == "not overconfident"
                else row["verdict"] == wanted.verdict
            )
            if not good:
                found.append(
                    f"{row['trajectory']}, beams {row['beams']}, {row['method']}, {wanted.quantity}: {row['verdict']} "
                    f"({row['least']:.2f} to {row['greatest']:.2f}, "
                    f"band {row['band_lo']:.2f} to {row['band_hi']:.2f}), expected {wanted.verdict}"
                )
    return found
