"""The published studies (docs/evidence.md), as advice needs them: where each method was overconfident.

A campaign tests the assumptions of its methods in its own water only. What a method may be recommended for therefore
also comes from here. `python -m tools.evidence --publish` writes the packaged table; its metadata name commits and
commands.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib import resources
from typing import Any

import polars as pl

from bottomlock.errors import DataError
from bottomlock.statistics.chi_squared import CONSISTENT, OVERCONFIDENT
from bottomlock.tables.check import check
from bottomlock.tables.studies import PUBLISHED

FILE = "published.parquet"

IN_CURRENT = ("survey", "hovering")
"""Worlds whose water moves; that of the paper is still."""

INSTRUMENT = {"configuration": "x", "tilt_deg": 20.0}
"""Keys of `[dvl]` of the paper's world; for another instrument the numbers of beams can mean another geometry, and a
campaign is compared with all cells."""

CHANGING = ("outages", "dropouts", "altitude_loss", "replay_validity")
"""Keys of `[dvl]` by which the returning beams change with time."""


@dataclass(frozen=True)
class Standing:
    """How a method did in the published studies, counted in cells (world, trajectory and set of beams).

    Attributes:
        cells: number of cells.
        consistent: cells whose verdict is that.
        overconfident: cells whose verdict is that: in velocity and attitude, or in the whole state.
        overconfident_core: those of them in velocity and attitude.
    """

    cells: int
    consistent: int
    overconfident: int
    overconfident_core: int

    def count_overconfident(self, where: str) -> str:
        """The overconfident cells in words, with what cells they are."""
        count = f"overconfident in {self.overconfident} of {self.cells}{where}"
        return f"{count} (velocity and attitude: {self.overconfident_core})"


def load_published() -> pl.DataFrame:
    """The packaged table, `tables.studies.PUBLISHED`.

    >>> load_published().columns[:4]
    ['world', 'method', 'trajectory', 'beams']
    """
    content = (resources.files("bottomlock.report") / FILE).read_bytes()
    return check(pl.read_parquet(content), PUBLISHED, place=FILE)


def returning_beams(configuration: Mapping[str, Any]) -> str | None:
    """The beams that return from first to last, as the published studies write them.

    None where they change with time, or belong to another instrument than the studies'.

    Args:
        configuration: of a scenario, as the manifest records it.

    >>> x = {"configuration": "x", "tilt_deg": 20.0}
    >>> returning_beams({"dvl": x | {"beams_lost": [3, 4]}}), returning_beams({"dvl": x | {"dropouts": [{}]}})
    ('1,2', None)
    """
    dvl = configuration["dvl"]
    another = any(dvl.get(key) != value for key, value in INSTRUMENT.items())
    if another or configuration.get("seabed") or any(dvl.get(key) for key in CHANGING):
        return None
    lost = set(dvl.get("beams_lost", ()))
    return ",".join(str(beam) for beam in range(1, 5) if beam not in lost)


def standing(published: pl.DataFrame, method: str) -> Standing:
    """The counts of a method in these cells.

    Raises:
        DataError: for a method without a cell.
    """
    chosen = published.filter(pl.col("method") == method)
    if chosen.is_empty():
        raise DataError(f"holds no cell of method '{method}'", place=FILE)
    verdict = pl.col("verdict")
    counts = chosen.select(
        (verdict == CONSISTENT).sum().alias("consistent"),
        (verdict == OVERCONFIDENT).sum().alias("overconfident"),
        (pl.col("verdict_velocity_attitude") == OVERCONFIDENT).sum().alias("overconfident_core"),
    ).row(0, named=True)
    return Standing(chosen.height, **counts)


def standings(published: pl.DataFrame, methods: Iterable[str], beams: str | None) -> dict[str, Standing]:
    """The counts of those methods that the studies have flown, under one set of beams or all for None."""
    here = published if beams is None else published.filter(pl.col("beams") == beams)
    known = set(here["method"].unique().to_list())
    return {method: standing(here, method) for method in methods if method in known}
