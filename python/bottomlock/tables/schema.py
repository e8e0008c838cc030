"""Tables that pass between the rooms and go to disk: column names, types, meanings."""

from collections.abc import Mapping

import polars as pl

from bottomlock.errors import DataError

BIASES = (
    *(f"accel_bias_{axis}_mps2" for axis in "xyz"),
    *(f"gyro_bias_{axis}_radps" for axis in "xyz"),
)
"""The biases of the IMU in the platform frame, in the kernel's order."""

_BIAS_COLUMNS: Mapping[str, pl.DataType] = {
    f"{kind}_{bias}": pl.Float64() for kind in ("err", "sd") for bias in BIASES
}

RUNS: Mapping[str, pl.DataType] = {
    "trajectory": pl.String(),
    "run": pl.Int64(),
    "method": pl.String(),
    "velocity_rms_mps": pl.Float64(),
    "attitude_rms_deg": pl.Float64(),
    "position_rms_m": pl.Float64(),
    "velocity_final_mps": pl.Float64(),
    "attitude_final_deg": pl.Float64(),
    "position_final_m": pl.Float64(),
    "nees_mean": pl.Float64(),
    "nis_mean": pl.Float64(),
    "fixes_accepted": pl.Int64(),
    "fixes_rejected": pl.Int64(),
    "cross_track_rms_m": pl.Float64(),
    "cross_track_max_m": pl.Float64(),
    **_BIAS_COLUMNS,
}
"""A row per trajectory, run and method: RMS over time and final norms of the error vectors; `nis_mean` is null
without fixes. The cross-track error is that of the true vehicle; it is null for an analytic truth. Errors of the
biases (true minus estimate) and their claimed standard deviations are those of the last sample."""

ENSEMBLE: Mapping[str, pl.DataType] = {
    "trajectory": pl.String(),
    "method": pl.String(),
    "time_s": pl.Float64(),
    "velocity_rms_mps": pl.Float64(),
    "velocity_rms_lo_mps": pl.Float64(),
    "velocity_rms_hi_mps": pl.Float64(),
    "attitude_rms_deg": pl.Float64(),
    "attitude_rms_lo_deg": pl.Float64(),
    "attitude_rms_hi_deg": pl.Float64(),
    "position_rms_m": pl.Float64(),
    "nees": pl.Float64(),
}
"""A row per trajectory, method and second: RMS over runs with its 95 % bootstrap interval, mean NEES of the whole
state."""

CONSISTENCY: Mapping[str, pl.DataType] = {
    "trajectory": pl.String(),
    "method": pl.String(),
    "quantity": pl.String(),
    "degrees": pl.Int64(),
    "runs": pl.Int64(),
    "mean": pl.Float64(),
    "band_lo": pl.Float64(),
    "band_hi": pl.Float64(),
    "part_inside": pl.Float64(),
    "verdict": pl.String(),
}
"""A row per trajectory, method and kind of NEES: mean over runs and time, the 95 % chi-squared band of the mean
over runs at one time, the part of the times at which it lies inside, and the verdict on the mean over time."""

SAMPLES: Mapping[str, pl.DataType] = {
    "trajectory": pl.String(),
    "run": pl.Int64(),
    "method": pl.String(),
    "time_ns": pl.Int64(),
    **{f"err_position_{axis}_m": pl.Float64() for axis in ("north", "east", "down")},
    **{f"err_misalignment_{axis}_rad": pl.Float64() for axis in ("north", "east", "down")},
    **{f"err_velocity_{axis}_mps": pl.Float64() for axis in ("surge", "sway", "heave")},
    **{f"sd_position_{axis}_m": pl.Float64() for axis in ("north", "east", "down")},
    **{f"sd_misalignment_{axis}_rad": pl.Float64() for axis in ("north", "east", "down")},
    **{f"sd_velocity_{axis}_mps": pl.Float64() for axis in ("surge", "sway", "heave")},
    "nees": pl.Float64(),
    "nees_velocity_attitude": pl.Float64(),
}
"""A row per trajectory, run, method and second: error (true minus estimate) and claimed standard deviation."""

OUTCOMES: Mapping[str, pl.DataType] = {
    "trajectory": pl.String(),
    "run": pl.Int64(),
    "method": pl.String(),
    "nis_mean": pl.Float64(),
    "fixes_accepted": pl.Int64(),
    "fixes_rejected": pl.Int64(),
    "cross_track_rms_m": pl.Float64(),
    "cross_track_max_m": pl.Float64(),
    **_BIAS_COLUMNS,
}
"""A row per trajectory, run and method: what the gate made of the DVL's fixes, how far astray the vehicle went, and how
well the IMU's biases are known in the end."""


