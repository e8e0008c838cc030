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
