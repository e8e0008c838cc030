"""Tunes a case: estimated on the first part of its recording, judged on the rest (docs/tune.md)."""

import os
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Lock

import numpy as np

from bottomlock.errors import DataError, ScenarioError
from bottomlock.own_method import known_names
from bottomlock.recordings.streams import Flags, Floats
from bottomlock.replay.case import Case, load_case
from bottomlock.replay.tune.criterion import Criterion
from bottomlock.replay.tune.judge import Judged, gain_of, judged
from bottomlock.replay.tune.parameters import SLIP_EPOCHS, Parameter, coordinates_of
from bottomlock.replay.tune.passes import (
    MEASURED,
    METHODS,
    RECOVERY_S,
    SWAY_HORIZONS_S,
    SWAY_METHOD,
    Inputs,
    Pass,
    horizons_of,
    passes_of,
    passes_with_two_beams,
)
from bottomlock.replay.tune.recording import LOOSE, MARGIN_S, Recording, cut, read_recording, without_outliers
from bottomlock.replay.tune.search import Found, search
from bottomlock.replay.tune.uncertainty import uncertainty
from bottomlock.support.nearest import did_you_mean

START_FACTORS = (1.0, 5.0, 25.0, 0.2)
"""Factors on the inertial noise of the case from which the search may start; the best of them does."""
SLIP_FACTORS = (1.0, 0.2, 5.0)
"""Factors on the slip of the case from which its search may start."""
LOOSE_AFTER = 3.0
"""Factor on the noise that was found with which outliers are looked for again."""
NOISE, NOISE_AGAIN, CONSTANTS, SWAY = "noise", "noise again", "clock and mounting", "sway"
STEPS_S = 10.0
"""Blocks of the gradients where no outage is predicted: many steps each."""
_FIXED_SLIP = {SLIP_EPOCHS: 1e9}
"""The prior of the slip counts for so many pings while it is tuned: the filter's own estimate would stand in for it."""


@dataclass(frozen=True)
class TunedParameter:
    """A setting that was tuned.

    Attributes:
        key, words: its place in the case, and what it is.
        old: its value in the case.
        value: the new one; the old one where the recording does not determine it.
        sd: 1 sigma of the value.
        is_noise: whether it is positive, and 0 says that the case has none.
        is_determined: whether the recording determines it.
        gain: of the log-likelihood on the part that it was estimated on, against the old value with the others as new.
    """

    key: str
    words: str
    old: float
    value: float
    sd: float
    is_noise: bool
    is_determined: bool
    gain: float


@dataclass(frozen=True)
class Part:
    """What the rest of the recording says of settings that were tuned together.

    Attributes:
        name: of the stage.
        keys: of those that were determined.
        old, new: judgement without and with them; None where a filter failed.
        gain, gain_sd: of the composite log-likelihood.
    """

    name: str
    keys: tuple[str, ...]
    old: Judged | None
    new: Judged | None
    gain: float
    gain_sd: float

    @property
    def is_better(self) -> bool:
        """Whether the new values are better by more than chance."""
        return is_gain(self.gain, self.gain_sd)


