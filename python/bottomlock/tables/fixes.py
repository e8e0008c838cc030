"""The table of velocity fixes: column names, types, meanings."""

import polars as pl

_AXES = ("surge", "sway", "heave")

OUTLIER_TESTS = ("untested", "passed", "beam_rejected", "down_weighted")
"""Outcome of a ping's test for outliers: without redundant beams, passed, the outlier identified and rejected, or a
closure beyond its gate of which no beam could be identified as the cause."""


def fixes_schema(beams: int) -> dict[str, pl.DataType]:
    """A row per ping of an instrument with so many beams, as `kernel.VelocityFixes.to_frame` writes it.

    The velocity is that of the platform over ground in the platform frame, null where a component is not solved;
    `cov_*` are its covariances; `*_status` and `*_source` are names of `kernel.COMPONENT_STATUS` and
    `kernel.SOURCES`.
    """
    pairs = [(first, second) for k, first in enumerate(_AXES) for second in _AXES[k:]]
    return {
        "time_ns": pl.Int64(),
        "status": pl.String(),
        "rank": pl.UInt8(),
        **{f"{axis}_mps": pl.Float64() for axis in _AXES},
        **{f"{axis}_status": pl.String() for axis in _AXES},
        **{f"{axis}_source": pl.String() for axis in _AXES},
        **{f"cov_{first}_{second}_m2ps2": pl.Float64() for first, second in pairs},
        **{f"beam{k + 1}_used": pl.Boolean() for k in range(beams)},
    }


def robust_fixes_schema(beams: int) -> dict[str, pl.DataType]:
    """The columns of `fixes_schema`, and the noise and outlier test of each ping (`replay.robust_fix`).

    `beam_sd_factor` is the noise used over the claimed noise of the beams; the covariances contain it. The half-widths
    of the intervals that a Gaussian covers with 2 and 3 sigma (95.4 and 99.7 %) are in standard deviations of the fix.
    """
    return {
        **fixes_schema(beams),
        "outlier_test": pl.String(),
        "beam_sd_factor": pl.Float64(),
        "halfwidth_2sigma_over_sd": pl.Float64(),
        "halfwidth_3sigma_over_sd": pl.Float64(),
    }
