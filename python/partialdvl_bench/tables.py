"""Tables of PartialDVL-Bench: submissions and scores; column names, types, meanings."""

from collections.abc import Mapping

import polars as pl

BODY = ("surge", "sway", "heave")
NED = ("north", "east", "down")


def _upper(names: tuple[str, ...]) -> list[str]:
    return [f"{one}_{other}" for k, one in enumerate(names) for other in names[k:]]


VELOCITY = tuple(f"{axis}_mps" for axis in BODY)
VELOCITY_COV = tuple(f"cov_{pair}_m2ps2" for pair in _upper(BODY))
POSITION = tuple(f"{axis}_m" for axis in NED)
POSITION_COV = tuple(f"cov_{pair}_m2" for pair in _upper(NED))
ATTITUDE = tuple(f"attitude_{part}" for part in "wxyz")
CURRENT = ("current_north_mps", "current_east_mps")
CURRENT_COV = tuple(f"cov_current_{pair}_m2ps2" for pair in _upper(("north", "east")))

BLOCKS: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "velocity": (VELOCITY, VELOCITY_COV),
    "position": (POSITION, POSITION_COV),
    "current": (CURRENT, CURRENT_COV),
}
"""Value columns and columns of the upper triangle of the covariance, row by row, of what a submission answers."""

SUBMISSION: Mapping[str, pl.DataType] = {
    "mission": pl.String(),
    "time_ns": pl.Int64(),
    **{name: pl.Float64() for values, covariance in BLOCKS.values() for name in (*values, *covariance)},
    **{name: pl.Float64() for name in ATTITUDE},
    "wall_s": pl.Float64(),
}
"""A row per mission and time of its grid. Velocity over ground in platform axes (forward, right, down), position in the
tangent frame (north, east, down from the origin), attitude from platform to tangent as a unit quaternion, scalar first,
velocity of the water; null for what is not answered. `wall_s` is the time the filter took for the whole mission, the
same in all its rows."""

BEAM_SUBMISSION: Mapping[str, pl.DataType] = {
    "mission": pl.String(),
    "time_ns": pl.Int64(),
    "mask": pl.String(),
    **{name: pl.Float64() for name in (*VELOCITY, *VELOCITY_COV)},
}
"""A row per ping and mask of task T1: the velocity from the beams that the mask leaves ("1100": beams 1 and 2)."""

PING_SUBMISSION: Mapping[str, pl.DataType] = {
    "recording": pl.String(),
    "time_ns": pl.Int64(),
    "mask": pl.String(),
    "beam": pl.Int64(),
    "reading_mps": pl.Float64(),
    "sd_mps": pl.Float64(),
}
"""A row per ping, mask and beam left out of task T5: what the beam would read, from the beams that the mask leaves."""

SCORES: Mapping[str, pl.DataType] = {
    "method": pl.String(),
    "mission": pl.String(),
    "task": pl.String(),
    "score": pl.String(),
    "value": pl.Float64(),
    "rows": pl.Int64(),
}
"""A row per method, mission (or recording), task and score; `rows` is the number of rows that it is the mean over."""

LEADERBOARD: Mapping[str, pl.DataType] = {
    "task": pl.String(),
    "score": pl.String(),
    "method": pl.String(),
    "missions": pl.Int64(),
    "value": pl.Float64(),
    "lo": pl.Float64(),
    "hi": pl.Float64(),
    "difference": pl.Float64(),
    "difference_lo": pl.Float64(),
    "difference_hi": pl.Float64(),
    "reference": pl.String(),
}
"""A row per task, score and method: mean over missions with its 95 % bootstrap interval over missions, and the paired
difference to the reference method."""
