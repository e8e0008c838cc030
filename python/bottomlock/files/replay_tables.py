"""Tables of a replay: column names, types, meanings."""

from dataclasses import dataclass, replace
from typing import Any

import polars as pl

from bottomlock.files.columns import Schema, errors_and_sd, schema

FORWARD, SMOOTHED = "forward", "smoothed"
RECORDED = "recorded"
"""Name of the what-if case that removes nothing."""

SIGMAS = (1, 2, 3)
"""Intervals whose coverage is counted, in claimed standard deviations."""

KEYS: Schema = schema("case what_if method: text")

REPLAY_RUNS: Schema = schema(
    KEYS,
    "pass: text",
    "position_final_m position_final_percent position_rms_over_time_m velocity_final_mps: float",
    "velocity_rms_over_time_mps attitude_final_deg attitude_rms_over_time_deg: float",
    "position_normalised_rms_over_time velocity_normalised_rms_over_time: float",
    "attitude_normalised_rms_over_time: float",
    {
        f"{name}_covered_{k}sigma": pl.Float64()
        for name in ("position", "velocity", "attitude")
        for k in SIGMAS
    },
    "distance_m beams_mean_over_pings nis_mean_over_fixes nis_degrees_mean_over_fixes: float",
    "fixes_accepted fixes_in_part fixes_rejected imu_rejected imu_gaps_inflated: int",
)
"""A row per what-if case, method and pass (forward or smoothed): norms of the errors against the reference,
null without one. `position_final_percent` is in percent of the distance travelled (% DT), `*_normalised_*` the RMS
over time and axes of error/σ, 1 for a consistent filter, `*_covered_*` the fraction of times and axes whose error is
within so many claimed σ: 0.683, 0.954 and 0.997 for a consistent filter. NIS and counts are those of the forward
pass. `imu_rejected` counts the inertial readings that the limits reject, `imu_gaps_inflated` the gaps between readings
that are bridged with inflation."""

CALIBRATION: Schema = schema(KEYS, "parameter unit: text", "value sd prior_sd: float")
"""A row per what-if case, method and parameter of the DVL, from the whole log: rotation from the stated mounting
about the platform's forward, right and down axes (deg), time to add to the stamps (s), scale (%). A parameter that the
motion does not show keeps `prior_sd`."""

CURRENTS: Schema = schema(KEYS, "time_ns: int", "north_mps east_mps sd_north_mps sd_east_mps: float")
"""A row per what-if case, method that estimates it and time: the current, and its claimed 1 sigma."""

IMU_FAULTS: Schema = schema(
    {name: dtype for name, dtype in KEYS.items() if name != "method"}, "imu_rejected imu_gaps_inflated: int"
)
"""A row per what-if case."""

REPLAY_SAMPLES: Schema = schema(
    KEYS,
    "pass: text",
    "time_ns: int",
    "north_m east_m down_m latitude_deg longitude_deg height_m: float",
    {f"{axis}_deg": pl.Float64() for axis in ("roll", "pitch", "yaw")},
    {f"{axis}_mps": pl.Float64() for axis in ("surge", "sway", "heave")},
    errors_and_sd(pl.Float64()),
)
"""A row per what-if case, method, pass and time: the estimate, its error (reference minus estimate, null
without a reference) and its claimed standard deviation. Latitude, longitude and height are null without an origin on
the Earth."""


def innovations_schema(beams: int) -> dict[str, pl.DataType]:
    """A row per what-if case, method and ping: its outcome, NIS, and the innovation of each beam that is used."""
    return schema(
        KEYS,
        "time_ns: int",
        "status: text",
        "nis: float",
        "degrees: int",
        {f"beam{k + 1}_innovation_mps": pl.Float64() for k in range(beams)},
        {f"beam{k + 1}_innovation_sd_mps": pl.Float64() for k in range(beams)},
    )


def pings_schema(beams: int) -> dict[str, pl.DataType]:
    """A row per what-if case and ping: the beams as the filters receive them."""
    return schema(
        {name: dtype for name, dtype in KEYS.items() if name != "method"},
        "time_ns: int",
        {f"beam{k + 1}_mps": pl.Float64() for k in range(beams)},
        {f"beam{k + 1}_valid": pl.Boolean() for k in range(beams)},
    )


PATH: Schema = schema("time_ns: int", "north_m east_m down_m latitude_deg longitude_deg: float")
"""A row per row of the reference: its position."""

SCORES: Schema = schema(
    "left_out method component: text",
    "pings solved: int",
    "error_median_mps error_rms_over_pings_mps error_p95_mps sd_median_mps normalised_rms_over_pings: float",
    "normalised_robust covered_1sigma covered_2sigma covered_3sigma: float",
)
"""A row per set of beams left out, method and component: pings, how many of them the method solves, and of those the
median, RMS and 95th percentile of the error, the median of its claimed standard deviation, error/σ: RMS and 1.4826 ×
median, and the fraction of errors within the intervals that a Gaussian covers with 68.3, 95.4 and 99.7 %: 1, 2 and 3
sigma, or their half-widths by the measured tail."""


@dataclass(frozen=True, eq=False)
class ReplayTables:
    """Tables and manifest of a replay; None for those that it does not have."""

    manifest: dict[str, Any]
    runs: pl.DataFrame
    samples: pl.DataFrame
    innovations: pl.DataFrame
    pings: pl.DataFrame
    path: pl.DataFrame | None = None
    calibration: pl.DataFrame | None = None
    currents: pl.DataFrame | None = None

    def of(self, what_if: str) -> "ReplayTables":
        """The rows of one what-if case; the path is that of all."""
        names = ("runs", "samples", "innovations", "pings", "calibration", "currents")
        tables = {name: table for name in names if (table := getattr(self, name)) is not None}
        return replace(self, **{name: table.filter(what_if=what_if) for name, table in tables.items()})
