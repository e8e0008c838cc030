"""Tables of the studies over many campaigns: column names, types, meanings."""

from collections.abc import Mapping

import polars as pl

SWEEP: Mapping[str, pl.DataType] = {
    "parameter": pl.String(),
    "value": pl.String(),
    "trajectory": pl.String(),
    "method": pl.String(),
    "velocity_rms_over_runs_mps": pl.Float64(),
    "attitude_rms_over_runs_deg": pl.Float64(),
    "nees_mean_over_runs_and_time": pl.Float64(),
    "rejected_fraction": pl.Float64(),
}
"""A row per value of a swept setting, trajectory and method: norms of the error vectors at the last second, RMS over
runs; mean NEES of the whole state; fraction of the fixes that the gate rejects, null without fixes."""

VIRTUAL_BEAM_FACTOR = "n_f of VB"
"""The swept factor of `vb` that the paper does not print, in `parameter`."""

CURRENT = "current to the east, m/s"
"""The swept setting in `parameter` that no method without a current as a state holds."""

MASKS: Mapping[str, pl.DataType] = {
    "trajectory": pl.String(),
    "case": pl.String(),
    "beams": pl.String(),
    "method": pl.String(),
    "runs": pl.Int64(),
    "velocity_rms_over_runs_mps": pl.Float64(),
    "velocity_rms_over_runs_lo_mps": pl.Float64(),
    "velocity_rms_over_runs_hi_mps": pl.Float64(),
    "velocity_median_mps": pl.Float64(),
    "velocity_greatest_share": pl.Float64(),
    "attitude_rms_over_runs_deg": pl.Float64(),
    "position_rms_over_runs_m": pl.Float64(),
    "nees_mean_over_runs_and_time": pl.Float64(),
    "nees_velocity_attitude_mean_over_runs_and_time": pl.Float64(),
    "verdict": pl.String(),
    "rejected_fraction": pl.Float64(),
}
"""A row per trajectory, case and method: RMS over runs at the last second with a 95 % bootstrap interval; of the
velocity error also the median over runs and the share of the mean square that the worst run makes; mean over runs and
time of the NEES of the whole state and of velocity and attitude, the verdict on the latter, and the fraction of the
fixes that the gate rejects, null without fixes."""

AXES = ("surge", "sway", "heave")

RECOVERY_EPOCHS = 5
"""Number of fixes after the beams return that are judged."""

RECOVERY: Mapping[str, pl.DataType] = {
    "trajectory": pl.String(),
    "case": pl.String(),
    "beams": pl.String(),
    "method": pl.String(),
    "run": pl.Int64(),
    "epoch": pl.Int64(),
    "time_s": pl.Float64(),
    **{f"step_{axis}_mps": pl.Float64() for axis in AXES},
    **{f"sd_{axis}_mps": pl.Float64() for axis in AXES},
    "step_sigmas": pl.Float64(),
    "jump_chance": pl.Float64(),
    "nis": pl.Float64(),
    "degrees": pl.Int64(),
    "band_lo": pl.Float64(),
    "band_hi": pl.Float64(),
    "inside": pl.Boolean(),
    "used": pl.Boolean(),
}
"""A row per trajectory, mask, method, run and epoch after the beams return: step of the velocity estimate, standard
deviation claimed before it, greatest ratio of the two over the axes, probability of a ratio above three for a
consistent filter, and NIS with its band."""

RECOVERY_SUMMARY: Mapping[str, pl.DataType] = {
    "trajectory": pl.String(),
    "case": pl.String(),
    "beams": pl.String(),
    "method": pl.String(),
    "runs": pl.Int64(),
    "step_sigmas_max": pl.Float64(),
    "jumps": pl.Int64(),
    "jumps_allowed": pl.Int64(),
    **{f"nis_{epoch}": pl.Float64() for epoch in range(1, RECOVERY_EPOCHS + 1)},
    "degrees": pl.Int64(),
    "band_lo": pl.Float64(),
    "band_hi": pl.Float64(),
    "back_at_epoch": pl.Int64(),
    "rejected_fraction": pl.Float64(),
    "recovered": pl.Boolean(),
}
"""A row per trajectory, mask and method: runs with a step above three sigma and how many of them are to be expected
at most, mean NIS over runs at each epoch, its band, the epoch from which it stays in the band (null: not within
five), and whether both criteria hold."""

CONSISTENCY_CELL: Mapping[str, pl.DataType] = {
    "trajectory": pl.String(),
    "beams": pl.String(),
    "method": pl.String(),
    "quantity": pl.String(),
    "time_s": pl.Float64(),
    "degrees": pl.Float64(),
    "runs": pl.Int64(),
    "values": pl.Int64(),
    "mean": pl.Float64(),
}
"""A judged mean: over runs at one time, or over runs and fixes (`time_s` null)."""

CONSISTENCY_STUDY: Mapping[str, pl.DataType] = {
    "trajectory": pl.String(),
    "beams": pl.String(),
    "method": pl.String(),
    "quantity": pl.String(),
    "degrees": pl.Float64(),
    "runs": pl.Int64(),
    "values": pl.Int64(),
    "mean": pl.Float64(),
    "least": pl.Float64(),
    "greatest": pl.Float64(),
    "band_lo": pl.Float64(),
    "band_hi": pl.Float64(),
    "verdict": pl.String(),
}
"""A row per trajectory, mask, method and quantity: expected value, number of runs, independent values per judged
mean, mean over runs and times, the least and the greatest of the judged means, their band, and the verdict."""

QUANTITIES: Mapping[str, str] = {
    "nees_velocity_attitude": "NEES of velocity and attitude",
    "nees": "NEES of the whole state",
    "nis": "NIS of the DVL fixes",
}
"""The quantities of the consistency study, in words."""

PUBLISHED: Mapping[str, pl.DataType] = {
    "world": pl.String(),
    "method": pl.String(),
    "trajectory": pl.String(),
    "beams": pl.String(),
    **{quantity: pl.String() for quantity in QUANTITIES},
}
"""A row per cell of the published consistency studies: its verdicts, null for a quantity that it does not have."""

SENSOR_LAW: Mapping[str, pl.DataType] = {
    "trajectory": pl.String(),
    "beams": pl.String(),
    "current_mps": pl.Float64(),
    "sensors": pl.String(),
    "method": pl.String(),
    "runs": pl.Int64(),
    "velocity_median_mps": pl.Float64(),
    "velocity_rms_over_runs_mps": pl.Float64(),
    "velocity_greatest_mps": pl.Float64(),
    "median_rises_above": pl.String(),
    "run_rises_above": pl.String(),
    "nees_velocity_attitude_mean_over_runs_and_time": pl.Float64(),
    "verdict_velocity_attitude": pl.String(),
    "nees_mean_over_runs_and_time": pl.Float64(),
    "verdict_whole_state": pl.String(),
}
"""A row per trajectory, mask, current, set of sensors and method: norm of the velocity error at the last second, its
median, RMS and greatest value over runs;
the smaller sets of sensors above whose median it rises beyond chance, and above which a run's error does, separated
by ", "; mean NEES of velocity and attitude and of the whole state, with their verdicts."""
