"""The number behind each claim: from all runs of a campaign, and from each resample of them.

Whole runs are drawn, and the same runs for all methods of a trajectory, so that differences between methods stay
paired; trajectories have sensor errors of their own and are drawn independently.
"""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from bottomlock.files.campaign_tables import CampaignTables, read_campaign_tables
from bottomlock.statistics.claims import (
    BiasClaim,
    CauseClaim,
    Claim,
    DriftClaim,
    ImprovementClaim,
    NotTestableError,
    OrderingClaim,
    ValueClaim,
)
from bottomlock.statistics.rms import (
    INTERVAL_PERCENT,
    Array,
    bootstrap_weights,
    combined_rms,
    mean_square,
    rms,
)
from bottomlock.statistics.run_errors import RunErrors, read_run_errors

TURN_RATE_RADPS = np.deg2rad(2.0)
"""Above it the course changes by intent; the paper's turns are half circles in some 20 s."""


def turns_and_legs(campaign: CampaignTables, trajectory: str, time_s: Array) -> tuple[list[int], list[int]]:
    """Numbers of the samples in the turns and on the legs after the dive.

    The turns are those of the true path, or of the scenario's timetable where the truth is analytic.

    Args:
        campaign: its tables.
        trajectory: one of its trajectories.
        time_s: (times,) of the samples.

    Raises:
        NotTestableError: if turns and legs cannot be identified, with the reason.
    """
    settings = campaign.configuration(trajectory)["trajectory"]
    if any(settings.get(key) is None for key in ("dive_s", "leg_s", "turn_s")):
        raise NotTestableError("the scenario has no legs and turns")
    if campaign.paths is not None:
        path = campaign.paths.filter(pl.col("trajectory") == trajectory).sort("time_ns")
        if path.height > 2:
            return _after(time_s, _turning(path, time_s), settings["dive_s"])
    if settings.get("source") != "analytic":
        raise NotTestableError("the turns of the vehicle's path are not in the tables (no truth.parquet)")
    phase = np.mod(time_s - settings["dive_s"], settings["leg_s"] + settings["turn_s"])
    return _after(time_s, phase > settings["leg_s"], settings["dive_s"])


def _turning(path: pl.DataFrame, time_s: Array) -> NDArray[np.bool_]:
    """(times,) where the course of the path changes faster than `TURN_RATE_RADPS`."""
    clock = path["time_ns"].to_numpy() * 1e-9
    course = np.arctan2(
        np.gradient(path["east_m"].to_numpy(), clock), np.gradient(path["north_m"].to_numpy(), clock)
    )
    rate = np.abs(np.gradient(np.unwrap(course), clock))
    return np.asarray(np.interp(time_s, clock, rate) > TURN_RATE_RADPS)


def _after(time_s: Array, turning: NDArray[np.bool_], start_s: float) -> tuple[list[int], list[int]]:
    late = time_s > start_s
    turns, legs = np.flatnonzero(late & turning), np.flatnonzero(late & ~turning)
    if turns.size == 0 or legs.size == 0:
        raise NotTestableError("no turn, or no leg, after the dive")
    return turns.tolist(), legs.tolist()


UNAIDED = "ins"
"""The method whose error of a bias is the bias itself: nothing corrects it."""


@dataclass(frozen=True)
class Estimate:
    """A number from all runs, and the same from each resample of them.

    Attributes:
        ours: from all runs.
        draws: (resamples,).
        worst: of several methods, pairs of methods, or methods and biases: the worst, whose number this is.
    """

    ours: float
    draws: Array
    worst: tuple[str, ...] | None = None

    @property
    def interval(self) -> tuple[float, float]:
        """95 % bootstrap interval."""
        low, high = np.percentile(self.draws, INTERVAL_PERCENT)
        return float(low), float(high)

    def over(self, other: "Estimate") -> "Estimate":
        """The ratio to another estimate, resample by resample."""
        return Estimate(self.ours / other.ours, self.draws / other.draws)

    def to_percent_less(self) -> "Estimate":
        """A ratio as a reduction in percent."""
        return Estimate(100.0 * (1.0 - self.ours), 100.0 * (1.0 - self.draws))

    def to_percent_more(self) -> "Estimate":
        """A ratio as an excess in percent."""
        return Estimate(100.0 * (self.ours - 1.0), 100.0 * (self.draws - 1.0))


