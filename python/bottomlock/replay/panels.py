"""What a replay shows against time: states, errors with their standard deviations, NIS, innovations, current, beams."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import polars as pl
from scipy.stats import chi2

from bottomlock.figures.palette import FAINT, draw_order, stroke
from bottomlock.figures.series import BEAM_COLOURS, Curve, Floats, Panel, Times, valid_panel
from bottomlock.files.replay_tables import FORWARD
from bottomlock.own_method import DEAD_RECKONING
from bottomlock.statistics.replay import error_norms

REFERENCE_COLOUR, REJECTED_COLOUR, PITCH_COLOUR = "#8b949e", "#d6391f", "#f56803"
DASHED = (5.0, 2.0)
STATES = ("velocity", "position_sd", "depth", "attitude")
"""Quantities of `state_panels`."""


def times(rows: pl.DataFrame) -> Times:
    """(n,) of a table's rows."""
    return rows["time_ns"].to_numpy()


def floats(rows: pl.DataFrame, name: str) -> Floats:
    """(n,) of a column, NaN where a cell is empty."""
    return rows[name].fill_null(np.nan).to_numpy()


def plain(name: str) -> str:
    """A name in words."""
    return name.replace("_", " ")


def dash(method: str) -> tuple[float, ...]:
    """Dead reckoning alone is dashed: beside it stands one method."""
    return (6.0, 3.0) if method == DEAD_RECKONING else ()


def state_panels(samples: pl.DataFrame, method: str, which: str = FORWARD) -> dict[str, list[Panel]]:
    """Panels of a method in one case by quantity, over dead reckoning: velocity and depth with ±σ, σ of the position.

    Args:
        samples: `files.replay_tables.REPLAY_SAMPLES` of one what-if case.
        method, which: method and pass.
    """
    rows = samples.filter((pl.col("method") == method) & (pl.col("pass") == which))
    floor = (
        samples.filter(pl.col("method") == DEAD_RECKONING) if method != DEAD_RECKONING else samples.clear()
    )

    def over_reckoning(name: str, sd: str = "") -> list[Curve]:
        under = [_curve(floor, DEAD_RECKONING, name)] if floor.height else []
        return [*under, _curve(rows, method, name, sd)]

    claimed = [
        Curve(f"σ, {plain(name)}", stroke(name).colour, times(of), _norm(of, "sd_position"), None, dash(name))
        for name, of in ((DEAD_RECKONING, floor), (method, rows))
        if of.height
    ]
    error = _norm(rows, "err_position")
    if np.isfinite(error).any():
        claimed.append(Curve("error", REFERENCE_COLOUR, times(rows), error, width=2.0))
    levels = [
        Curve("roll", stroke(method).colour, times(rows), floats(rows, "roll_deg")),
        Curve("pitch", PITCH_COLOUR, times(rows), floats(rows, "pitch_deg"), dash=DASHED),
    ]
    return {
        "velocity": [
            Panel(f"{axis}, m/s", over_reckoning(f"{axis}_mps", f"sd_velocity_{axis}_mps"), decimals=3)
            for axis in ("surge", "sway", "heave")
        ],
        "position_sd": [Panel("σ of position, horizontal, m", claimed)],
        "depth": [
            Panel("depth below the origin, m", over_reckoning("down_m", "sd_position_down_m"), downwards=True)
        ],
        "attitude": [
            Panel("roll and pitch, °", levels),
            Panel("heading, °", _unwrapped(over_reckoning("yaw_deg")), period=360.0),
        ],
    }


def _curve(rows: pl.DataFrame, method: str, name: str, sd: str = "") -> Curve:
    claimed = floats(rows, sd) if sd else None
    return Curve(plain(method), stroke(method).colour, times(rows), floats(rows, name), claimed, dash(method))


def _unwrapped(curves: Sequence[Curve]) -> list[Curve]:
    """Angles in degrees that go on where they go around, all from the same turn."""
    going = [np.unwrap(curve.value, period=360.0) for curve in curves]
    first = going[-1][:1]
    turns = [360.0 * np.round((first - value[:1]) / 360.0) for value in going]
    return [
        replace(curve, value=value + turn) for curve, value, turn in zip(curves, going, turns, strict=True)
    ]


def _norm(rows: pl.DataFrame, name: str) -> Floats:
    return np.hypot(floats(rows, f"{name}_north_m"), floats(rows, f"{name}_east_m"))


def beams_panel(pings: pl.DataFrame, case: str = "") -> Panel:
    """When each beam was valid, in one case; `case` is named where several panels stand together."""
    valid = pings.select(pl.col("^beam[0-9]+_valid$")).to_numpy().astype(bool)
    return valid_panel(times(pings), valid, title=f"beams valid, {plain(case)}" if case else "beams valid")


