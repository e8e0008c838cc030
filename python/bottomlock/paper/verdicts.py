"""The paper's claims against a campaign: each verdict is computed from the tables, with its interval."""

from collections.abc import Mapping
from typing import Any

import polars as pl

from bottomlock.pages.pieces import number
from bottomlock.paper.claims import (
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
from bottomlock.paper.estimates import TrajectoryErrors, estimate
from bottomlock.paper.notes import NOT_REPRODUCED, NOT_TESTABLE, REPRODUCED, note
from bottomlock.statistics.run_errors import RunErrors
from bottomlock.tables.results import CampaignTables
from bottomlock.tables.studies import CLAIMS

LEAST_RUNS = 10
"""Fewer runs give no useful interval."""
GREATEST_SPAN = 2.0
"""An interval whose ends differ by a greater factor rests on a few runs: agreement with it shows nothing."""


def claims_table(campaign: CampaignTables, errors: Mapping[str, RunErrors], paper: Paper) -> pl.DataFrame:
    """A row per claim of the paper (`tables.studies.CLAIMS`), in the order of the claims.

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
