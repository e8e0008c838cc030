"""Tunes a case: estimated on the first part of its recording, judged on the rest (docs/tune.md)."""

import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import polars as pl

from bottomlock.errors import DataError, ScenarioError
from bottomlock.own_method import known_names
from bottomlock.recordings.streams import Floats
from bottomlock.replay.case import Case, load_case
from bottomlock.replay.tune.criterion import (
    TERM,
    WORST,
    Candidate,
    Criterion,
    Found,
    block_sums,
    search,
    uncertainty,
    white_residuals,
)
from bottomlock.replay.tune.parameters import PRIOR_SD, Parameter, coordinates_of
from bottomlock.replay.tune.passes import (
    LEFT_OUT,
    LOST_S,
    MEASURED,
    METHODS,
    RECOVERY_S,
    Group,
    Inputs,
    cut,
    horizons_of,
    passes_of,
    read_recording,
    without_outliers,
)
from bottomlock.text import did_you_mean

SUM_S = 30.0
"""Span of the sums of innovations that are tested for whiteness."""


@dataclass(frozen=True)
class Term:
    """A sensor and a horizon: innovations, mean score a row, and error over claimed σ."""

    sensor: str
    horizon_s: float
    count: int
    score: float
    error_over_sd: float


@dataclass(frozen=True)
class Judged:
    """What the held-out part says of a candidate.

    Attributes:
        terms: by sensor and horizon.
        autocorrelation: of neighbouring whitened innovations of the beams; 0 if they are white.
        sums: mean square of their normalised sums over `SUM_S`; 1 if they are white.
        left_out: error over claimed σ of a beam that was left out for up to a minute; NaN without a beam to spare.
    """

    terms: tuple[Term, ...]
    autocorrelation: float
    sums: float
    left_out: float


START_FACTORS = (1.0, 5.0, 25.0, 0.2)
"""Factors on the inertial noise of the case from which the search may start; the best of them does."""
DETERMINED = 0.5
"""Part of the prior's 1 sigma below which a parameter counts as determined by the recording."""
GAIN_SIGMAS = 2.0
"""Gain on the rest, in its 1 sigma, from which on new values are better by more than chance."""


@dataclass(frozen=True)
class TunedParameter:
    """A setting that was tuned.

    Attributes:
        key, words: its place in the case, and what it is.
        old: its value in the case; 0 where it has none.
        value: the new one; the old one where the recording does not determine it.
        sd: 1 sigma of the value.
        is_determined: whether the recording determines it.
        gain: of the log-likelihood on the part that it was estimated on, against the old value with the others as new.
    """

    key: str
    words: str
    old: float
    value: float
    sd: float
    is_determined: bool
    gain: float


@dataclass(frozen=True)
class Tuned:
    """What `tune_case` found.

    Attributes:
        case: as it was read.
        parameters: that were tuned.
        horizons_s: of the predictions, after the one step.
        fraction: of the recording that they were estimated on.
        methods: whose predictions were scored.
        outliers: beams left out of the comparison, and all of them.
        old, new: what the rest of the recording says of old and new values; None where the filter failed.
        gain, gain_sd: of the composite log-likelihood there.
        has_settled: whether the search came to its end.
        iterations, passes, wall_s: what it took.
    """

    case: Case
    parameters: tuple[TunedParameter, ...]
    horizons_s: tuple[float, ...]
    fraction: float
    methods: tuple[str, ...]
    outliers: tuple[int, int]
    old: Judged | None
    new: Judged | None
    gain: float
    gain_sd: float
    has_settled: bool
    iterations: int
    passes: int
    wall_s: float

    @property
    def is_better(self) -> bool:
        """Whether the new values are better by more than chance on the part that they were not estimated on."""
        return self.gain > (GAIN_SIGMAS * self.gain_sd if np.isfinite(self.gain_sd) else 0.0)

    @property
    def values(self) -> dict[str, float]:
        """The new values by their keys; none where they are not better on the rest."""
        return {one.key: one.value for one in self.parameters if one.is_determined and self.is_better}


