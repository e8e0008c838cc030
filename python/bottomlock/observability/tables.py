"""Observability tables: the six cases of the 2015 paper, and every mask along any truth."""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import polars as pl

from bottomlock.files.columns import OBSERVABILITY
from bottomlock.kernel import BeamGeometry
from bottomlock.observability.analysis import Aiding, Finding, Kind, Schedule, observe
from bottomlock.simulation.manoeuvres import Manoeuvre, manoeuvre_truth, motion_of, steady
from bottomlock.truth import Truth

DVL, PRESSURE = Aiding(velocity=True), Aiding(depth=True)
CONSTANT, QUIET = "constant", "quiet leg first"
MODELS: Mapping[Kind, str] = {
    "full": "20 states",
    "inertial": "15 states",
    "paper": "2015, H with +",
    "paper_printed": "2015, H as printed",
}
"""Models by the words of the tables."""

_WINDOW_S, _QUIET_S, _RATE_RADPS = 240.0, 120.0, math.radians(1.0)


@dataclass(frozen=True)
class PaperCase:
    """A case of Klein & Diamant 2015: the printed rank, and the rank of their model by exact arithmetic.

    Attributes:
        name: short name.
        aiding: DVL or pressure sensor.
        speed_mps: surge.
        axis: "yaw", "pitch" or "" for a vehicle without rotation.
        printed_rank: states less the dimensions of the printed unobservable subspace.
        exact: rank by exact arithmetic for each (window, model) that is judged; `tests/oracle` derives each.
    """

    name: str
    aiding: Aiding
    speed_mps: float
    axis: str
    printed_rank: int
    exact: Mapping[tuple[str, Kind], int]

    def model(self, kind: Kind) -> str:
        """Name of the model; with the pressure sensor the sign of H does not matter."""
        return MODELS[kind] if self.aiding.velocity else "2015"

    def manoeuvre(self, window: str) -> Manoeuvre:
        """The motion: constant over the window, or after an interval at rest or straight at the same speed."""
        start_s = _QUIET_S if window == QUIET else 0.0
        angles = {self.axis: steady(_RATE_RADPS, start_s)} if self.axis else {}
        return Manoeuvre(
            name=self.name,
            words=window,
            motion=motion_of(self.speed_mps, **angles),
            duration_s=_WINDOW_S,
            joints_s=(start_s,) if self.axis and start_s > 0.0 else (),
        )


def _exact(signs: Sequence[Kind], *ranks: int) -> dict[tuple[str, Kind], int]:
    """The same ranks for every sign: over a constant motion, and after a quiet leg where there is one."""
    return {
        (window, kind): rank for window, rank in zip((CONSTANT, QUIET), ranks, strict=False) for kind in signs
    }


_EITHER: tuple[Kind, ...] = ("paper", "paper_printed")
PAPER_CASES: tuple[PaperCase, ...] = (
    PaperCase("DVL, at rest", DVL, 0.0, "", 8, _exact(_EITHER, 8)),
    PaperCase("DVL, yaw turn on the spot", DVL, 0.0, "yaw", 10, _exact(_EITHER, 8, 10)),
    PaperCase(
        "DVL, turn at 10 m/s", DVL, 10.0, "yaw", 11,
        _exact(_EITHER, 8, 10) | {(CONSTANT, "paper_printed"): 9, (QUIET, "paper_printed"): 12},
    ),
    PaperCase("pressure, at rest", PRESSURE, 0.0, "", 3, _exact(["paper"], 3)),
    PaperCase("pressure, pitch turn on the spot", PRESSURE, 0.0, "pitch", 4, _exact(["paper"], 4, 4)),
    PaperCase("pressure, turn at 10 m/s", PRESSURE, 10.0, "yaw", 6, _exact(["paper"], 5, 6)),
)  # fmt: skip
"""The six cases (2015, Eqs 27-39 and 46-56), in the order of its figures; the sign of H matters for the DVL alone."""


def table_row(
    case: str,
    aiding: Aiding,
    motion: str,
    kind: Kind,
    found: Finding,
    *,
    expected_rank: int | None = None,
    printed_rank: int | None = None,
    verdict: str | None = None,
) -> dict[str, Any]:
    """A finding as a row of `files.columns.OBSERVABILITY`."""
    return {
        "case": case,
        "aiding": aiding.name,
        "mask": aiding.mask,
        "motion": motion,
        "model": MODELS[kind],
        "window_s": float(found.time_ns[-1] - found.time_ns[0]) * 1e-9,
        "states": len(found.states),
        "rank": found.rank if found.decided else None,
        "expected_rank": expected_rank,
        "printed_rank": printed_rank,
        "gap": found.gap,
        "verdict": verdict or ("decided" if found.decided else "undecided"),
        "unobservable": list(found.unobservable),
        "singular_values": found.singular_values.tolist(),
    }


def _paper_verdict(found: Finding, printed: int) -> str:
    if not found.decided:
        return "undecided"
    if found.rank == printed:
        return "as printed"
    return f"{'fewer' if found.rank < printed else 'more'} than printed"


def paper_table() -> pl.DataFrame:
    """The six cases of the 2015 paper, each window and sign: `files.columns.OBSERVABILITY`.

    Examples:
        >>> table = paper_table()
        >>> table.filter(case="DVL, turn at 10 m/s")["rank"].to_list()
        [8, 9, 10, 12]
    """
    rows = []
    for case in PAPER_CASES:
        for (window, kind), exact in case.exact.items():
            truth = manoeuvre_truth(case.manoeuvre(window), rate_hz=50.0)
            (found,) = observe(
                truth, _ANY_BEAMS, [case.aiding], kind=kind, earth_rate_radps=0.0, period_s=2.0
            )
            rows.append(
                table_row(
                    case.name, case.aiding, window, kind, found,
                    expected_rank=exact, printed_rank=case.printed_rank,
                    verdict=_paper_verdict(found, case.printed_rank),
                )
                | {"model": case.model(kind)}
            )  # fmt: skip
    return pl.DataFrame(rows, schema=dict(OBSERVABILITY))


_ANY_BEAMS = BeamGeometry.janus(math.radians(20.0))
"""The 2015 model measures a velocity; no beam of this geometry is used."""


def masks(beams: int) -> list[tuple[int, ...]]:
    """Every choice of at least one beam, fewest first.

    >>> masks(3)
    [(1,), (2,), (3,), (1, 2), (1, 3), (2, 3), (1, 2, 3)]
    """
    numbers = range(1, beams + 1)
    return [mask for count in numbers for mask in itertools.combinations(numbers, count)]


def mask_table(
    truth: Truth,
    geometry: BeamGeometry,
    other: Aiding,
    *,
    case: str,
    motion: str,
    kind: Kind,
    earth_rate_radps: float,
    schedule: Schedule,
) -> pl.DataFrame:
    """Rank and unobservable directions of a truth for every mask: `files.columns.OBSERVABILITY`.

    Args:
        truth: any truth.
        geometry: the beams.
        other: sensors beside the beams; its own beams are replaced.
        case, motion: words for the table.
        kind: the model.
        earth_rate_radps: Earth rate that the truth was made with.
        schedule: measurement times.
    """
    sets = [replace(other, beams=mask) for mask in masks(geometry.beams)]
    found = observe(truth, geometry, sets, kind=kind, earth_rate_radps=earth_rate_radps, schedule=schedule)
    rows = [table_row(case, aiding, motion, kind, one) for aiding, one in zip(sets, found, strict=True)]
    return pl.DataFrame(rows, schema=dict(OBSERVABILITY))
