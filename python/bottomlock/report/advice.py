"""What to use when, read off the tables: which methods may be believed, and which of those errs least."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import polars as pl

from bottomlock.tables.results import Errors, Study, locked_out

REFERENCES = {"ins": "no beam at all", "lc": "all beams, none lost"}
"""Methods that stand beside the comparison: what happens without help, and what four beams give."""

CLOSE = 1.05
"""Methods within 5 % of the best are called as good as it."""


@dataclass(frozen=True)
class Advice:
    """One trajectory: RMS of the velocity error at the end for each method, and what follows."""

    trajectory: str
    rms_mps: Mapping[str, float]
    attitude_rms_deg: Mapping[str, float]
    believable: tuple[str, ...]
    """Neither overconfident in velocity and attitude nor ever locked out, references left out; the best first."""
    overconfident: tuple[str, ...]
    """References left out; the smallest error first."""
    locked_out: Mapping[str, int]
    """Runs in which a method's own gate locks it out; the methods to which that happens."""

    @property
    def best(self) -> tuple[str, ...]:
        """The believable method of least error and those as good as it."""
        if not self.believable:
            return ()
        least = self.rms_mps[self.believable[0]]
        return tuple(method for method in self.believable if self.rms_mps[method] <= CLOSE * least)

    @property
    def attitude_range_deg(self) -> tuple[float, float]:
        """Least and greatest misalignment of the believable methods."""
        values = [self.attitude_rms_deg[method] for method in self.believable]
        return min(values), max(values)


@dataclass(frozen=True)
class Choice:
    """The method to take when the trajectory is not known beforehand."""

    believable: tuple[str, ...]
    """On every trajectory."""
    best: tuple[str, ...]
    worst_ratio: float
    """The greatest ratio of its error to that of the best believable method, over the trajectories."""
    worst_trajectory: str


def advise(study: Study, errors: Mapping[str, Errors]) -> list[Advice]:
    """What the tables say about each trajectory."""
    advice = []
    for name in study.trajectories:
        verdicts = study.consistency.filter(
            (pl.col("trajectory") == name) & (pl.col("quantity") == "nees_velocity_attitude")
        )
        verdict = dict(zip(verdicts["method"], verdicts["verdict"], strict=True))
        rms, attitude = (
            {method: float(np.sqrt(np.mean(norms[method][:, -1] ** 2))) for method in study.methods(name)}
            for norms in (errors[name].velocity_mps, errors[name].attitude_deg)
        )
        methods = sorted(
            (method for method in rms if method not in REFERENCES), key=lambda method: rms[method]
        )
        lost = {method: count for method in methods if (count := locked_out(study, name, method))}
        bad = tuple(method for method in methods if verdict[method] == "overconfident")
        advice.append(
            Advice(
                trajectory=name,
                rms_mps=rms,
                attitude_rms_deg=attitude,
                believable=tuple(method for method in methods if method not in bad and method not in lost),
                overconfident=bad,
                locked_out=lost,
            )
        )
    return advice


def warnings(advice: list[Advice]) -> dict[str, list[str]]:
    """For each method that is best somewhere: the trajectories on which it is not believable, where there are any."""
    found: dict[str, list[str]] = {}
    for method in dict.fromkeys(method for part in advice for method in part.best):
        if bad := [part.trajectory for part in advice if method not in part.believable]:
            found[method] = bad
    return found


def choose(advice: list[Advice]) -> Choice | None:
    """The method that is believable on every trajectory and never far from the best; None where there is none."""
    common = [method for method in advice[0].rms_mps if all(method in part.believable for part in advice)]
    if not common:
        return None
    ratios = {
        method: [part.rms_mps[method] / part.rms_mps[part.believable[0]] for part in advice]
        for method in common
    }
    least = min(max(of_method) for of_method in ratios.values())
    best = tuple(method for method in common if max(ratios[method]) <= CLOSE * least)
    worst = int(np.argmax(ratios[best[0]]))
    return Choice(tuple(common), best, ratios[best[0]][worst], advice[worst].trajectory)
