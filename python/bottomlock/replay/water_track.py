"""Water track in the results of a replay: the current that each method estimates, and how the beams fit."""

from typing import Any

import numpy as np
import polars as pl
from scipy.stats import chi2

from bottomlock.pages.numbers import number
from bottomlock.recordings.streams import Floats, Times
from bottomlock.replay.case import Case
from bottomlock.replay.rerun import Rerun
from bottomlock.tables.replay import CURRENTS


def currents_table(case: Case, what_if: str, rerun: Rerun) -> pl.DataFrame:
    """A row per method that uses the water and time (`tables.replay.CURRENTS`); empty without water track."""
    empty = pl.DataFrame(schema=dict(CURRENTS))
    if rerun.prepared.streams.water is None:
        return empty
    parts = [empty]
    times = rerun.prepared.sample_time_ns
    for index, method in enumerate(case.replay.filters):
        if _given(rerun, index) is None:
            continue
        current = rerun.result["current_t_mps"][index]
        sd = np.sqrt(np.diagonal(rerun.result["current_covariance"][index], axis1=1, axis2=2))
        keys = {"case": case.name, "what_if": what_if, "run": rerun.prepared.run, "method": method}
        columns: dict[str, Any] = {key: [word] * len(times) for key, word in keys.items()}
        columns |= {"time_ns": times, "north_mps": current[:, 0], "east_mps": current[:, 1]}
        columns |= {"sd_north_mps": sd[:, 0], "sd_east_mps": sd[:, 1]}
        parts.append(pl.DataFrame(columns, schema=dict(CURRENTS)))
    return pl.concat(parts)


def water_words(case: Case, rerun: Rerun) -> list[list[str]]:
    """A row for each method that was given pings of the water: their number, those beyond the gate, NIS and degrees.

    Beyond the gate is the NIS of all beams of a ping together, whatever gate the filter has.
    """
    rows = []
    for index, method in enumerate(case.replay.filters):
        water = _given(rerun, index)
        if water is None:
            continue
        nis, degrees = _nis(water)
        beyond = int((nis > chi2.ppf(case.filter.gate_probability, degrees)).sum())
        mean, of = number(float(nis.mean())), number(float(degrees.mean()))
        rows.append([f"`{method}`", str(len(nis)), str(beyond), mean, of])
    return rows


def _given(rerun: Rerun, method: int) -> Any:  # noqa: ANN401 - the kernel's dict
    """Innovations of the pings of the water that a method was given; None where it was given none, as `ins` is."""
    water = rerun.result["innovations"][method].get("water_track")
    return water if water is not None and len(water["time_ns"]) else None


def _nis(records: Any) -> tuple[Floats, Times]:  # noqa: ANN401 - the kernel's dict
    """(k,) normalised innovation squared zᵀS⁻¹z of each ping, and its number of rows."""
    degrees = np.asarray(records["rows"], dtype=np.int64)
    nis = np.empty(len(degrees))
    for k, size in enumerate(degrees):
        z, S = records["residual"][k, :size], records["covariance"][k, :size, :size]
        nis[k] = z @ np.linalg.solve(S, z)
    return nis, degrees
