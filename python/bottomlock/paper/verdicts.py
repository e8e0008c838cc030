"""The paper's claims held against a campaign: each verdict is computed from the tables, with its interval.

Runs are drawn whole and the same runs for all methods of a trajectory, so that differences between methods stay paired;
trajectories have sensor errors of their own and are drawn independently.
"""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl

from bottomlock.paper.claims import (
    BiasClaim,
    Claim,
    DriftClaim,
    ImprovementClaim,
    OrderingClaim,
    Paper,
    ValueClaim,
)
from bottomlock.statistics.campaign import BOOTSTRAP_RESAMPLES, BOOTSTRAP_SEED
from bottomlock.tables.paper import CLAIMS
from bottomlock.tables.results import Array, Errors, Study, locked_out

REPRODUCED, NOT_REPRODUCED, NOT_TESTABLE = "reproduced", "not reproduced", "not testable"
LEAST_RUNS = 10
"""Fewer runs give no interval worth the name."""
GREATEST_SPAN = 2.0
"""An interval that spans a greater factor rests on a few runs; that a printed number meets it shows nothing."""
TURN_RATE_RADPS = np.deg2rad(2.0)
"""Above it the course changes by intent; the paper's turns are half circles in some 20 s."""

UNAIDED = "ins"
"""The method whose error of a bias is the bias itself: nothing corrects it."""

_UNPRINTED = {"vb": ("virtual_beam_factor", "n_f"), "nsv": ("nullified_sway_var_m2ps2", "ε")}


class _NotTestableError(Exception):
    """Why these tables cannot decide a claim."""


@dataclass(frozen=True)
class _Estimate:
    """A number from all runs, and the same from each resample of them."""

    ours: float
    draws: Array
    worst: tuple[str, ...] | None = None
    """Of several methods, pairs of methods, or methods and biases the worst, which the number is of."""

    @property
    def interval(self) -> tuple[float, float]:
        low, high = np.percentile(self.draws, [2.5, 97.5])
        return float(low), float(high)

    def over(self, other: "_Estimate") -> "_Estimate":
        return _Estimate(self.ours / other.ours, self.draws / other.draws)

    def to_percent_less(self) -> "_Estimate":
        return _Estimate(100.0 * (1.0 - self.ours), 100.0 * (1.0 - self.draws))

    def to_percent_more(self) -> "_Estimate":
        return _Estimate(100.0 * (self.ours - 1.0), 100.0 * (self.draws - 1.0))


@dataclass(frozen=True)
class _Flown:
    """One trajectory: its errors, and how often each resample draws each run (parts of 1)."""

    study: Study
    trajectory: str
    errors: Errors
    weights: Array

    def rms(self, quantity: str, method: str, times: Sequence[int]) -> _Estimate:
        """RMS over runs and over the times given."""
        matrix = self.errors.of(quantity)
        if method not in matrix:
            raise _NotTestableError(f"method {method} was not flown")
        squares = (matrix[method][:, list(times)] ** 2).mean(axis=1)
        return _Estimate(float(np.sqrt(squares.mean())), np.sqrt(self.weights @ squares))

    def at(self, quantity: str, method: str, time_s: float) -> _Estimate:
        return self.rms(quantity, method, [self.index(time_s)])

    def bias_left(self, method: str, bias: str) -> _Estimate:
        """RMS over runs of a method's error of a bias at the end, as a part of the bias itself."""
        rms = []
        for name in (method, UNAIDED):
            here = (pl.col("trajectory") == self.trajectory) & (pl.col("method") == name)
            squares = self.study.runs.filter(here).sort("run")[f"err_{bias}"].to_numpy() ** 2
            if squares.size == 0:
                raise _NotTestableError(f"method {name} was not flown")
            rms.append(_Estimate(float(np.sqrt(squares.mean())), np.sqrt(self.weights @ squares)))
        return rms[0].over(rms[1])

    def index(self, time_s: float) -> int:
        found = np.flatnonzero(np.abs(self.errors.time_s - time_s) < 1e-6)
        if found.size == 0:
            raise _NotTestableError(f"no sample at {time_s:g} s, the last is at {self.errors.time_s[-1]:g} s")
        return int(found[0])


