"""Every mask of an instrument in every manoeuvre, judged over windows that are long enough to decide."""

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import replace

import polars as pl

from bottomlock.kernel import EARTH_RATE_RADPS, BeamGeometry
from bottomlock.observability.analysis import Aiding, Finding, observe
from bottomlock.observability.tables import masks, table_row
from bottomlock.tables.observability import OBSERVABILITY
from bottomlock.truth.manoeuvres import MANOEUVRES, Manoeuvre, manoeuvre_truth

THREE_AIDINGS: tuple[Aiding, ...] = (Aiding(), Aiding(depth=True), Aiding(depth=True, attitude=True))
"""Aiding beside the beams: nothing, depth, depth and magnetometer."""


def manoeuvre_table(
    geometry: BeamGeometry,
    *,
    manoeuvres: Iterable[Manoeuvre] = tuple(MANOEUVRES.values()),
    others: Sequence[Aiding] = THREE_AIDINGS,
    earth_rates_radps: Sequence[float] = (0.0, EARTH_RATE_RADPS),
    rate_hz: float = 50.0,
) -> pl.DataFrame:
    """Every mask by every manoeuvre by every set of further sensors, on an Earth at rest and a turning one.

    A rank that is undecided over the window of a manoeuvre is computed over windows four and sixteen times as long: the
    manoeuvres are analytic, so that every window has the same rank, but the Earth's rotation shows better in a longer
    one. The column window_s holds the window used.
    """
    sets = [replace(other, beams=mask) for other, mask in itertools.product(others, masks(geometry.beams))]
    rows = []
    for manoeuvre, earth_rate_radps in itertools.product(manoeuvres, earth_rates_radps):
        found = _decide(manoeuvre, geometry, sets, earth_rate_radps=earth_rate_radps, rate_hz=rate_hz)
        case = "Earth turning" if earth_rate_radps else "Earth at rest"
        rows += [
            table_row(case, aiding, manoeuvre.name, "full", one)
            for aiding, one in zip(sets, found, strict=True)
        ]
    return pl.DataFrame(rows, schema=dict(OBSERVABILITY))


_LONGER, _EPOCHS = (1.0, 4.0, 16.0), 32
"""Windows in lengths of the manoeuvre, and intervals between the epochs of each."""


def _decide(
    manoeuvre: Manoeuvre,
    geometry: BeamGeometry,
    sets: Sequence[Aiding],
    *,
    earth_rate_radps: float,
    rate_hz: float,
) -> list[Finding]:
    """Each set over the shortest window that decides its rank, or over the longest."""
    found: dict[int, Finding] = {}
    open_sets = list(range(len(sets)))
    for factor in _LONGER:
        window_s = factor * manoeuvre.duration_s
        truth = manoeuvre_truth(
            replace(manoeuvre, duration_s=window_s), rate_hz=rate_hz, earth_rate_radps=earth_rate_radps
        )
        judged = observe(
            truth,
            geometry,
            [sets[k] for k in open_sets],
            earth_rate_radps=earth_rate_radps,
            period_s=window_s / _EPOCHS,
        )
        found |= dict(zip(open_sets, judged, strict=True))
        open_sets = [k for k in open_sets if not found[k].decided]
        if not open_sets:
            break
    return [found[k] for k in range(len(sets))]
