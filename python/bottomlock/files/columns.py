"""The tables that pass between the rooms and go to disk: column names, types, meanings; a table held against them."""

from collections.abc import Mapping

import polars as pl

from bottomlock.errors import bad_column

Schema = Mapping[str, pl.DataType]

_TYPES: Schema = {
    "text": pl.String(), "int": pl.Int64(), "float": pl.Float64(), "single": pl.Float32(), "flag": pl.Boolean(),
}  # fmt: skip


def schema(*parts: str | Schema) -> dict[str, pl.DataType]:
    """Columns in their order: names of one type, which stands behind a colon, or columns that are made already.

    >>> schema("run: int", "north_m east_m: float", {"beams": pl.List(pl.Int64())})
    {'run': Int64, 'north_m': Float64, 'east_m': Float64, 'beams': List(Int64)}
    """
    columns: dict[str, pl.DataType] = {}
    for part in parts:
        if isinstance(part, str):
            names, kind = part.split(":")
            columns |= dict.fromkeys(names.split(), _TYPES[kind.strip()])
        else:
            columns |= part
    return columns


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
            raise bad_column(place, name, "is missing", ", ".join(columns))
        if frame.schema[name] != dtype:
            raise bad_column(place, name, f"is {frame.schema[name]}", dtype)
    extra = [name for name in frame.columns if name not in columns]
    if extra:
        raise bad_column(place, extra[0], "is unknown", ", ".join(columns))
    return frame.select(list(columns))


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

COMPARISON: Schema = schema(
    "campaign trajectory method quantity unit: text",
    "runs: int",
    "value lo hi: float",
    "reference: text",
    "paired: flag",
    "difference difference_lo difference_hi: float",
)
"""A row per campaign, trajectory, method and quantity: the value over the runs with its 95 % interval, and its
difference to the same of the reference campaign with its own; null for the reference, and where it has no such row."""

SWEEP: Schema = schema(
    "parameter value trajectory method: text",
    "velocity_rms_over_runs_mps attitude_rms_over_runs_deg nees_mean_over_runs_and_time: float",
    "rejected_fraction: float",
)
"""A row per value of a swept setting, trajectory and method: norms of the error vectors at the last second, RMS over
runs; mean NEES of the whole state; fraction of the fixes that the gate rejects, null without fixes."""

VIRTUAL_BEAM_FACTOR = "n_f of VB"
"""The swept factor of `vb` that the paper does not print, in `parameter`."""

CURRENT = "current to the east, m/s"
"""The swept setting in `parameter` that no method without a current as a state holds."""

STUDY: Schema = schema(
    "trajectory beams sensors method: text",
    "runs: int",
    "velocity_rms_over_runs_mps velocity_rms_over_runs_lo_mps velocity_rms_over_runs_hi_mps: float",
    "velocity_greatest_mps attitude_rms_over_runs_deg attitude_rms_over_runs_lo_deg: float",
    "attitude_rms_over_runs_hi_deg position_rms_over_runs_m: float",
    {
        f"{quantity}{end}": pl.Float64()
        for quantity in ("nees_velocity_attitude", "nees")
        for end in ("", "_least", "_greatest", "_lo", "_hi")
    },
    "nis rejected_fraction: float",
    "verdict_velocity_attitude verdict_whole_state verdict: text",
)
"""A row per cell of a study. Errors at the last second, RMS over runs with 95 % bootstrap interval (`_lo_`, `_hi_`),
and the greatest velocity error of a run. Mean NEES over runs and time, the least and the greatest mean over runs at the
judged times, and the band of these means (`_lo`, `_hi`). Mean NIS over runs and fixes, and the fraction of the fixes
that the gate rejects, both null without fixes. The verdict is "overconfident" where either NEES is, else that of
velocity and attitude."""

PUBLISHED: Schema = schema("world method trajectory beams verdict_velocity_attitude verdict: text")
"""A row per cell of the published studies, as `STUDY` has it."""

CLAIMS: Schema = schema("claim trajectory quantity: text", "paper ours lo hi: float", "verdict note: text")
"""A row per claim of the paper: the printed number (null where it prints an ordering), ours with its 95 % bootstrap
interval (null where it cannot be tested), the verdict and what was measured about it."""

FINDINGS: Schema = schema(
    "rank: int",
    "kind severity: text",
    {"beams": pl.List(pl.Int64())},
    "size sd: float",
    "unit: text",
    "fraction: float",
    "text evidence hint place expected: text",
)
"""A row per finding of an audit, the gravest first."""

OBSERVABILITY: Schema = schema(
    "case aiding mask motion model: text",
    "window_s: float",
    "states rank expected_rank printed_rank: int",
    "gap: float",
    "verdict: text",
    {"unobservable": pl.List(pl.String())},
    {"singular_values": pl.List(pl.Float64())},
)
"""A row per window, aiding set and model: the length of the window, the rank (null where undecided), the exact rank
where it is known, the rank that a paper prints, the ratio between the least kept and the greatest dropped singular
value, and the unobservable directions in words."""

MANOEUVRE_RANKING: Schema = schema(
    "manoeuvre aiding state verdict: text", "sd_before sd_after fraction_left: float"
)
"""A row per manoeuvre and state: whether the manoeuvre alone makes the state observable ("observable", "unobservable",
"undecided"), and the standard deviation that a filter claims before and after it, SI units; `fraction_left` is their
ratio."""