def claims_table(study: Study, errors: Mapping[str, Errors], paper: Paper) -> pl.DataFrame:
    """A row per claim of the paper (`tables.paper.CLAIMS`), in the order of the claims.

    Args:
        study: the campaign's tables.
        errors: the errors run by run of each trajectory, by its name.
        paper: the claims, with the setup that they hold for.
    """
    flown = {
        name: _Flown(study, name, part, _weights(next(iter(part.nees.values())).shape[0], name))
        for name, part in errors.items()
    }
    rows = [_row(claim, flown, paper) for claim in paper.claim]
    return pl.DataFrame(rows, schema=dict(CLAIMS), orient="row")


def _weights(runs: int, trajectory: str) -> Array:
    generator = np.random.default_rng([BOOTSTRAP_SEED, zlib.crc32(trajectory.encode())])
    return generator.multinomial(runs, np.full(runs, 1.0 / runs), size=BOOTSTRAP_RESAMPLES) / runs


def _row(claim: Claim, flown: Mapping[str, _Flown], paper: Paper) -> tuple[Any, ...]:
    printed = claim.printed if isinstance(claim, ValueClaim | ImprovementClaim) else None
    head = (claim.id, claim.trajectory, _quantity(claim), printed)
    try:
        for name in _trajectories(claim):
            _comparable(name, flown, paper)
        estimate = _estimate(claim, flown)
    except _NotTestableError as reason:
        return (*head, None, None, None, NOT_TESTABLE, str(reason))
    low, high = estimate.interval
    verdict = _verdict(claim, low, high)
    return (
        *head,
        estimate.ours,
        low,
        high,
        verdict,
        _note(claim, estimate, verdict, flown[claim.trajectory]),
    )


def _trajectories(claim: Claim) -> list[str]:
    other = claim.than_trajectory if isinstance(claim, OrderingClaim | BiasClaim) else None
    return [claim.trajectory, *([] if other is None else [other])]


def _quantity(claim: Claim) -> str:
    """Name and unit of the number in the table."""
    match claim:
        case ValueClaim():
            return {"velocity": "velocity_rms_mps", "attitude": "attitude_rms_deg"}.get(
                claim.quantity, claim.quantity
            )
        case ImprovementClaim():
            return f"{claim.quantity}_improvement_percent"
        case OrderingClaim():
            return f"{claim.quantity}_ratio"
        case DriftClaim():
            return f"{claim.quantity}_growth_ratio"
        case BiasClaim(pattern="more"):
            return "bias_ratio"
        case BiasClaim():
            return "bias_part_left"


def _comparable(name: str, flown: Mapping[str, _Flown], paper: Paper) -> None:
    """The campaign flew this trajectory, often enough, with the paper's settings."""
    if name not in flown:
        raise _NotTestableError(f"trajectory {name} was not flown")
    configuration = flown[name].study.configuration(name)
    expected = {"trajectory.kind": paper.trajectories[name].kind, **paper.setup}
    for path, printed in expected.items():
        ours: Any = configuration
        for key in path.split("."):
            ours = ours.get(key) if isinstance(ours, dict) else None
        if ours != printed:
            raise _NotTestableError(f"{path} is {ours} here and {printed} in the paper")
    runs = flown[name].weights.shape[1]
    if runs < LEAST_RUNS:
        raise _NotTestableError(f"{runs} runs give no interval, {LEAST_RUNS} or more do")