@dataclass(frozen=True)
class TrajectoryErrors:
    """One trajectory of a campaign with its errors.

    Attributes:
        campaign: its tables.
        trajectory: its name.
        errors: run by run.
        weights: (resamples, runs) how often each resample draws each run, as fractions of 1.
    """

    campaign: CampaignTables
    trajectory: str
    errors: RunErrors
    weights: Array

    @classmethod
    def of(cls, campaign: CampaignTables, trajectory: str, errors: RunErrors) -> "TrajectoryErrors":
        """With the resamples of this trajectory, which depend on its name and the number of runs."""
        weights = bootstrap_weights(errors.runs, zlib.crc32(trajectory.encode()))
        return cls(campaign, trajectory, errors, weights)

    @property
    def runs(self) -> int:
        """Number of runs."""
        return int(self.weights.shape[1])

    def rms(self, quantity: str, method: str, times: Sequence[int]) -> Estimate:
        """RMS over runs and over the samples `times` of "velocity" (m/s) or "attitude" (deg)."""
        matrix = self.errors.of(quantity)
        if method not in matrix:
            raise NotTestableError(f"the campaign does not run method {method}")
        return self._over_runs(mean_square(matrix[method][:, list(times)], axis=1))

    def at(self, quantity: str, method: str, time_s: float) -> Estimate:
        """RMS over runs at one time."""
        return self.rms(quantity, method, [self.index(time_s)])

    def bias_left(self, method: str, bias: str) -> Estimate:
        """RMS over runs of a method's error of a bias at the end, as a fraction of the bias itself."""
        estimates = []
        for name in (method, UNAIDED):
            here = (pl.col("trajectory") == self.trajectory) & (pl.col("method") == name)
            errors = self.campaign.runs.filter(here).sort("run")[f"err_{bias}"].to_numpy()
            if errors.size == 0:
                raise NotTestableError(f"the campaign does not run method {name}")
            estimates.append(self._over_runs(errors**2))
        return estimates[0].over(estimates[1])

    def index(self, time_s: float) -> int:
        """Number of the sample at a time."""
        found = np.flatnonzero(np.abs(self.errors.time_s - time_s) < 1e-6)
        if found.size == 0:
            raise NotTestableError(f"no sample at {time_s:g} s, the last is at {self.errors.time_s[-1]:g} s")
        return int(found[0])

    def growth(self, quantity: str, method: str, window_s: tuple[float, float]) -> Estimate:
        """RMS over runs at the end of a window over that at its start."""
        start, end = window_s
        return self.at(quantity, method, end).over(self.at(quantity, method, start))

    def without(self, cause: str) -> "TrajectoryErrors":
        """The same runs without a cause, from the campaign in the folder `without_CAUSE` of this one.

        Raises:
            DataError: for a damaged campaign there.
        """
        folder = self.campaign.folder / f"without_{cause}"
        if not folder.is_dir():
            raise NotTestableError(
                f"the directory has no runs without the {cause} ({folder.name}); `bottomlock reproduce` makes them"
            )
        other = read_campaign_tables(folder)
        ours, theirs = (one.manifest["scenarios"].get(self.trajectory, {}) for one in (self.campaign, other))
        if any(ours[key] != theirs.get(key) for key in ("seed", "runs")):
            raise NotTestableError(f"the runs of {self.trajectory} in {folder.name} are others than here")
        return TrajectoryErrors.of(other, self.trajectory, read_run_errors(other, self.trajectory))

    def _over_runs(self, mean_squares: Array) -> Estimate:
        return Estimate(float(combined_rms(mean_squares)), combined_rms(mean_squares, self.weights))


def estimate(claim: Claim, trajectories: Mapping[str, TrajectoryErrors]) -> Estimate:
    """The number that a claim is about.

    Raises:
        NotTestableError: for a method, time or turn that the tables do not hold.
    """
    here = trajectories[claim.trajectory]
    match claim:
        case ValueClaim():
            return here.at(claim.quantity, claim.method, claim.time_s)
        case ImprovementClaim():
            method = here.at(claim.quantity, claim.method, claim.time_s)
            reference = here.at(claim.quantity, claim.reference, claim.time_s)
            if claim.formula == "excess":
                return reference.over(method).to_percent_more()
            return method.over(reference).to_percent_less()
        case OrderingClaim():
            return _ordering(claim, here, trajectories[claim.than_trajectory or claim.trajectory])
        case DriftClaim(pattern="oscillating"):
            return _turns_over_legs(claim, here)
        case DriftClaim():
            return here.growth(claim.quantity, claim.method, claim.window_s or (0.0, 0.0))
        case CauseClaim():
            growth = here.growth(claim.quantity, claim.method, claim.window_s)
            return growth.over(
                here.without(claim.without).growth(claim.quantity, claim.method, claim.window_s)
            )
        case BiasClaim():
            return _biases(claim, here, trajectories[claim.than_trajectory or claim.trajectory])


def _turns_over_legs(claim: DriftClaim, here: TrajectoryErrors) -> Estimate:
    """RMS in the turns over RMS on the legs."""
    turns, legs = turns_and_legs(here.campaign, here.trajectory, here.errors.time_s)
    return here.rms(claim.quantity, claim.method, turns).over(here.rms(claim.quantity, claim.method, legs))


def _biases(claim: BiasClaim, here: TrajectoryErrors, there: TrajectoryErrors) -> Estimate:
    """The fraction left of the worst bias and method, or the worst ratio of two trajectories."""
    if claim.pattern == "more":
        return _worst(
            {
                (method,): _all_left(here, method, claim).over(_all_left(there, method, claim))
                for method in claim.methods
            }
        )
    left: dict[tuple[str, ...], Estimate] = {
        (method, bias): here.bias_left(method, bias) for method in claim.methods for bias in claim.biases
    }
    return _worst(left, least=claim.pattern == "unobservable")


def _all_left(trajectory: TrajectoryErrors, method: str, claim: BiasClaim) -> Estimate:
    """RMS over the biases of the fraction that is left of each."""
    left = [trajectory.bias_left(method, bias) for bias in claim.biases]
    return Estimate(float(rms([one.ours for one in left])), rms([one.draws for one in left], axis=0))


def _worst(ratios: Mapping[tuple[str, ...], Estimate], *, least: bool = False) -> Estimate:
    """The greatest of several, or the least, in each resample as well; named if there was a choice."""
    pick, best = (np.min, min) if least else (np.max, max)
    name = best(ratios, key=lambda key: ratios[key].ours)
    draws = pick(np.stack([ratio.draws for ratio in ratios.values()]), axis=0)
    return Estimate(ratios[name].ours, draws, name if len(ratios) > 1 else None)


def _ordering(claim: OrderingClaim, here: TrajectoryErrors, there: TrajectoryErrors) -> Estimate:
    """The worst ratio better / worse of all pairs; an equality has one pair."""
    ratios: dict[tuple[str, ...], Estimate] = {
        pair: here.at(claim.quantity, pair[0], claim.time_s).over(
            there.at(claim.quantity, pair[1], claim.time_s)
        )
        for pair in claim.pairs
    }
    return _worst(ratios)