PATHS: Mapping[str, pl.DataType] = {
    "trajectory": pl.String(),
    "time_ns": pl.Int64(),
    "north_m": pl.Float64(),
    "east_m": pl.Float64(),
    "depth_m": pl.Float64(),
}
"""A row per trajectory and time: where the vehicle truly was."""

CHOICES: Mapping[str, pl.DataType] = {
    "trajectory": pl.String(),
    "method": pl.String(),
    "time_ns": pl.Int64(),
    "component": pl.String(),
    "source": pl.String(),
    "runs": pl.Int64(),
}
"""A row per trajectory, method that chooses, ping, component and source: in how many runs it was chosen."""

SWEEP: Mapping[str, pl.DataType] = {
    "parameter": pl.String(),
    "value": pl.String(),
    "trajectory": pl.String(),
    "method": pl.String(),
    "velocity_rms_mps": pl.Float64(),
    "attitude_rms_deg": pl.Float64(),
    "nees_mean": pl.Float64(),
    "rejected_fraction": pl.Float64(),
}
"""A row per value of a swept setting, trajectory and method; `rejected_fraction` is null without fixes."""

CLAIMS: Mapping[str, pl.DataType] = {
    "claim": pl.String(),
    "trajectory": pl.String(),
    "quantity": pl.String(),
    "paper": pl.Float64(),
    "ours": pl.Float64(),
    "lo": pl.Float64(),
    "hi": pl.Float64(),
    "verdict": pl.String(),
    "note": pl.String(),
}
"""A row per claim of the paper: the printed number (null where it prints an ordering), ours with its 95 % bootstrap
interval (null where it cannot be tested), the verdict and what was measured about it."""


OBSERVABILITY: Mapping[str, pl.DataType] = {
    "case": pl.String(),
    "aiding": pl.String(),
    "mask": pl.String(),
    "motion": pl.String(),
    "model": pl.String(),
    "window_s": pl.Float64(),
    "states": pl.Int64(),
    "rank": pl.Int64(),
    "expected_rank": pl.Int64(),
    "printed_rank": pl.Int64(),
    "gap": pl.Float64(),
    "verdict": pl.String(),
    "unobservable": pl.List(pl.String()),
    "singular_values": pl.List(pl.Float64()),
}
"""A row per window, aiding set and model: the length of the window, the rank (null where it is undecided), the exact
one where it is known, the one that a paper prints, the gap between kept and dropped singular values, and the hidden
directions in words."""

DEVIATIONS: Mapping[str, pl.DataType] = {
    "case": pl.String(),
    "motion": pl.String(),
    "model": pl.String(),
    "time_ns": pl.Int64(),
    "state": pl.String(),
    "sd": pl.Float64(),
}
"""A row per case, motion, time and state: the standard deviation that a filter claims, SI."""

RANKS: Mapping[str, pl.DataType] = {
    "case": pl.String(),
    "motion": pl.String(),
    "model": pl.String(),
    "time_ns": pl.Int64(),
    "rank": pl.Int64(),
    "decided": pl.Boolean(),
    "printed_rank": pl.Int64(),
}
"""A row per case, motion, model and time: the rank of the window from the start until then."""


PLAN: Mapping[str, pl.DataType] = {
    "manoeuvre": pl.String(),
    "aiding": pl.String(),
    "state": pl.String(),
    "verdict": pl.String(),
    "sd_before": pl.Float64(),
    "sd_after": pl.Float64(),
    "part_left": pl.Float64(),
}
"""A row per manoeuvre and state: whether the manoeuvre makes the state observable by itself ("observable", "hidden",
"undecided"), and what the filter would claim before and after it, SI."""


def check(frame: pl.DataFrame, columns: Mapping[str, pl.DataType], *, place: str) -> pl.DataFrame:
    """The frame itself, if it has exactly these columns in this order and of these types.

    Raises:
        DataError: naming the place, the column and what was expected.

    Examples:
        >>> check(pl.DataFrame({"run": [1]}), {"run": pl.Int64()}, place="runs.parquet").shape
        (1, 1)
    """
    for name, dtype in columns.items():
        if name not in frame.columns:
            raise DataError(f"{place}: column '{name}' is missing, expected {', '.join(columns)}")
        if frame.schema[name] != dtype:
            raise DataError(f"{place}: column '{name}' is {frame.schema[name]}, expected {dtype}")
    extra = [name for name in frame.columns if name not in columns]
    if extra:
        raise DataError(f"{place}: column '{extra[0]}' is unknown, expected {', '.join(columns)}")
    return frame.select(list(columns))
