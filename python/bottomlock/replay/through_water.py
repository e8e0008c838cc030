"""Motion through the water in the results of a replay: the current that methods estimate, and how readings fit."""

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
    """A row per method that uses the water and time (`tables.replay.CURRENTS`); empty where nothing measures it."""
    empty = pl.DataFrame(schema=dict(CURRENTS))
    sections = rerun.prepared.streams.through_water
    if not sections:
        return empty
    parts = [empty]
    times = rerun.prepared.sample_time_ns
    for index, method in enumerate(case.replay.filters):
        if not any(_given(rerun, index, section) for section in sections):
            continue
        current = rerun.result["current_t_mps"][index]
        sd = np.sqrt(np.diagonal(rerun.result["current_covariance"][index], axis1=1, axis2=2))
        keys = {"case": case.name, "what_if": what_if, "method": method}
        columns: dict[str, Any] = {key: [word] * len(times) for key, word in keys.items()}
        columns |= {"time_ns": times, "north_mps": current[:, 0], "east_mps": current[:, 1]}
        columns |= {"sd_north_mps": sd[:, 0], "sd_east_mps": sd[:, 1]}
        parts.append(pl.DataFrame(columns, schema=dict(CURRENTS)))
    return pl.concat(parts)


def fix_words(case: Case, rerun: Rerun, section: str) -> list[list[str]]:
    """A row for each method that was given readings of a section: their number, those beyond the gate, NIS and degrees.

    Beyond the gate is the NIS of all rows of a reading together, whatever gate the filter has.
    """
    rows = []
    for index, method in enumerate(case.replay.filters):
        records = _given(rerun, index, section)
        if not records:
            continue
        nis, degrees = (np.concatenate(parts) for parts in zip(*map(_nis, records), strict=True))
        beyond = int((nis > chi2.ppf(case.filter.gate_probability, degrees)).sum())
        mean, of = number(float(nis.mean())), number(float(degrees.mean()))
        rows.append([f"`{method}`", str(len(nis)), str(beyond), mean, of])
    return rows


REPORTS = {"effort": ("effort_surge", "effort_sway", "effort_heave")}
"""The kernel's updates of a section, where they are several."""


def _given(rerun: Rerun, method: int, section: str) -> list[Any]:
    """Innovations of a section's readings that a method was given, of each update; empty as for beams and `ins`."""
    found = rerun.result["innovations"][method]
    records = [found[report] for report in REPORTS.get(section, (section,)) if report in found]
    return [one for one in records if len(one["time_ns"])]


def _nis(records: Any) -> tuple[Floats, Times]:  # noqa: ANN401 - the kernel's dict
    """(k,) normalised innovation squared zᵀS⁻¹z of each reading, and its number of rows."""
    degrees = np.asarray(records["rows"], dtype=np.int64)
    nis = np.empty(len(degrees))
    for k, size in enumerate(degrees):
        z, S = records["residual"][k, :size], records["covariance"][k, :size, :size]
        nis[k] = z @ np.linalg.solve(S, z)
    return nis, degrees
