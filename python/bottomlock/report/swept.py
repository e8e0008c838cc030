"""The sweep of a study for its page: groups of rows, and the one setting of `vb` that the paper does not print."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import polars as pl

from bottomlock.tables.studies import CURRENT, VIRTUAL_BEAM_FACTOR


@dataclass(frozen=True)
class VirtualBeam:
    """`vb` on one trajectory as the paper's equation has it, and with the factor of least velocity error.

    Attributes:
        trajectory: its name.
        printed: row of `tables.studies.SWEEP` with n_f = 1.
        best: row of the least velocity error.
        tc: row of `tc` in the same runs, None where the sweep has none.
    """

    trajectory: str
    printed: Mapping[str, Any]
    best: Mapping[str, Any]
    tc: Mapping[str, Any] | None


def virtual_beams(sweep: pl.DataFrame | None, trajectories: Sequence[str]) -> list[VirtualBeam]:
    """`vb` at n_f = 1 and at its best on each trajectory of a sweep over n_f; empty where there is none."""
    found = []
    for name in trajectories:
        if sweep is None:
            break
        here = sweep.filter(pl.col("trajectory") == name)
        rows = here.filter((pl.col("parameter") == VIRTUAL_BEAM_FACTOR) & (pl.col("method") == "vb"))
        printed = rows.filter(pl.col("value") == "1")
        if not printed.height:
            continue
        still = here.filter(
            (pl.col("parameter") == CURRENT) & (pl.col("value") == "0") & (pl.col("method") == "tc")
        )
        found.append(
            VirtualBeam(
                name,
                printed.row(0, named=True),
                rows.sort("velocity_rms_over_runs_mps").row(0, named=True),
                still.row(0, named=True) if still.height else None,
            )
        )
    return found


def sweep_groups(sweep: pl.DataFrame) -> Iterator[tuple[str, str, pl.DataFrame]]:
    """Parameter, trajectory and their rows, in the order of the sweep."""
    for (parameter,), rows in sweep.group_by("parameter", maintain_order=True):
        for (trajectory,), here in rows.group_by("trajectory", maintain_order=True):
            yield str(parameter), str(trajectory), here