def tune_case(
    path: str | Path | Case,
    *,
    fraction: float = 0.5,
    methods: Sequence[str] = METHODS,
    threads: int = 0,
    progress: Callable[[int, int], None] = lambda *_: None,
) -> Tuned:
    """Tunes a case by the likelihood of its recording; the result does not depend on the threads.

    Args:
        path: the case's file, or a case.
        fraction: of the recording, from its start, that is estimated on; the rest judges.
        methods: whose predictions are scored, of `MEASURED`.
        threads: their number, 0 for one per core.
        progress: called after each iteration with its number and that of the passes over the recording.

    Raises:
        ScenarioError: for a case that is not valid or has beams made from a velocity, a fraction outside 0.2 to 0.8,
            and methods that predict no measurement.
        DataError: as `read_streams`, for a recording that is too short, and where the filter fails with every noise.
    """
    if not 0.2 <= fraction <= 0.8:
        raise ScenarioError(
            f"fraction is {fraction:g}", expected="0.2 to 0.8: the rest of the recording judges"
        )
    if not methods or len(set(methods)) < len(methods) or not set(methods) <= set(MEASURED):
        unknown = [one for one in methods if one not in known_names()]
        hint = (did_you_mean(unknown[0], MEASURED) if unknown else "") or ","
        raise ScenarioError(
            f"methods is {', '.join(methods) or 'empty'}{hint} expected some of {', '.join(MEASURED)}, each once: the "
            "others predict a velocity that they assume"
        )
    started = time.perf_counter()
    case = path if isinstance(path, Case) else load_case(path)
    if case.dvl.source != "beams":
        raise ScenarioError(
            f'is "{case.dvl.source}"', place=f"case {case.name}", key="dvl.source", expected='"beams"',
            hint="beams made from a velocity close exactly, so they show no noise of a beam",
        )  # fmt: skip
    given = read_recording(case)
    times = given.log["imu_time_ns"]
    split_ns = int(times[0] + fraction * (times[-1] - times[0]))
    part_s = (split_ns - int(times[0])) * 1e-9
    horizons = horizons_of(part_s)
    if not horizons:
        raise DataError(
            f"the first {fraction:.0%} of the recording last {part_s:.0f} s",
            expected="80 s or more to tune on",
        )
    recording = replace(given, log=without_outliers(given))
    block_s = horizons[-1] + RECOVERY_S
    with ThreadPoolExecutor(threads or os.cpu_count()) as executor:

        def criterion(
            inputs: Callable[[Floats], Inputs], prior: Floats, to_ns: int, from_ns: int
        ) -> Criterion:
            passes = passes_of(cut(recording.log, to_ns), horizons, recording.readings)
            return Criterion(
                recording.geometry, recording.start, passes, inputs, prior, executor, from_ns, tuple(methods)
            )

        def estimate(noise: Sequence[Parameter], starts: Sequence[Floats]) -> _Estimate:
            keys = [one.key for one in noise]
            own = criterion(
                lambda at: recording.inputs(dict(zip(keys, np.exp(at).tolist(), strict=True))),
                coordinates_of(noise), split_ns, 0,
            )  # fmt: skip
            return _Estimate(noise, own, search(own, starts, lambda k: progress(k, own.flown)), block_s)

        found = estimate(recording.noise, _starts(recording.noise))
        parameters, flown = found.parameters(DETERMINED * PRIOR_SD), found.criterion.flown
        kept = [k for k, one in enumerate(parameters) if one.is_determined]
        if 0 < len(kept) < len(parameters):
            # What the recording does not determine stays as it is, and the rest is found beside that.
            found = estimate([recording.noise[k] for k in kept], [found.found.best.at[kept]])
            for k, one in zip(kept, found.parameters(np.inf), strict=True):
                parameters[k] = one
            flown += found.criterion.flown
        both = [{}, {one.key: one.value for one in parameters if one.is_determined}]
        rest = criterion(lambda at: recording.inputs(both[int(at[0])]), np.zeros(1), int(times[-1]), split_ns)
        old, new = rest.candidates([np.array([place]) for place in (0.0, 1.0)])
    gain, gain_sd = gain_of(rest, old, new, block_s)
    valid = given.log["beam_valid"]
    return Tuned(
        case=case,
        parameters=tuple(parameters),
        horizons_s=horizons,
        fraction=fraction,
        methods=tuple(methods),
        outliers=(int((valid & ~recording.log["beam_valid"]).sum()), int(valid.sum())),
        old=judged(old, horizons),
        new=judged(new, horizons),
        gain=gain,
        gain_sd=gain_sd,
        has_settled=found.found.has_settled,
        iterations=found.found.iterations,
        passes=flown + rest.flown,
        wall_s=time.perf_counter() - started,
    )