def _estimate(claim: Claim, flown: Mapping[str, _Flown]) -> _Estimate:
    here = flown[claim.trajectory]
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
            return _ordering(claim, here, flown[claim.than_trajectory or claim.trajectory])
        case DriftClaim(pattern="oscillating"):
            turns, legs = _turns_and_legs(here)
            return here.rms(claim.quantity, claim.method, turns).over(
                here.rms(claim.quantity, claim.method, legs)
            )
        case DriftClaim():
            start, end = claim.window_s or (0.0, 0.0)
            return here.at(claim.quantity, claim.method, end).over(
                here.at(claim.quantity, claim.method, start)
            )
        case BiasClaim(pattern="more"):
            there = flown[claim.than_trajectory or claim.trajectory]
            return _worst(
                {
                    (method,): _all_left(here, method, claim).over(_all_left(there, method, claim))
                    for method in claim.methods
                }
            )
        case BiasClaim():
            left: dict[tuple[str, ...], _Estimate] = {
                (method, bias): here.bias_left(method, bias)
                for method in claim.methods
                for bias in claim.biases
            }
            return _worst(left, least=claim.pattern == "hidden")


def _all_left(flown: _Flown, method: str, claim: BiasClaim) -> _Estimate:
    """Root of the mean squared part that is left of each bias."""
    parts = [flown.bias_left(method, bias) for bias in claim.biases]
    return _Estimate(
        float(np.sqrt(np.mean([part.ours**2 for part in parts]))),
        np.sqrt(np.mean([part.draws**2 for part in parts], axis=0)),
    )


def _worst(ratios: Mapping[tuple[str, ...], _Estimate], *, least: bool = False) -> _Estimate:
    """The greatest of several, or the least, in each resample as well; named if there was a choice."""
    pick, best = (np.min, min) if least else (np.max, max)
    name = best(ratios, key=lambda key: ratios[key].ours)
    draws = pick(np.stack([ratio.draws for ratio in ratios.values()]), axis=0)
    return _Estimate(ratios[name].ours, draws, name if len(ratios) > 1 else None)


def _ordering(claim: OrderingClaim, here: _Flown, there: _Flown) -> _Estimate:
    """The worst ratio better / worse of all pairs; an equality has one pair."""
    ratios: dict[tuple[str, ...], _Estimate] = {
        pair: here.at(claim.quantity, pair[0], claim.time_s).over(
            there.at(claim.quantity, pair[1], claim.time_s)
        )
        for pair in claim.pairs
    }
    return _worst(ratios)


def _turns_and_legs(flown: _Flown) -> tuple[list[int], list[int]]:
    """Samples in the turns and on the legs after the dive, from the true path or from the scenario's timetable."""
    settings = flown.study.configuration(flown.trajectory)["trajectory"]
    time_s = flown.errors.time_s
    if any(settings.get(key) is None for key in ("dive_s", "leg_s", "turn_s")):
        raise _NotTestableError("the scenario has no legs and turns")
    paths = flown.study.paths
    if paths is not None:
        path = paths.filter(pl.col("trajectory") == flown.trajectory).sort("time_ns")
        if path.height > 2:
            clock = path["time_ns"].to_numpy() * 1e-9
            course = np.arctan2(
                np.gradient(path["east_m"].to_numpy(), clock), np.gradient(path["north_m"].to_numpy(), clock)
            )
            rate = np.abs(np.gradient(np.unwrap(course), clock))
            turning = np.interp(time_s, clock, rate) > TURN_RATE_RADPS
            return _after(time_s, turning, settings["dive_s"])
    if settings.get("source") != "analytic":
        raise _NotTestableError("the turns of the vehicle's path are not in the tables (no truth.parquet)")
    phase = np.mod(time_s - settings["dive_s"], settings["leg_s"] + settings["turn_s"])
    return _after(time_s, phase > settings["leg_s"], settings["dive_s"])


def _after(time_s: Array, turning: Any, start_s: float) -> tuple[list[int], list[int]]:  # noqa: ANN401 - a mask
    late = time_s > start_s
    turns, legs = np.flatnonzero(late & turning), np.flatnonzero(late & ~turning)
    if turns.size == 0 or legs.size == 0:
        raise _NotTestableError("no turn, or no leg, after the dive")
    return turns.tolist(), legs.tolist()


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


