"""Tables of the observability analysis: column names, types, meanings."""

import polars as pl

from bottomlock.tables.schema import Schema, schema

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