@dataclass(frozen=True, eq=False)
class _Estimate:
    """Settings, the criterion of the part that they are estimated on, what was found, and the length of its blocks."""

    noise: Sequence[Parameter]
    criterion: Criterion
    found: Found
    block_s: float

    def parameters(self, most_sd: float) -> list[TunedParameter]:
        """What was found of each; beyond `most_sd` of its logarithm it keeps its value, with the sigma of its prior.

        A gain is that of the new value against the one that the search began with, with the others as new.
        """
        best = self.found.best
        before = np.tile(best.at, (len(self.noise), 1))
        np.fill_diagonal(before, self.criterion.prior)
        gains = [one.value - best.value for one in self.criterion.candidates(list(before))]
        sds = uncertainty(self.criterion, self.found, self.block_s).tolist()
        return [
            TunedParameter(one.key, one.words, one.old, value, sd * value, is_determined=True, gain=gain)
            if sd < most_sd else
            TunedParameter(one.key, one.words, one.old, one.old, one.start * PRIOR_SD, is_determined=False, gain=0.0)
            for one, value, sd, gain in zip(self.noise, np.exp(best.at).tolist(), sds, gains, strict=True)
        ]  # fmt: skip


def _starts(parameters: Sequence[Parameter]) -> list[Floats]:
    """Where the search may start: at the case's values, and at multiples of its inertial noise."""
    noise = [one for one in parameters if one.is_inertial_noise]
    return [
        coordinates_of(parameters, {one.key: one.start * factor for one in noise}) for factor in START_FACTORS
    ]


def judged(candidate: Candidate, horizons_s: Sequence[float]) -> Judged | None:
    """The judgement of a candidate; None where its filter ended in an error."""
    if candidate.scores is None:
        return None
    per_row = {name: pl.col(name).sum() / pl.col("rows").sum() for name in ("value", "nis")}
    table = candidate.scores.group_by(TERM).agg(pl.len(), per_row["value"], per_row["nis"].sqrt()).sort(TERM)
    terms = [
        Term(sensor, LOST_S if sensor == LEFT_OUT else (0.0, *horizons_s)[horizon], *numbers)
        for sensor, horizon, *numbers in table.iter_rows()
    ]
    steps = [group for group in candidate.groups if group.sensor == "beams" and not group.horizon.any()]
    whiteness = _whiteness(max(steps, key=lambda group: len(group.time_ns))) if steps else (np.nan, np.nan)
    left_out = next((term.error_over_sd for term in terms if term.sensor == LEFT_OUT), np.nan)
    return Judged(tuple(terms), *whiteness, left_out)


def _whiteness(group: Group) -> tuple[float, float]:
    """Correlation of neighbours, and the mean square of normalised sums over a span of time."""
    white = white_residuals(group)
    if len(white) < 3:
        return np.nan, np.nan
    neighbours = float((white[1:] * white[:-1]).mean() / (white**2).mean())
    block = ((group.time_ns - group.time_ns[0]) * 1e-9 // SUM_S).astype(np.intp)
    counts = np.bincount(block)
    sums = np.zeros((len(counts), white.shape[1]))
    np.add.at(sums, block, white)
    full = counts >= max(2, int(0.5 * np.median(counts)))
    return neighbours, float((sums[full] ** 2 / counts[full, None]).mean())


def gain_of(criterion: Criterion, old: Candidate, new: Candidate, block_s: float) -> tuple[float, float]:
    """Gain of the composite log-likelihood and its 1 sigma, from blocks of the recording.

    A filter that ended in an error has lost.
    """
    if old.scores is None or new.scores is None:
        return (WORST if old.scores is None else -WORST), 0.0
    gain = criterion.weights * (old.scores["value"] - new.scores["value"]).to_numpy()
    sums = block_sums(new.scores, gain, block_s)
    sd = float(np.sqrt(len(sums)) * sums.std(ddof=1)) if len(sums) > 1 else float("nan")
    return float(gain.sum()), sd