def is_gain(gain: float, sd: float) -> bool:
    """Whether a gain is more than its 1 sigma, or than nothing where it has none."""
    return gain > (sd if np.isfinite(sd) else 0.0)


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
        parts: judgements: of all old and new values but the sway's first, then of clock and mounting by themselves, and
            of the sway; of those that were tuned.
        has_settled: whether the search came to its end.
        iterations, passes, wall_s: what it took.
    """

    case: Case
    parameters: tuple[TunedParameter, ...]
    horizons_s: tuple[float, ...]
    fraction: float
    methods: tuple[str, ...]
    outliers: tuple[int, int]
    parts: tuple[Part, ...]
    has_settled: bool
    iterations: int
    passes: int
    wall_s: float

    @property
    def whole(self) -> Part:
        """The judgement of old and new values."""
        return self.parts[0]

    @property
    def is_better(self) -> bool:
        """Whether the new values are better by more than chance on the part that they were not estimated on."""
        return self.whole.is_better

    @property
    def values(self) -> dict[str, float]:
        """The new values by their keys that are better on the rest."""
        keys = {
            key
            for part in self.parts
            if part.is_better and (part.name == SWAY or self.is_better)
            for key in part.keys
        }
        return {one.key: one.value for one in self.parameters if one.key in keys}


@dataclass(frozen=True)
class Progress:
    """How far a search has come.

    Attributes:
        stage: what is searched.
        iteration, passes: done.
    """

    stage: str = ""
    iteration: int = 0
    passes: int = 0


@dataclass(frozen=True)
class Estimate:
    """What a stage found, by key: new values, 1 sigma, those that are determined and their gains; and what it took."""

    values: dict[str, float]
    sds: dict[str, float]
    determined: tuple[str, ...]
    gains: dict[str, float]
    iterations: int
    has_settled: bool

    @property
    def new(self) -> dict[str, float]:
        """The values that the recording determines."""
        return {key: self.values[key] for key in self.determined}

    def refined(self, again: "Estimate") -> "Estimate":
        """The same with what a stage of the determined ones found."""
        return Estimate(
            self.values | again.values,
            self.sds | again.sds,
            again.determined,
            again.gains,
            self.iterations + again.iterations,
            self.has_settled and again.has_settled,
        )


def tune_case(
    path: str | Path | Case,
    *,
    fraction: float = 0.5,
    methods: Sequence[str] = METHODS,
    threads: int = 0,
    progress: Callable[[Progress], None] = lambda _: None,
) -> Tuned:
    """Tunes a case by the likelihood of its recording; the result does not depend on the threads.

    Args:
        path: the case's file, or a case.
        fraction: of the recording, from its start, that is estimated on; the rest judges.
        methods: whose predictions are scored, of `MEASURED`.
        threads: their number, 0 for one per core.
        progress: called after each pass over the recording, by its thread.

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
    recording = read_recording(case)
    times = recording.log["imu_time_ns"]
    split_ns = int(times[0] + fraction * (times[-1] - times[0]))
    part_s = (split_ns - int(times[0])) * 1e-9
    horizons = horizons_of(part_s)
    if not horizons:
        raise DataError(
            f"the first {fraction:.0%} of the recording last {part_s:.0f} s",
            expected="80 s or more to tune on",
        )
    executor = ThreadPoolExecutor(threads or os.cpu_count())
    try:
        session = Session(recording, split_ns, horizons, tuple(methods), executor, progress)
        return session.run(fraction, started)
    finally:
        executor.shutdown(cancel_futures=True)


