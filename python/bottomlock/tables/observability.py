"""Tables of the observability analysis: column names, types, meanings."""

from collections.abc import Mapping

import polars as pl

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
"""A row per window, aiding set and model: the length of the window, the rank (null where undecided), the exact rank
where it is known, the rank that a paper prints, the ratio between the least kept and the greatest dropped singular
value, and the unobservable directions in words."""

MANOEUVRE_RANKING: Mapping[str, pl.DataType] = {
    "manoeuvre": pl.String(),
    "aiding": pl.String(),
    "state": pl.String(),
    "verdict": pl.String(),
    "sd_before": pl.Float64(),
    "sd_after": pl.Float64(),
    "fraction_left": pl.Float64(),
}
"""A row per manoeuvre and state: whether the manoeuvre alone makes the state observable ("observable", "unobservable",
"undecided"), and the standard deviation that a filter claims before and after it, SI units; `fraction_left` is their
ratio."""