def current_panels(currents: pl.DataFrame | None, method: str) -> list[Panel]:
    """The current that a method estimates with ±σ; none where it estimates none."""
    rows = currents.filter(pl.col("method") == method) if currents is not None else None
    if rows is None or rows.is_empty():
        return []
    looks = {"north": (stroke(method).colour, ()), "east": (PITCH_COLOUR, DASHED)}
    curves = [
        Curve(axis, colour, times(rows), floats(rows, f"{axis}_mps"), floats(rows, f"sd_{axis}_mps"), strokes)
        for axis, (colour, strokes) in looks.items()
    ]
    return [Panel(f"current, {plain(method)}, m/s", curves, decimals=3)]


_QUANTITIES = (
    ("position", "m", "position, m"),
    ("velocity", "mps", "velocity, m/s"),
    ("attitude", "deg", "attitude, degrees"),
)


def error_panels(samples: pl.DataFrame, methods: Sequence[str], which: str = FORWARD) -> list[Panel]:
    """Errors against the reference, norms over axes; dotted the standard deviation of each filter.

    Args:
        samples: `files.replay_tables.REPLAY_SAMPLES` of one what-if case.
        methods: which to draw.
        which: pass.
    """
    rows = error_norms(samples).filter(pl.col("pass") == which)
    of = {method: rows.filter(pl.col("method") == method) for method in draw_order(list(methods))}
    panels = []
    for name, unit, title in _QUANTITIES:
        curves = []
        for method, one in of.items():
            error, sd = (floats(one, column) for column in (f"{name}_{unit}", f"{name}_sd_{unit}"))
            if np.isfinite(error).any():
                look = (stroke(method).colour, times(one))
                curves += [Curve("", *look, sd, dash=(0.9, 1.5), width=0.9), Curve(method, *look, error)]
        if curves:
            panels.append(Panel(title, curves, log=True, compared=True))
    return panels


def innovation_panels(innovations: pl.DataFrame, method: str) -> list[Panel]:
    """Innovations of the beams of one method over their ±2 sigma, a panel each; rejected pings in another colour."""
    rows = innovations.filter(pl.col("method") == method)
    beams = sum(name.endswith("_innovation_mps") for name in rows.columns)
    at, rejected = times(rows), (rows["status"] == "rejected").to_numpy()
    panels = []
    for k in range(beams):
        value, sd = (floats(rows, f"beam{k + 1}_innovation_{end}") for end in ("mps", "sd_mps"))
        curves = [Curve("±2σ", FAINT, at, np.where(np.isfinite(sd), 0.0, np.nan), 2.0 * sd, width=0.5)]
        for label, of, colour in (
            ("ping", ~rejected, BEAM_COLOURS[k % len(BEAM_COLOURS)]),
            ("rejected", rejected, REJECTED_COLOUR),
        ):
            there = of & np.isfinite(value)
            if there.any():
                curves.append(Curve(label, colour, at[there], value[there], kind="dots"))
        panels.append(Panel(f"innovation of beam {k + 1}, m/s", curves, decimals=3))
    return panels


WINDOW = 30
"""Pings over which NIS is averaged."""


def nis_panel(
    innovations: pl.DataFrame, methods: Sequence[str], least_ratio: float, *, compared: bool = True
) -> Panel:
    """NIS over its degrees of freedom, sliding mean over pings, with the 95 % band of that mean.

    The lower end of the band is of noise as claimed under heavy tails. A method with fewer fixes than two windows has
    no curve.

    Args:
        innovations: `files.replay_tables.innovations_schema` of one what-if case.
        methods: which to draw.
        least_ratio: what Gaussian noise as claimed leads to under the weights of heavy tails.
        compared: whether methods are compared; else the pings of one are drawn too.
    """
    curves, band = [], None
    for method in draw_order(list(methods)):
        rows = innovations.filter(
            (pl.col("method") == method) & pl.col("nis").is_not_null() & (pl.col("degrees") > 0)
        )
        if rows.height < 2 * WINDOW:
            continue
        at, ratio = times(rows), (rows["nis"] / rows["degrees"]).to_numpy()
        degrees = WINDOW * float(rows["degrees"].to_numpy().mean())
        low, high = chi2.ppf([0.025, 0.975], degrees) / degrees
        band = (least_ratio * float(low), float(high))
        if not compared:
            rejected = (rows["status"] == "rejected").to_numpy()
            curves += [
                Curve(label, colour, at[of], ratio[of], kind="dots")
                for label, colour, of in (
                    ("ping", REFERENCE_COLOUR, ~rejected), ("rejected", REJECTED_COLOUR, rejected)
                )
                if of.any()
            ]  # fmt: skip
        mean = np.convolve(ratio, np.full(WINDOW, 1.0 / WINDOW), mode="valid")
        label = method if compared else f"mean of {WINDOW} pings"
        curves.append(Curve(label, stroke(method).colour, at[WINDOW - 1 :], mean))
    title = "NIS over its degrees of freedom"
    if compared:
        title = f"NIS over its degrees, mean of {WINDOW} pings (band: consistent, 95 %)"
    return Panel(title, curves, decimals=3, log=True, band=band, compared=compared)