class Session:
    """A search over a recording, and the judgement of what it found."""

    def __init__(
        self,
        recording: Recording,
        split_ns: int,
        horizons_s: tuple[float, ...],
        methods: tuple[str, ...],
        executor: ThreadPoolExecutor,
        progress: Callable[[Progress], None],
    ) -> None:
        self.recording, self.split_ns, self.horizons_s, self.methods = (
            recording,
            split_ns,
            horizons_s,
            methods,
        )
        self.executor, self.progress = executor, progress
        self.block_s = horizons_s[-1] + RECOVERY_S
        # Clocks move pings over the ends of the recording.
        self.margin_s = MARGIN_S if recording.constants else 0.0
        self.now, self.lock = Progress(), Lock()

    def run(self, fraction: float, started: float) -> Tuned:
        """Estimates on the first part, and judges on the rest."""
        given = self.recording
        recording = replace(given, log=without_outliers(given, {}, LOOSE))
        noise = self._estimate(NOISE, recording, given.noise, {}, self._starts())
        constants, parts = self.constants(recording, noise.new)
        accepted = constants.new if constants and parts[0].is_better else {}
        recording = replace(given, log=without_outliers(given, noise.new | accepted, LOOSE_AFTER))
        if noise.determined:
            # The settings that the recording does not determine stay as they are, and the others are found beside them.
            noise = noise.refined(
                self._estimate(
                    NOISE_AGAIN, recording, _kept(given.noise, noise), accepted, [noise.new], is_last=True
                )
            )
        new = noise.new | accepted
        parts.insert(0, self.judged(NOISE, recording, {}, new, noise.determined))
        sway, judgement = self.sway(recording, new if parts[0].is_better else {})
        estimates = [one for one in (noise, constants, sway) if one is not None]
        valid = given.log["beam_valid"]
        return Tuned(
            case=given.case,
            parameters=tuple(
                _tuned(one, estimate)
                for group, estimate in (
                    (given.noise, noise), (given.constants, constants), (given.sway, sway),
                )
                for one in group
            ),
            horizons_s=self.horizons_s,
            fraction=fraction,
            methods=self.methods,
            outliers=(int((valid & ~recording.log["beam_valid"]).sum()), int(valid.sum())),
            parts=(*parts, *judgement),
            has_settled=all(one.has_settled for one in estimates),
            iterations=sum(one.iterations for one in estimates),
            passes=self.now.passes,
            wall_s=time.perf_counter() - started,
        )  # fmt: skip

    def constants(
        self, recording: Recording, beside: Mapping[str, float]
    ) -> tuple[Estimate | None, list[Part]]:
        """Clock and mounting beside the noise that was found, and their judgement."""
        if not recording.constants:
            return None, []
        # The search may start where the fit of the motion has them.
        starts = [{}, recording.fitted_constants(self.split_ns)]
        found = self._estimate(CONSTANTS, recording, recording.constants, beside, starts)
        return found, [self.judged(CONSTANTS, recording, beside, dict(beside) | found.new, found.determined)]

    def sway(self, recording: Recording, beside: Mapping[str, float]) -> tuple[Estimate | None, list[Part]]:
        """The prior of the slip beside the rest, and its judgement; None where no whole pings judge two beams."""
        if not recording.sway or not self._passes(SWAY, recording, self.split_ns, 0):
            return None, []
        slip, old = recording.sway[0], dict(beside) | _FIXED_SLIP
        starts = [{slip.key: slip.start * factor} for factor in SLIP_FACTORS]
        found = self._estimate(SWAY, recording, recording.sway, old, starts)
        return found, [self.judged(SWAY, recording, old, old | found.new, found.determined)]

    def _starts(self) -> list[dict[str, float]]:
        """Noise from which the search may start: the case's, and multiples of the inertial part of it."""
        return [
            {one.key: one.start * factor for one in self.recording.noise if one.is_inertial_noise}
            for factor in START_FACTORS
        ]

    def _passes(self, stage: str, recording: Recording, to_ns: int, from_ns: int) -> list[Pass]:
        log = cut(recording.log, to_ns, self.margin_s)

        def readings(valid: Flags) -> dict[str, Floats]:
            return {
                key: values[: len(log["imu_time_ns"])] for key, values in recording.readings(valid).items()
            }

        if from_ns and stage == SWAY:
            passes = passes_with_two_beams(log, readings)
            scored = [one.scored_ns for one in passes if one.scored_ns is not None]
            return passes if all((times >= from_ns).any() for times in scored) else []
        if stage == SWAY:
            return [Pass(log, None, None, is_of_slip=True)] if passes_with_two_beams(log, readings) else []
        if stage == CONSTANTS and not from_ns:
            return passes_of(log, (), readings)
        return passes_of(log, self.horizons_s, readings)

    def _criterion(
        self,
        stage: str,
        recording: Recording,
        inputs: Callable[[Floats], Inputs],
        prior: tuple[Floats, Floats],
        *,
        from_ns: int = 0,
    ) -> Criterion:
        to_ns = int(recording.log["imu_time_ns"][-1]) if from_ns else self.split_ns
        passes = self._passes(stage, recording, to_ns, from_ns)
        methods = (SWAY_METHOD,) if stage == SWAY else self.methods
        criterion = Criterion(
            recording.geometry, recording.start, passes, inputs, *prior, self.executor, self._pass_done, from_ns,
            methods,
        )  # fmt: skip
        if not from_ns:
            # The one step has most of what is known of constants, which are the same at every horizon, and of the slip.
            criterion.is_central = stage == CONSTANTS
            criterion.are_alike = stage.startswith(NOISE)
        return criterion

    def _estimate(
        self,
        stage: str,
        recording: Recording,
        parameters: tuple[Parameter, ...],
        beside: Mapping[str, float],
        starts: Sequence[Mapping[str, float]],
        *,
        is_last: bool = False,
    ) -> Estimate:
        """A stage: parameters beside other values; the last one of them takes all for determined."""

        def values(at: Floats) -> dict[str, float]:
            return {one.key: one.value(float(x)) for one, x in zip(parameters, at, strict=True)}

        prior_sd = np.array([one.prior_sd for one in parameters])
        criterion = self._criterion(
            stage,
            recording,
            lambda at: recording.inputs(dict(beside) | values(at)),
            (coordinates_of(parameters), prior_sd),
        )
        criterion.steps = np.array([one.step for one in parameters])

        def note(iteration: int) -> None:
            with self.lock:
                self.now = replace(self.now, stage=stage, iteration=iteration)

        found = search(criterion, [coordinates_of(parameters, one) for one in starts], note)
        known = uncertainty(criterion, found, STEPS_S if criterion.is_central else self.block_s)
        kept = [
            one for one, is_known in zip(parameters, known.is_determined, strict=True) if is_known or is_last
        ]
        new = values(found.best.at)
        return Estimate(
            new,
            {one.key: one.sd(new[one.key], float(sd)) for one, sd in zip(parameters, known.sd, strict=True)},
            tuple(one.key for one in kept),
            {} if stage == NOISE else self._gains(criterion, found, parameters, kept),
            found.iterations,
            found.has_settled,
        )

    def _gains(
        self,
        criterion: Criterion,
        found: Found,
        parameters: tuple[Parameter, ...],
        kept: Sequence[Parameter],
    ) -> dict[str, float]:
        """Gain of each new value against the old one, with the others as new."""
        old = []
        for one in kept:
            at = found.best.at.copy()
            at[parameters.index(one)] = one.coordinate(one.start)
            old.append(at)
        candidates = criterion.candidates(old)
        return {one.key: its.value - found.best.value for one, its in zip(kept, candidates, strict=True)}

    def judged(
        self,
        stage: str,
        recording: Recording,
        old: Mapping[str, float],
        new: Mapping[str, float],
        keys: tuple[str, ...],
    ) -> Part:
        """Old and new values on the rest of the recording; of no new ones the gain is nothing."""
        inputs = [recording.inputs(values) for values in (old, new)]
        criterion = self._criterion(
            stage,
            recording,
            lambda at: inputs[int(at[0])],
            (np.zeros(1), np.full(1, np.inf)),
            from_ns=self.split_ns,
        )
        if not criterion.passes:
            return Part(stage, keys, None, None, 0.0, 0.0)
        first, second = (criterion.candidates([np.array([place])])[0] for place in (0.0, 1.0))
        horizons_s = SWAY_HORIZONS_S if stage == SWAY else self.horizons_s
        gain, gain_sd = gain_of(criterion, first, second, self.block_s)
        return Part(stage, keys, judged(first, horizons_s), judged(second, horizons_s), gain, gain_sd)

    def _pass_done(self) -> None:
        """Counts a pass; the threads of the passes call it."""
        with self.lock:
            self.now = replace(self.now, passes=self.now.passes + 1)
            self.progress(self.now)


def _kept(parameters: Sequence[Parameter], estimate: Estimate) -> tuple[Parameter, ...]:
    """The parameters that are determined."""
    return tuple(one for one in parameters if one.key in estimate.determined)


def _tuned(one: Parameter, estimate: Estimate | None) -> TunedParameter:
    """A setting as it was found; without an estimate it is not determined, and its sigma is that of its prior."""
    value, sd, is_determined, gain = one.old, one.sd(one.start, one.prior_sd), False, 0.0
    if estimate is not None:
        sd, is_determined = estimate.sds[one.key], one.key in estimate.determined
        value, gain = estimate.new.get(one.key, one.old), estimate.gains.get(one.key, 0.0)
    return TunedParameter(one.key, one.words, one.old, value, sd, one.unit is None, is_determined, gain)
