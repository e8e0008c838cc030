"""Tables of a replay: column names, types, meanings."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import polars as pl

FORWARD, SMOOTHED = "forward", "smoothed"
RECORDED = "recorded"
"""Name of the what-if case that removes nothing."""

SIGMAS = (1, 2, 3)
"""Intervals whose coverage is counted, in claimed standard deviations."""

KEYS: Mapping[str, pl.DataType] = {"case": pl.String(), "what_if": pl.String(), "method": pl.String()}

REPLAY_RUNS: Mapping[str, pl.DataType] = {
    **KEYS,
    "pass": pl.String(),
    "position_final_m": pl.Float64(),
    "position_final_percent": pl.Float64(),
    "position_rms_over_time_m": pl.Float64(),
    "velocity_final_mps": pl.Float64(),
    "velocity_rms_over_time_mps": pl.Float64(),
    "attitude_final_deg": pl.Float64(),
    "attitude_rms_over_time_deg": pl.Float64(),
    "position_normalised_rms_over_time": pl.Float64(),
    "velocity_normalised_rms_over_time": pl.Float64(),
    "attitude_normalised_rms_over_time": pl.Float64(),
    **{
        f"{name}_covered_{k}sigma": pl.Float64()
        for name in ("position", "velocity", "attitude")
        for k in SIGMAS
    },
    "distance_m": pl.Float64(),
    "beams_mean_over_pings": pl.Float64(),
    "nis_mean_over_fixes": pl.Float64(),
    "nis_degrees_mean_over_fixes": pl.Float64(),
    "fixes_accepted": pl.Int64(),
    "fixes_in_part": pl.Int64(),
    "fixes_rejected": pl.Int64(),
    "imu_rejected": pl.Int64(),
    "imu_gaps_inflated": pl.Int64(),
}
"""A row per what-if case, method and pass (forward or smoothed): norms of the errors against the reference,
null without one. `position_final_percent` is in percent of the distance travelled (% DT), `*_normalised_*` the RMS
over time and axes of error/σ, 1 for a consistent filter, `*_covered_*` the fraction of times and axes whose error is
within so many claimed σ: 0.683, 0.954 and 0.997 for a consistent filter. NIS and counts are those of the forward
pass. `imu_rejected` counts the inertial readings that the limits reject, `imu_gaps_inflated` the gaps between readings
that are bridged with inflation."""

CALIBRATION: Mapping[str, pl.DataType] = {
    **KEYS,
    "parameter": pl.String(),
    "unit": pl.String(),
    "value": pl.Float64(),
    "sd": pl.Float64(),
    "prior_sd": pl.Float64(),
}
"""A row per what-if case, method and parameter of the DVL, from the whole log: rotation from the stated mounting
about the platform's forward, right and down axes (deg), time to add to the stamps (s), scale (%). A parameter that the
motion does not show keeps `prior_sd`."""

CURRENTS: Mapping[str, pl.DataType] = {
    **KEYS,
    "time_ns": pl.Int64(),
    "north_mps": pl.Float64(),
    "east_mps": pl.Float64(),
    "sd_north_mps": pl.Float64(),
    "sd_east_mps": pl.Float64(),
}
"""A row per what-if case, method that estimates it and time: the current, and its claimed 1 sigma."""

IMU_FAULTS: Mapping[str, pl.DataType] = {
    **{name: dtype for name, dtype in KEYS.items() if name != "method"},
    "imu_rejected": pl.Int64(),
    "imu_gaps_inflated": pl.Int64(),
}
"""A row per what-if case."""

REPLAY_SAMPLES: Mapping[str, pl.DataType] = {
    **KEYS,
    "pass": pl.String(),
    "time_ns": pl.Int64(),
    "north_m": pl.Float64(),
    "east_m": pl.Float64(),
    "down_m": pl.Float64(),
    "latitude_deg": pl.Float64(),
    "longitude_deg": pl.Float64(),
    "height_m": pl.Float64(),
    **{f"{axis}_deg": pl.Float64() for axis in ("roll", "pitch", "yaw")},
    **{f"{axis}_mps": pl.Float64() for axis in ("surge", "sway", "heave")},
    **{f"err_position_{axis}_m": pl.Float64() for axis in ("north", "east", "down")},
    **{f"err_misalignment_{axis}_rad": pl.Float64() for axis in ("north", "east", "down")},
    **{f"err_velocity_{axis}_mps": pl.Float64() for axis in ("surge", "sway", "heave")},
    **{f"sd_position_{axis}_m": pl.Float64() for axis in ("north", "east", "down")},
    **{f"sd_misalignment_{axis}_rad": pl.Float64() for axis in ("north", "east", "down")},
    **{f"sd_velocity_{axis}_mps": pl.Float64() for axis in ("surge", "sway", "heave")},
}
"""A row per what-if case, method, pass and time: the estimate, its error (reference minus estimate, null
without a reference) and its claimed standard deviation. Latitude, longitude and height are null without an origin on
the Earth."""

REPLAY_COMPARISON: Mapping[str, pl.DataType] = {
    "what_if": pl.String(),
    "method": pl.String(),
    "pass": pl.String(),
    "quantity": pl.String(),
    "unit": pl.String(),
    "value": pl.Float64(),
    "other": pl.Float64(),
    "difference": pl.Float64(),
}
"""A row per what-if case, method, pass and quantity that two replays of one dive both have, and the difference of
the first replay to the other."""


def innovations_schema(beams: int) -> dict[str, pl.DataType]:
    """A row per what-if case, method and ping: its outcome, NIS, and the innovation of each beam that is used."""
    return {
        **KEYS,
        "time_ns": pl.Int64(),
        "status": pl.String(),
        "nis": pl.Float64(),
        "degrees": pl.Int64(),
        **{f"beam{k + 1}_innovation_mps": pl.Float64() for k in range(beams)},
        **{f"beam{k + 1}_innovation_sd_mps": pl.Float64() for k in range(beams)},
    }


def pings_schema(beams: int) -> dict[str, pl.DataType]:
    """A row per what-if case and ping: the beams as the filters receive them."""
    return {
        **{name: dtype for name, dtype in KEYS.items() if name != "method"},
        "time_ns": pl.Int64(),
        **{f"beam{k + 1}_mps": pl.Float64() for k in range(beams)},
        **{f"beam{k + 1}_valid": pl.Boolean() for k in range(beams)},
    }


PATH: Mapping[str, pl.DataType] = {
    "time_ns": pl.Int64(),
    "north_m": pl.Float64(),
    "east_m": pl.Float64(),
    "down_m": pl.Float64(),
    "latitude_deg": pl.Float64(),
    "longitude_deg": pl.Float64(),
}
"""A row per row of the reference: its position."""

SCORES: Mapping[str, pl.DataType] = {
    "left_out": pl.String(),
    "method": pl.String(),
    "component": pl.String(),
    "pings": pl.Int64(),
    "solved": pl.Int64(),
    "error_median_mps": pl.Float64(),
    "error_rms_over_pings_mps": pl.Float64(),
    "error_p95_mps": pl.Float64(),
    "sd_median_mps": pl.Float64(),
    "normalised_rms_over_pings": pl.Float64(),
    "normalised_robust": pl.Float64(),
    "covered_1sigma": pl.Float64(),
    "covered_2sigma": pl.Float64(),
    "covered_3sigma": pl.Float64(),
}
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
