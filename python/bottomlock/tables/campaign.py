"""Tables of a campaign: column names, types, meanings."""

import polars as pl

from bottomlock.tables.schema import Schema, schema

BIASES = (*(f"accel_bias_{axis}_mps2" for axis in "xyz"), *(f"gyro_bias_{axis}_radps" for axis in "xyz"))
"""The biases of the IMU in the platform frame, in the kernel's order."""

_BIAS_COLUMNS: Schema = {f"{kind}_{bias}": pl.Float64() for kind in ("err", "sd") for bias in BIASES}

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

UNITS = {"position": "m", "misalignment": "rad", "velocity": "mps"}
"""Of the components, as columns name them."""


def errors_and_sd(kind: pl.DataType) -> Schema:
    """Columns of the error of every component, and of its claimed standard deviation."""
    return {
        f"{what}_{component}_{UNITS[component.split('_')[0]]}": kind
        for what in ("err", "sd")
        for component in COMPONENTS
    }


SAMPLES: Schema = schema(
    "trajectory: text",
    "run: int",
    "method: text",
    "time_ns: int",
    errors_and_sd(pl.Float32()),
    "nees nees_velocity_attitude: single",
)
"""A row per trajectory, run, method and second: error (true minus estimate) and claimed standard deviation.

Single precision, as much as errors are worth: in double a study of 500 runs takes three times the space."""

OUTCOMES: Schema = schema(
    "trajectory: text",
    "run: int",
    "method: text",
    "nis_mean_over_fixes: float",
    "fixes_accepted fixes_rejected fixes_beyond_linear_range: int",
    "cross_track_rms_over_time_m cross_track_max_m: float",
    _BIAS_COLUMNS,
)
"""A row per trajectory, run and method: fixes that the gate accepts and rejects with their mean NIS, those
before which the velocity was beyond the linear range (docs/linear_range.md), cross-track error of the true vehicle,
and errors of the IMU's biases at the last sample."""

RUNS: Schema = schema(
    "trajectory: text",
    "run: int",
    "method: text",
    "velocity_rms_over_time_mps attitude_rms_over_time_deg position_rms_over_time_m: float",
    "velocity_final_mps attitude_final_deg position_final_m nees_mean_over_time nis_mean_over_fixes: float",
    "fixes_accepted fixes_rejected fixes_beyond_linear_range: int",
    "cross_track_rms_over_time_m cross_track_max_m: float",
    _BIAS_COLUMNS,
)
"""A row per trajectory, run and method: norms of the error vectors, RMS over time and at the last sample; mean NEES
over time and mean NIS over fixes, null without fixes. The cross-track error is that of the true vehicle, null for an
analytic truth. Errors of the biases (true minus estimate) and their claimed standard deviations are those of the
last sample."""

ENSEMBLE: Schema = schema(
    "trajectory method: text",
    "time_s velocity_rms_over_runs_mps velocity_rms_over_runs_lo_mps velocity_rms_over_runs_hi_mps: float",
    "attitude_rms_over_runs_deg attitude_rms_over_runs_lo_deg attitude_rms_over_runs_hi_deg: float",
    "position_rms_over_runs_m nees_mean_over_runs: float",
)
"""A row per trajectory, method and second: norms of the error vectors, RMS over runs with 95 % bootstrap interval
(`_lo_`, `_hi_`), and mean NEES of the whole state over runs."""

CONSISTENCY_MEANS: Schema = schema(
    "trajectory method quantity: text", "degrees runs times: int", "mean least greatest: float"
)
"""A row per trajectory, method and kind of NEES: mean over runs and all times; the number of times at which the mean
over runs is judged, and the least and the greatest of these means. All three are null where a method has no NEES."""

CONSISTENCY: Schema = schema(CONSISTENCY_MEANS, "band_lo band_hi: float", "verdict: text")
"""The same with the chi-squared band of each judged mean and the verdict (`statistics.chi_squared.verdict`); all judged
means of a campaign are one family with a false-alarm rate of 1 %."""

PATHS: Schema = schema("trajectory: text", "time_ns: int", "north_m east_m depth_m: float")
"""A row per trajectory and time: true position of the vehicle, tangent frame."""

CHOICES: Schema = schema(
    "trajectory method: text", "time_ns: int", "component source: text", "runs_chosen: int"
)
"""A row per trajectory, method (`elc`), ping, component and source: number of runs in which the source is chosen."""
