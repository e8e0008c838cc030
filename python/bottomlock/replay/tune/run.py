"""Tunes a case: estimated on the first part of its recording, judged on the rest (docs/tune.md)."""

import os
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from bottomlock.errors import DataError, ScenarioError
from bottomlock.replay.case import Case, load_case
from bottomlock.replay.streams import Flags, Floats
from bottomlock.replay.tune.criterion import Candidate, Criterion
from bottomlock.replay.tune.judge import Judged, gain_of, judged
from bottomlock.replay.tune.parameters import FACTOR, Parameter, logs_of
from bottomlock.replay.tune.passes import RECOVERY_S, horizons_of, passes_of
from bottomlock.replay.tune.recording import LOOSE, Recording, cut, read_recording, without_outliers
from bottomlock.replay.tune.search import Found, search
from bottomlock.replay.tune.uncertainty import Uncertainty, uncertainty

START_FACTORS = (1.0, 5.0, 25.0, 0.2)
"""Factors on the inertial noise of the case from which the search may start; the best of them does."""
LOOSE_AFTER = 3.0
"""Factor on the noise that was found with which outliers are looked for again."""


@dataclass(frozen=True)
class TunedParameter:
    """A setting that was tuned.

    Attributes:
        key, words: its place in the case, and what it is.
        old: its value in the case.
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
        outliers: beams left out of the comparison, and all of them.
        old, new: judgement of the old and the new values on the rest of the recording; None where a filter failed.
        gain, gain_sd: of the composite log-likelihood there.
        has_settled: whether the search came to its end.
        iterations, passes, wall_s: what it took.
    """

    case: Case
    parameters: tuple[TunedParameter, ...]
    horizons_s: tuple[float, ...]
    fraction: float
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
        return self.gain > (self.gain_sd if np.isfinite(self.gain_sd) else 0.0)

    @property
    def values(self) -> dict[str, float]:
        """The new values by their keys; empty where they are not better."""
        if not self.is_better:
            return {}
        return {one.key: one.value for one in self.parameters if one.is_determined}


@dataclass(frozen=True)
class Progress:
    """How far a search has come: its iteration, passes done, and the settings so far."""

    iteration: int
    passes: int
    values: Mapping[str, float]


def tune_case(
    path: Path | Case,
    *,
    fraction: float = 0.5,
    threads: int = 0,
    progress: Callable[[Progress], None] = lambda _: None,
    resume: Mapping[str, float] | None = None,
) -> Tuned:
    """Tunes the noise of a case by the likelihood of its recording; the result does not depend on the threads.

    Args:
        path: the case's file, or a case.
        fraction: of the recording, from its start, that is estimated on; the rest judges.
        threads: their number, 0 for one per core.
        progress: called after each pass over the recording, by its thread.
        resume: settings by their keys from which the search may start as well, of an interrupted one.

    Raises:
        ScenarioError: for a case that is not valid, or a fraction outside 0.2 to 0.8.
        DataError: as `read_streams`, for a recording that is too short, and where the filter fails with every noise.
    """
    if not 0.2 <= fraction <= 0.8:
        raise ScenarioError(
            f"fraction is {fraction:g}, expected 0.2 to 0.8: the rest of the recording judges"
        )
    started = time.perf_counter()
    case = path if isinstance(path, Case) else load_case(path)
    recording = read_recording(case)
    times = recording.log["imu_time_ns"]
    split_ns = int(times[0] + fraction * (times[-1] - times[0]))
    part_s = (split_ns - int(times[0])) * 1e-9
    horizons = horizons_of(part_s)
    if not horizons:
        raise DataError(
            f"the first {fraction:.0%} of the recording last {part_s:.0f} s, expected 80 s or more to tune on"
        )
    with ThreadPoolExecutor(threads or os.cpu_count()) as executor:
        session = _Session(recording, split_ns, horizons, executor, progress)
        return session.run(fraction, started, resume or {})


