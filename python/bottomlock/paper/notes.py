"""Explanations, from the tables, of claims that are not reproduced."""

import numpy as np
import polars as pl

from bottomlock.pages.pieces import number
from bottomlock.paper.claims import CauseClaim, Claim, ImprovementClaim, ValueClaim
from bottomlock.paper.estimates import Estimate, TrajectoryErrors
from bottomlock.statistics.campaign import runs_mostly_rejected
from bottomlock.statistics.chi_squared import OVERCONFIDENT

REPRODUCED, NOT_REPRODUCED, NOT_TESTABLE = "reproduced", "not reproduced", "not testable"

WORTH_SAYING = 0.02
"""Fraction of rejected fixes above which a note states it."""

_UNPRINTED = {"vb": ("virtual_beam_factor", "n_f"), "nsv": ("nullified_sway_var_m2ps2", "ε")}
"""Settings of methods that the paper does not print: key in [filter], and symbol."""


def note(claim: Claim, estimate: Estimate, verdict: str, trajectory: TrajectoryErrors) -> str:
    """One line: the worst method, how far off the printed number is, what the gate and the NEES say."""
    parts, methods = [], claim.methods
    if estimate.worst is not None:
        names = list(dict.fromkeys(estimate.worst))
        methods = [name for name in names if name in claim.methods]
        parts.append(f"worst is {' / '.join(names)}")
    if isinstance(claim, CauseClaim):
        parts.append(_both_growths(claim, trajectory))
    if verdict == REPRODUCED:
        return "; ".join(parts)
    if isinstance(claim, ValueClaim | ImprovementClaim):
        parts.extend(_distance(claim, estimate, verdict, trajectory))
    elif verdict == NOT_TESTABLE and not isinstance(claim, CauseClaim):
        parts.append(f"{trajectory.runs} runs do not separate the two")
    for method in methods:
        parts.extend(_gate_and_nees(trajectory, method))
        parts.extend(_own_setting(trajectory, method))
    if claim.quantity == "attitude":
        method = methods[0]
        whole, heading = (trajectory.errors.final_rms(name, method) for name in ("attitude", "heading"))
        parts.append(
            f"{heading:.2f}° of the {whole:.2f}° of {method} is heading, which no velocity makes observable"
        )
    return "; ".join(part for part in parts if part)


def _both_growths(claim: CauseClaim, trajectory: TrajectoryErrors) -> str:
    """The errors behind a ratio of growths, with the cause and without it."""
    words = []
    for one, cause in ((trajectory, "with"), (trajectory.without(claim.without), "without")):
        start, end = (one.at(claim.quantity, claim.method, time_s).ours for time_s in claim.window_s)
        words.append(f"{cause} the {claim.without} from {number(start)} to {number(end)} m/s")
    return ", ".join(words)


def _distance(
    claim: ValueClaim | ImprovementClaim, estimate: Estimate, verdict: str, trajectory: TrajectoryErrors
) -> list[str]:
    """How far off the printed number is, and how few runs would scatter so far; the paper gives no number of runs."""
    runs = trajectory.runs
    if isinstance(claim, ValueClaim):
        words = [f"ours is {estimate.ours / claim.printed:.3g} times the printed value"]
    else:
        unit = " m/s" if claim.quantity == "velocity" else "°"
        last = {m: trajectory.at(claim.quantity, m, claim.time_s).ours for m in claim.methods}
        words = [", ".join(f"{method} is at {value:.3g}{unit}" for method, value in last.items())]
    if verdict == NOT_TESTABLE:
        squares = trajectory.errors.of(claim.quantity)[claim.method][:, trajectory.index(claim.time_s)] ** 2
        share = 100.0 * float(squares.max() / squares.sum())
        return [*words, f"one run of {runs} makes {share:.0f} % of the mean square; the interval rests on it"]
    of_one_run = float(np.var(estimate.draws)) * runs
    excess = ((claim.printed - estimate.ours) / 1.96) ** 2 - of_one_run / runs
    fewest = of_one_run / excess if excess > 0.0 else 0.0
    if fewest >= 2.0:
        words.append(f"an RMS over {fewest:.0f} runs or fewer scatters so far")
    return words


def _gate_and_nees(trajectory: TrajectoryErrors, method: str) -> list[str]:
    """Whether the gate rejects the fixes of a method, and whether the method is overconfident."""
    here = (pl.col("trajectory") == trajectory.trajectory) & (pl.col("method") == method)
    runs = trajectory.campaign.runs.filter(here)
    rejected, accepted = int(runs["fixes_rejected"].sum()), int(runs["fixes_accepted"].sum())
    words = []
    if count := runs_mostly_rejected(runs):
        words.append(f"the gate rejects most fixes of {method} in {count} of {runs.height} runs")
    elif rejected > WORTH_SAYING * (rejected + accepted):
        words.append(
            f"the gate rejects {100.0 * rejected / (rejected + accepted):.0f} % of the fixes of {method}"
        )
    nees = trajectory.campaign.consistency.filter(here & (pl.col("quantity") == "nees_velocity_attitude"))
    if nees.height and nees["verdict"][0] == OVERCONFIDENT:
        mean, degrees = number(nees["mean"][0]), nees["degrees"][0]
        words.append(f"the NEES of velocity and attitude of {method} is {mean}, expected {degrees}")
    return words


def _own_setting(trajectory: TrajectoryErrors, method: str) -> list[str]:
    """A setting of the method that the paper does not print, and our choice."""
    name, symbol = _UNPRINTED.get(method, ("", ""))
    value = trajectory.campaign.configuration(trajectory.trajectory).get("filter", {}).get(name)
    return [] if value is None else [f"{symbol} is {value:g} here, the paper prints none"]
