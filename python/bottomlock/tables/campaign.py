"""Tables of a campaign: column names, types, meanings."""

from collections.abc import Mapping

import polars as pl

BIASES = (*(f"accel_bias_{axis}_mps2" for axis in "xyz"), *(f"gyro_bias_{axis}_radps" for axis in "xyz"))
"""The biases of the IMU in the platform frame, in the kernel's order."""

_BIAS_COLUMNS: Mapping[str, pl.DataType] = {
    f"{kind}_{bias}": pl.Float64() for kind in ("err", "sd") for bias in BIASES
}

SAMPLES: Mapping[str, pl.DataType] = {
    "trajectory": pl.String(),
    "run": pl.Int64(),
    "method": pl.String(),
    "time_ns": pl.Int64(),
    **{f"err_position_{axis}_m": pl.Float32() for axis in ("north", "east", "down")},
    **{f"err_misalignment_{axis}_rad": pl.Float32() for axis in ("north", "east", "down")},
    **{f"err_velocity_{axis}_mps": pl.Float32() for axis in ("surge", "sway", "heave")},
    **{f"sd_position_{axis}_m": pl.Float32() for axis in ("north", "east", "down")},
    **{f"sd_misalignment_{axis}_rad": pl.Float32() for axis in ("north", "east", "down")},
    **{f"sd_velocity_{axis}_mps": pl.Float32() for axis in ("surge", "sway", "heave")},
    "nees": pl.Float32(),
    "nees_velocity_attitude": pl.Float32(),
}
"""A row per trajectory, run, method and second: error (true minus estimate) and claimed standard deviation.

Single precision, as much as errors are worth: in double a study of 500 runs takes three times the space."""

COMPONENTS = tuple(
    f"{quantity}_{axis}"
    for quantity, axes in (
        ("position", ("north", "east", "down")),
        ("misalignment", ("north", "east", "down")),
        ("velocity", ("surge", "sway", "heave")),
    )
    for axis in axes
)
"""The nine components of the error in `SAMPLES`, without prefix and unit."""

OUTCOMES: Mapping[str, pl.DataType] = {
    "trajectory": pl.String(),
    "run": pl.Int64(),
    "method": pl.String(),
    "nis_mean_over_fixes": pl.Float64(),
    "fixes_accepted": pl.Int64(),
    "fixes_rejected": pl.Int64(),
    "fixes_beyond_linear_range": pl.Int64(),
    "cross_track_rms_over_time_m": pl.Float64(),
    "cross_track_max_m": pl.Float64(),
    **_BIAS_COLUMNS,
}
"""A row per trajectory, run and method: fixes that the gate accepts and rejects with their mean NIS, those
before which the velocity was beyond the linear range (docs/linear_range.md), cross-track error of the true vehicle,
and errors of the IMU's biases at the last sample."""

RUNS: Mapping[str, pl.DataType] = {
    "trajectory": pl.String(),
    "run": pl.Int64(),
    "method": pl.String(),
    "velocity_rms_over_time_mps": pl.Float64(),
    "attitude_rms_over_time_deg": pl.Float64(),
    "position_rms_over_time_m": pl.Float64(),
    "velocity_final_mps": pl.Float64(),
    "attitude_final_deg": pl.Float64(),
    "position_final_m": pl.Float64(),
    "nees_mean_over_time": pl.Float64(),
    "nis_mean_over_fixes": pl.Float64(),
    "fixes_accepted": pl.Int64(),
    "fixes_rejected": pl.Int64(),
    "fixes_beyond_linear_range": pl.Int64(),
    "cross_track_rms_over_time_m": pl.Float64(),
    "cross_track_max_m": pl.Float64(),
    **_BIAS_COLUMNS,
}
"""A row per trajectory, run and method: norms of the error vectors, RMS over time and at the last sample; mean NEES
over time and mean NIS over fixes, null without fixes. The cross-track error is that of the true vehicle, null for an
analytic truth. Errors of the biases (true minus estimate) and their claimed standard deviations are those of the
last sample."""

ENSEMBLE: Mapping[str, pl.DataType] = {
    "trajectory": pl.String(),
    "method": pl.String(),
    "time_s": pl.Float64(),
    "velocity_rms_over_runs_mps": pl.Float64(),
    "velocity_rms_over_runs_lo_mps": pl.Float64(),
    "velocity_rms_over_runs_hi_mps": pl.Float64(),
    "attitude_rms_over_runs_deg": pl.Float64(),
    "attitude_rms_over_runs_lo_deg": pl.Float64(),
    "attitude_rms_over_runs_hi_deg": pl.Float64(),
    "position_rms_over_runs_m": pl.Float64(),
    "nees_mean_over_runs": pl.Float64(),
}
"""A row per trajectory, method and second: norms of the error vectors, RMS over runs with 95 % bootstrap interval
(`_lo_`, `_hi_`), and mean NEES of the whole state over runs."""

CONSISTENCY_MEANS: Mapping[str, pl.DataType] = {
    "trajectory": pl.String(),
    "method": pl.String(),
    "quantity": pl.String(),
    "degrees": pl.Int64(),
    "runs": pl.Int64(),
    "times": pl.Int64(),
    "mean": pl.Float64(),
    "least": pl.Float64(),
    "greatest": pl.Float64(),
}
"""A row per trajectory, method and kind of NEES: mean over runs and all times; the number of times at which the mean
over runs is judged, and the least and the greatest of these means. All three are null where a method has no NEES."""

CONSISTENCY: Mapping[str, pl.DataType] = {
    **CONSISTENCY_MEANS,
    "band_lo": pl.Float64(),
    "band_hi": pl.Float64(),
    "verdict": pl.String(),
}
"""The same with the chi-squared band of each judged mean and the verdict (`statistics.chi_squared.verdict`); all judged
means of a campaign are one family with a false-alarm rate of 1 %."""

PATHS: Mapping[str, pl.DataType] = {
    "trajectory": pl.String(),
    "time_ns": pl.Int64(),
    "north_m": pl.Float64(),
    "east_m": pl.Float64(),
    "depth_m": pl.Float64(),
}
"""A row per trajectory and time: true position of the vehicle, tangent frame."""

CHOICES: Mapping[str, pl.DataType] = {
    "trajectory": pl.String(),
    "method": pl.String(),
    "time_ns": pl.Int64(),
    "component": pl.String(),
    "source": pl.String(),
    "runs_chosen": pl.Int64(),
}
"""A row per trajectory, method (`elc`), ping, component and source: number of runs in which the source is chosen."""
