"""Which method to use, read off the tables: those that are consistent, and of those the ones of least error."""

from collections.abc import Mapping
from dataclasses import dataclass

import polars as pl

from bottomlock.statistics.campaign import runs_mostly_rejected
from bottomlock.statistics.chi_squared import OVERCONFIDENT
from bottomlock.statistics.run_errors import RunErrors
from bottomlock.tables.results import CampaignTables

REFERENCES = {"ins": "no beams", "lc": "all beams, none lost"}
"""Methods that bound the comparison and are not recommended."""

CLOSE = 1.05
"""Methods within 5 % of the best are named with it."""


@dataclass(frozen=True)
class Advice:
    """One trajectory: the error of each method at the end, and what follows from it.

    Attributes:
        trajectory: its name.
        velocity_rms_mps: RMS over runs of the velocity error at the end, by method.
        attitude_rms_deg: the same of the misalignment.
        consistent: methods that are not overconfident in velocity and attitude and whose gate rejects most fixes in
            no run; without references, the smallest error first.
        overconfident: without references, the smallest error first.
        mostly_rejected: number of runs in which the gate rejects more than half of the fixes, for the methods to which
            that happens.
    """

    trajectory: str
    velocity_rms_mps: Mapping[str, float]
    attitude_rms_deg: Mapping[str, float]
    consistent: tuple[str, ...]
    overconfident: tuple[str, ...]
    mostly_rejected: Mapping[str, int]

    @property
    def best(self) -> tuple[str, ...]:
        """The consistent method of least velocity error, and those within `CLOSE` of it."""
        if not self.consistent:
            return ()
        least = self.velocity_rms_mps[self.consistent[0]]
        return tuple(method for method in self.consistent if self.velocity_rms_mps[method] <= CLOSE * least)

    @property
    def attitude_range_deg(self) -> tuple[float, float]:
        """Least and greatest misalignment of the consistent methods."""
        values = [self.attitude_rms_deg[method] for method in self.consistent]
        return min(values), max(values)


@dataclass(frozen=True)
class Choice:
    """The method to take when the trajectory is not known beforehand.

    Attributes:
        consistent: methods that are consistent on every trajectory.
        best: those whose worst ratio is least.
        worst_ratio: greatest ratio over the trajectories of its error to that of the best consistent method there.
        worst_trajectory: where that is.
    """

    consistent: tuple[str, ...]
    best: tuple[str, ...]
    worst_ratio: float
    worst_trajectory: str


def advise(campaign: CampaignTables, errors: Mapping[str, RunErrors]) -> list[Advice]:
    """Recommendations for each trajectory from the tables; `errors` by its name."""
    return [_advise_on(campaign, name, errors[name]) for name in campaign.trajectories]


def _advise_on(campaign: CampaignTables, name: str, errors: RunErrors) -> Advice:
    verdicts = campaign.consistency.filter(
        (pl.col("trajectory") == name) & (pl.col("quantity") == "nees_velocity_attitude")
    )
    verdict = dict(zip(verdicts["method"], verdicts["verdict"], strict=True))
    velocity, attitude = (
        {method: errors.final_rms(quantity, method) for method in campaign.methods(name)}
        for quantity in ("velocity", "attitude")
    )
    methods = sorted((method for method in velocity if method not in REFERENCES), key=velocity.__getitem__)
    rejected = {}
    for method in methods:
        here = (pl.col("trajectory") == name) & (pl.col("method") == method)
        if count := runs_mostly_rejected(campaign.runs.filter(here)):
            rejected[method] = count
    overconfident = tuple(method for method in methods if verdict[method] == OVERCONFIDENT)
    return Advice(
        trajectory=name,
        velocity_rms_mps=velocity,
        attitude_rms_deg=attitude,
        consistent=tuple(m for m in methods if m not in overconfident and m not in rejected),
        overconfident=overconfident,
        mostly_rejected=rejected,
    )


def warnings(advice: list[Advice]) -> dict[str, list[str]]:
    """For each method that is best somewhere: the trajectories on which it is not consistent, where there are any."""
    found: dict[str, list[str]] = {}
    for method in dict.fromkeys(method for part in advice for method in part.best):
        if bad := [part.trajectory for part in advice if method not in part.consistent]:
            found[method] = bad
    return found


def choose(advice: list[Advice]) -> Choice | None:
    """The methods that are consistent on every trajectory and nowhere far from the best; None where there is none."""
    common = [m for m in advice[0].velocity_rms_mps if all(m in part.consistent for part in advice)]
    if not common:
        return None
    ratios = {
        method: [part.velocity_rms_mps[method] / part.velocity_rms_mps[part.consistent[0]] for part in advice]
        for method in common
    }
    least = min(max(of_method) for of_method in ratios.values())
    best = tuple(method for method in common if max(ratios[method]) <= CLOSE * least)
    worst_ratio = max(ratios[best[0]])
    return Choice(tuple(common), best, worst_ratio, advice[ratios[best[0]].index(worst_ratio)].trajectory)