class _Session:
    """A search over a recording, and the judgement of what it found."""

    def __init__(
        self,
        recording: Recording,
        split_ns: int,
        horizons_s: tuple[float, ...],
        executor: ThreadPoolExecutor,
        progress: Callable[[Progress], None],
    ) -> None:
        self.recording, self.split_ns, self.horizons_s = recording, split_ns, horizons_s
        self.executor, self.progress = executor, progress
        self.block_s = horizons_s[-1] + RECOVERY_S
        self.now, self.lock = Progress(0, 0, {}), Lock()

    def run(self, fraction: float, started: float, resume: Mapping[str, float]) -> Tuned:
        """Estimates on the first part, and judges on the rest."""
        first = self.recording.parameters
        recording, logs = self._without_outliers(self.recording, logs_of(list(first)), LOOSE)
        found, criterion, known = self._found(recording, self._starts(recording, resume))
        recording, _ = self._without_outliers(recording, found.best.logs, LOOSE_AFTER)
        iterations = found.iterations
        # The settings that the recording does not determine stay as they are, and the others are found beside them.
        kept = tuple(one for one, is_known in zip(first, known.is_determined, strict=True) if is_known)
        told = {one.key: sd for one, sd in zip(first, known.sd, strict=True)}
        if kept:
            logs = found.best.logs[known.is_determined]
            recording = replace(recording, parameters=kept)
            found, criterion, known = self._found(recording, [logs])
            iterations += found.iterations
            told |= {one.key: sd for one, sd in zip(kept, known.sd, strict=True)}
        new = recording.values(found.best.logs) if kept else {}
        gains = self._gains(criterion, found, kept) if kept else {}
        old_judged, new_judged, gain, gain_sd = self._judge(recording, new)
        valid = self.recording.log["beam_valid"]
        return Tuned(
            case=self.recording.case,
            parameters=tuple(
                TunedParameter(
                    one.key,
                    one.words,
                    one.start if one.is_given else 0.0,
                    new.get(one.key, one.start if one.is_given else 0.0),
                    new.get(one.key, one.start) * float(told[one.key]),
                    one.key in new,
                    gains.get(one.key, 0.0),
                )
                for one in first
            ),
            horizons_s=self.horizons_s,
            fraction=fraction,
            outliers=(int((valid & ~recording.log["beam_valid"]).sum()), int(valid.sum())),
            old=old_judged,
            new=new_judged,
            gain=gain,
            gain_sd=gain_sd,
            has_settled=found.has_settled,
            iterations=iterations,
            passes=self.now.passes,
            wall_s=time.perf_counter() - started,
        )

    def _without_outliers(
        self, recording: Recording, logs: Floats, looseness: float
    ) -> tuple[Recording, Floats]:
        return replace(recording, log=without_outliers(recording, logs, looseness)), logs

    def _starts(self, recording: Recording, resume: Mapping[str, float]) -> list[Floats]:
        """Places from which the search may start: the case's noise, and multiples of the inertial part of it."""
        own = logs_of(list(recording.parameters))
        is_noise = np.array([one.is_inertial_noise for one in recording.parameters])
        starts = [own + np.where(is_noise, np.log(factor), 0.0) for factor in START_FACTORS]
        if resume:
            starts.append(np.log([resume.get(one.key, one.start) for one in recording.parameters]))
        return starts

    def _criterion(self, recording: Recording, log: Mapping[str, Any], from_ns: int) -> Criterion:
        prior = logs_of(list(recording.parameters))

        def readings(valid: Flags) -> dict[str, Floats]:
            return {
                key: values[: len(log["imu_time_ns"])] for key, values in recording.readings(valid).items()
            }

        return Criterion(
            recording.geometry, recording.start, passes_of(log, self.horizons_s, readings), recording.inputs, prior,
            np.full(len(prior), np.log(FACTOR)), self.executor, self._pass_done, from_ns,
        )  # fmt: skip

    def _pass_done(self) -> None:
        """Counts a pass; the threads of the passes call it."""
        with self.lock:
            self.now = replace(self.now, passes=self.now.passes + 1)
            self.progress(self.now)

    def _found(self, recording: Recording, starts: list[Floats]) -> tuple[Found, Criterion, Uncertainty]:
        before = self.now.iteration

        def note(iteration: int, best: Candidate) -> None:
            with self.lock:
                self.now = replace(self.now, iteration=before + iteration, values=recording.values(best.logs))

        criterion = self._criterion(recording, cut(recording.log, self.split_ns), 0)
        found = search(criterion, starts, note)
        return found, criterion, uncertainty(criterion, found, self.block_s)

    def _gains(self, criterion: Criterion, found: Found, kept: tuple[Parameter, ...]) -> dict[str, float]:
        """Gain of each new value against the old one, with the others as new."""
        old = []
        for place, one in enumerate(kept):
            logs = found.best.logs.copy()
            logs[place] = np.log(one.start)
            old.append(logs)
        values = [one.value for one in criterion.candidates(old)]
        return {one.key: value - found.best.value for one, value in zip(kept, values, strict=True)}

    def _judge(
        self, recording: Recording, new: Mapping[str, float]
    ) -> tuple[Judged | None, Judged | None, float, float]:
        """Both judgements on the rest of the recording, and the gain there with its 1 sigma."""
        criterion = self._criterion(replace(recording, parameters=()), recording.log, self.split_ns)
        both = []
        for values in ({}, new):
            criterion.inputs = lambda _, values=values: recording.inputs_of(values)  # type: ignore[misc]
            candidate = criterion.candidates([np.zeros(0)])[0]
            both.append((candidate, judged(candidate, self.horizons_s)))
        (old, old_judged), (now, new_judged) = both
        return old_judged, new_judged, *gain_of(criterion, old, now, self.block_s)
