"""What to use when, read off the tables: which arms may be believed, and which of those errs least."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import polars as pl

from bottomlock.tables.results import Errors, Study, locked_out

REFERENCES = {"ins": "no beam at all", "lc": "all beams, none lost"}
"""Arms that stand beside the comparison: what happens without help, and what four beams give."""

CLOSE = 1.05
"""Arms within 5 % of the best are called as good as it."""


@dataclass(frozen=True)
class Advice:
    """One trajectory: RMS of the velocity error at the end for each arm, and what follows."""

    trajectory: str
    rms_mps: Mapping[str, float]
    attitude_rms_deg: Mapping[str, float]
    believable: tuple[str, ...]
    """Neither overconfident in velocity and attitude nor ever locked out, references left out; the best first."""
    overconfident: tuple[str, ...]
    """References left out; the smallest error first."""
    locked_out: Mapping[str, int]
    """Runs in which an arm's own gate locks it out; the arms to which that happens."""

    @property
    def best(self) -> tuple[str, ...]:
        """The believable arm of least error and those as good as it."""
        if not self.believable:
            return ()
        least = self.rms_mps[self.believable[0]]
        return tuple(arm for arm in self.believable if self.rms_mps[arm] <= CLOSE * least)

    @property
    def attitude_range_deg(self) -> tuple[float, float]:
        """Least and greatest misalignment of the believable arms."""
        values = [self.attitude_rms_deg[arm] for arm in self.believable]
        return min(values), max(values)


@dataclass(frozen=True)
class Choice:
    """The arm to take when the trajectory is not known beforehand."""

    believable: tuple[str, ...]
    """On every trajectory."""
    best: tuple[str, ...]
    worst_ratio: float
    """The greatest ratio of its error to that of the best believable arm, over the trajectories."""
    worst_trajectory: str


def advise(study: Study, errors: Mapping[str, Errors]) -> list[Advice]:
    """What the tables say about each trajectory."""
    advice = []
    for name in study.trajectories:
        verdicts = study.consistency.filter(
            (pl.col("trajectory") == name) & (pl.col("quantity") == "nees_velocity_attitude")
        )
        verdict = dict(zip(verdicts["arm"], verdicts["verdict"], strict=True))
        rms, attitude = (
            {arm: float(np.sqrt(np.mean(norms[arm][:, -1] ** 2))) for arm in study.arms(name)}
            for norms in (errors[name].velocity_mps, errors[name].attitude_deg)
        )
        arms = sorted((arm for arm in rms if arm not in REFERENCES), key=lambda arm: rms[arm])
        lost = {arm: count for arm in arms if (count := locked_out(study, name, arm))}
        bad = tuple(arm for arm in arms if verdict[arm] == "overconfident")
        advice.append(
            Advice(
                trajectory=name,
                rms_mps=rms,
                attitude_rms_deg=attitude,
                believable=tuple(arm for arm in arms if arm not in bad and arm not in lost),
                overconfident=bad,
                locked_out=lost,
            )
        )
    return advice


def warnings(advice: list[Advice]) -> dict[str, list[str]]:
    """For each arm that is best somewhere: the trajectories on which it is not believable, where there are any."""
    found: dict[str, list[str]] = {}
    for arm in dict.fromkeys(arm for part in advice for arm in part.best):
        if bad := [part.trajectory for part in advice if arm not in part.believable]:
            found[arm] = bad
    return found


def choose(advice: list[Advice]) -> Choice | None:
    """The arm that is believable on every trajectory and never far from the best; None where there is none."""
    common = [arm for arm in advice[0].rms_mps if all(arm in part.believable for part in advice)]
    if not common:
        return None
    ratios = {
        arm: [part.rms_mps[arm] / part.rms_mps[part.believable[0]] for part in advice] for arm in common
    }
    least = min(max(of_arm) for of_arm in ratios.values())
    best = tuple(arm for arm in common if max(ratios[arm]) <= CLOSE * least)
    worst = int(np.argmax(ratios[best[0]]))
    return Choice(tuple(common), best, ratios[best[0]][worst], advice[worst].trajectory)