def _note(claim: Claim, estimate: _Estimate, verdict: str, flown: _Flown) -> str:
    """What the tables say about a claim that they do not bear out."""
    parts, methods = [], claim.methods
    if estimate.worst is not None:
        names = list(dict.fromkeys(estimate.worst))
        methods = [name for name in names if name in claim.methods]
        parts.append(f"worst is {' / '.join(names)}")
    if verdict == REPRODUCED:
        return "; ".join(parts)
    runs = flown.weights.shape[1]
    if isinstance(claim, ValueClaim | ImprovementClaim):
        parts.extend(_distance(claim, estimate, verdict, flown))
    elif verdict == NOT_TESTABLE:
        parts.append(f"{runs} runs do not tell the two apart")
    for method in methods:
        parts.extend(_gate_and_nees(flown, method))
        parts.extend(_own_setting(flown, method))
    if claim.quantity == "attitude":
        method = methods[0]
        whole, heading = (
            np.sqrt(np.mean(matrix[method][:, -1] ** 2))
            for matrix in (flown.errors.attitude_deg, flown.errors.heading_deg)
        )
        parts.append(f"{heading:.2f}° of {method}'s {whole:.2f}° is heading, which no velocity shows")
    return "; ".join(part for part in parts if part)


def _distance(
    claim: ValueClaim | ImprovementClaim, estimate: _Estimate, verdict: str, flown: _Flown
) -> list[str]:
    """How far off the printed number is, and how few runs would scatter so far; the paper gives no number of runs."""
    runs = flown.weights.shape[1]
    if isinstance(claim, ValueClaim):
        words = [f"ours is {estimate.ours / claim.printed:.3g} times the printed"]
    else:
        unit = " m/s" if claim.quantity == "velocity" else "°"
        last = {method: flown.at(claim.quantity, method, claim.time_s).ours for method in claim.methods}
        words = [", ".join(f"{method} is at {value:.3g}{unit}" for method, value in last.items())]
    if verdict == NOT_TESTABLE:
        squares = flown.errors.of(claim.quantity)[claim.method][:, flown.index(claim.time_s)] ** 2
        share = 100.0 * float(squares.max() / squares.sum())
        return [*words, f"one run of {runs} makes {share:.0f} % of the mean square, the interval rests on it"]
    of_one_run = float(np.var(estimate.draws)) * runs
    excess = ((claim.printed - estimate.ours) / 1.96) ** 2 - of_one_run / runs
    fewest = of_one_run / excess if excess > 0.0 else 0.0
    if fewest >= 2.0:
        words.append(f"means of {fewest:.0f} runs or fewer scatter so far")
    return words


def _gate_and_nees(flown: _Flown, method: str) -> list[str]:
    """Whether a method loses its fixes to its own gate, and whether it is overconfident."""
    here = (pl.col("trajectory") == flown.trajectory) & (pl.col("method") == method)
    runs = flown.study.runs.filter(here)
    rejected, accepted = int(runs["fixes_rejected"].sum()), int(runs["fixes_accepted"].sum())
    words = []
    if lost := locked_out(flown.study, flown.trajectory, method):
        words.append(f"{method}'s gate locks it out in {lost} of {runs.height} runs")
    elif rejected > 0.02 * (rejected + accepted):
        words.append(f"{method}'s gate rejects {100.0 * rejected / (rejected + accepted):.0f} % of its fixes")
    honesty = flown.study.consistency.filter(here & (pl.col("quantity") == "nees_velocity_attitude"))
    if honesty.height and honesty["verdict"][0] == "overconfident":
        mean, degrees = _rounded(honesty["mean"][0]), honesty["degrees"][0]
        words.append(f"{method}'s NEES of velocity and attitude is {mean}, honest is {degrees}")
    return words


def _own_setting(flown: _Flown, method: str) -> list[str]:
    """What we had to choose for a method, since the paper does not print it."""
    name, symbol = _UNPRINTED.get(method, ("", ""))
    value = flown.study.configuration(flown.trajectory).get("filter", {}).get(name)
    return [] if value is None else [f"{symbol} is {value:g} here, the paper prints none"]


def _rounded(value: float) -> str:
    """Three significant digits, thousands apart.

    >>> _rounded(11.04), _rounded(1_734_211.0)
    ('11', '1 730 000')
    """
    return f"{float(f'{value:.3g}'):,.15g}".replace(",", " ")
