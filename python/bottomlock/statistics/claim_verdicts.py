"""The paper's claims against a campaign: each verdict is computed from the tables, with its interval."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import polars as pl

from bottomlock.files.campaign_tables import CampaignTables
from bottomlock.files.columns import CLAIMS
from bottomlock.statistics.campaign import runs_mostly_rejected
from bottomlock.statistics.chi_squared import OVERCONFIDENT
from bottomlock.statistics.claim_estimates import Estimate, TrajectoryErrors, estimate
from bottomlock.statistics.claims import (
    BiasClaim,
    CauseClaim,
    Claim,
    DriftClaim,
    ImprovementClaim,
    NotTestableError,
    OrderingClaim,
    Paper,
    ValueClaim,
)
from bottomlock.statistics.run_errors import RunErrors
from bottomlock.text import number

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


LEAST_RUNS = 10
"""Fewer runs give no useful interval."""
GREATEST_SPAN = 2.0
"""An interval whose ends differ by a greater factor rests on a few runs: agreement with it shows nothing."""


def claims_table(campaign: CampaignTables, errors: Mapping[str, RunErrors], paper: Paper) -> pl.DataFrame:
    """A row per claim of the paper (`files.columns.CLAIMS`), in the order of the claims.

    Args:
        campaign: its tables.
        errors: the errors run by run of each trajectory, by its name.
        paper: the claims, with the setup that they hold for.
    """
    trajectories = {name: TrajectoryErrors.of(campaign, name, of_one) for name, of_one in errors.items()}
    rows = [_row(claim, trajectories, paper) for claim in paper.claim]
    return pl.DataFrame(rows, schema=dict(CLAIMS), orient="row")


def _row(claim: Claim, trajectories: Mapping[str, TrajectoryErrors], paper: Paper) -> tuple[Any, ...]:
    printed = claim.printed if isinstance(claim, ValueClaim | ImprovementClaim) else None
    head = (claim.id, claim.trajectory, _quantity(claim), printed)
    try:
        for name in _trajectories(claim):
            _comparable(name, trajectories, paper)
        ours = estimate(claim, trajectories)
    except NotTestableError as reason:
        return (*head, None, None, None, NOT_TESTABLE, str(reason))
    low, high = ours.interval
    verdict = _verdict(claim, low, high)
    words = [note(claim, ours, verdict, trajectories[claim.trajectory])]
    if isinstance(claim, ImprovementClaim):
        words.append(_by_the_other_formula(claim, verdict, trajectories))
    return (*head, ours.ours, low, high, verdict, "; ".join(part for part in words if part))


def _by_the_other_formula(
    claim: ImprovementClaim, verdict: str, trajectories: Mapping[str, TrajectoryErrors]
) -> str:
    """The improvement and its verdict by the other of the two formulas, where the verdict depends on it.

    The paper writes "improvement" for both: 131 % can be no reduction, and the others exceed no reduction.
    """
    other = claim.model_copy(update={"formula": "excess" if claim.formula == "reduction" else "reduction"})
    theirs = estimate(other, trajectories)
    low, high = theirs.interval
    if (changed := _verdict(other, low, high)) == verdict:
        return ""
    return (
        f"by {other.words} it is {number(theirs.ours)} % ({number(low)} … {number(high)}) and {changed}: "
        "the verdict depends on the formula"
    )


def _trajectories(claim: Claim) -> list[str]:
    other = claim.than_trajectory if isinstance(claim, OrderingClaim | BiasClaim) else None
    return [claim.trajectory, *([] if other is None else [other])]


def _quantity(claim: Claim) -> str:
    """Name and unit of the number in the table."""
    match claim:
        case ValueClaim():
            names = {"velocity": "velocity_rms_over_runs_mps", "attitude": "attitude_rms_over_runs_deg"}
            return names.get(claim.quantity, claim.quantity)
        case ImprovementClaim():
            return f"{claim.quantity}_improvement_percent"
        case OrderingClaim():
            return f"{claim.quantity}_ratio"
        case DriftClaim():
            return f"{claim.quantity}_growth_ratio"
        case CauseClaim():
            return f"{claim.quantity}_growth_over_growth_without_ratio"
        case BiasClaim(pattern="more"):
            return "bias_ratio"
        case BiasClaim():
            return "bias_fraction_left"


def flown(campaign: CampaignTables, paper: Paper) -> list[str]:
    """The trajectories of a campaign that are the paper's, with its settings; the claims are about these alone."""
    return [
        name
        for name in campaign.trajectories
        if name in paper.trajectories and not _departure(campaign, name, paper)
    ]


def _departure(campaign: CampaignTables, name: str, paper: Paper) -> str:
    """The first setting that is not the paper's, in words; "" for none."""
    expected = {"trajectory.kind": paper.trajectories[name].kind, **paper.setup}
    for path, printed in expected.items():
        ours: Any = campaign.configuration(name)
        for key in path.split("."):
            ours = ours.get(key) if isinstance(ours, dict) else None
        if ours != printed:
            return f"{path} is {ours} here and {printed} in the paper"
    return ""


def _comparable(name: str, trajectories: Mapping[str, TrajectoryErrors], paper: Paper) -> None:
    """The campaign has this trajectory, with enough runs and the paper's settings."""
    if name not in trajectories:
        raise NotTestableError(f"the campaign has no trajectory {name}")
    departure = _departure(trajectories[name].campaign, name, paper)
    if departure:
        raise NotTestableError(departure)
    runs = trajectories[name].runs
    if runs < LEAST_RUNS:
        raise NotTestableError(f"{runs} runs give no useful interval; {LEAST_RUNS} or more do")


def _verdict(claim: Claim, low: float, high: float) -> str:
    match claim:
        case ValueClaim() | ImprovementClaim():
            good = low - claim.half_digit <= claim.printed <= high + claim.half_digit
            least, greatest = _as_ratios(claim, low, high)
            if good and greatest > GREATEST_SPAN * least:
                return NOT_TESTABLE
        case OrderingClaim(relation="better") | BiasClaim(pattern="observable" | "more"):
            if low <= 1.0 <= high:
                return NOT_TESTABLE
            good = high < 1.0
        case OrderingClaim():
            good = low <= 1.0 + claim.tolerance and high >= 1.0 / (1.0 + claim.tolerance)
        case CauseClaim():
            if low <= 1.0 + claim.tolerance < high:
                return NOT_TESTABLE
            good = low > 1.0 + claim.tolerance
        case BiasClaim():
            good = high >= 1.0 - claim.tolerance
        case DriftClaim(pattern="level"):
            good = low <= 1.0 + claim.tolerance
        case DriftClaim():
            good = low > 1.0
    return REPRODUCED if good else NOT_REPRODUCED


def _as_ratios(claim: ValueClaim | ImprovementClaim, low: float, high: float) -> tuple[float, float]:
    """The interval as one of errors, or of the ratio of errors behind a percentage."""
    if isinstance(claim, ValueClaim):
        return low, high
    if claim.formula == "excess":
        return 1.0 + 0.01 * low, 1.0 + 0.01 * high
    return 1.0 - 0.01 * high, 1.0 - 0.01 * low
