"""Which samples of a trajectory lie in its turns, and which on its legs."""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from bottomlock.paper.claims import NotTestableError
from bottomlock.statistics.rms import Array
from bottomlock.tables.results import CampaignTables

TURN_RATE_RADPS = np.deg2rad(2.0)
"""Above it the course changes by intent; the paper's turns are half circles in some 20 s."""


def turns_and_legs(campaign: CampaignTables, trajectory: str, time_s: Array) -> tuple[list[int], list[int]]:
    """Numbers of the samples in the turns and on the legs after the dive.

    The turns are those of the true path, or of the scenario's timetable where the truth is analytic.

    Args:
        campaign: its tables.
        trajectory: one of its trajectories.
        time_s: (times,) of the samples.

    Raises:
        NotTestableError: if turns and legs cannot be identified, with the reason.
    """
    settings = campaign.configuration(trajectory)["trajectory"]
    if any(settings.get(key) is None for key in ("dive_s", "leg_s", "turn_s")):
        raise NotTestableError("the scenario has no legs and turns")
    if campaign.paths is not None:
        path = campaign.paths.filter(pl.col("trajectory") == trajectory).sort("time_ns")
        if path.height > 2:
            return _after(time_s, _turning(path, time_s), settings["dive_s"])
    if settings.get("source") != "analytic":
        raise NotTestableError("the turns of the vehicle's path are not in the tables (no truth.parquet)")
    phase = np.mod(time_s - settings["dive_s"], settings["leg_s"] + settings["turn_s"])
    return _after(time_s, phase > settings["leg_s"], settings["dive_s"])


def _turning(path: pl.DataFrame, time_s: Array) -> NDArray[np.bool_]:
    """(times,) where the course of the path changes faster than `TURN_RATE_RADPS`."""
    clock = path["time_ns"].to_numpy() * 1e-9
    course = np.arctan2(
        np.gradient(path["east_m"].to_numpy(), clock), np.gradient(path["north_m"].to_numpy(), clock)
    )
    rate = np.abs(np.gradient(np.unwrap(course), clock))
    return np.asarray(np.interp(time_s, clock, rate) > TURN_RATE_RADPS)


def _after(time_s: Array, turning: NDArray[np.bool_], start_s: float) -> tuple[list[int], list[int]]:
    late = time_s > start_s
    turns, legs = np.flatnonzero(late & turning), np.flatnonzero(late & ~turning)
    if turns.size == 0 or legs.size == 0:
        raise NotTestableError("no turn, or no leg, after the dive")
    return turns.tolist(), legs.tolist()
