"""Tunes a case: estimated on the first part of its recording, judged on the rest (docs/tune.md)."""

import hashlib
import os
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from bottomlock import kernel
from bottomlock.config.toml_edit import edited
from bottomlock.config.toml_file import read_text
from bottomlock.errors import DataError, OutputError, ScenarioError
from bottomlock.files.atomic_write import plain, write_text
from bottomlock.files.overwriting import check_apart, check_free
from bottomlock.files.records import write_record
from bottomlock.files.versions import library_versions
from bottomlock.io.beams import geometry_text
from bottomlock.replay.case import Case, load_case, parse_case
from bottomlock.replay.run import file_digests
from bottomlock.replay.tune.criterion import (
    FAILED,
    SETTLED,
    TERM,
    Criterion,
    Innovations,
    Progress,
    block_sums,
)
from bottomlock.replay.tune.parameters import INERTIAL_NOISE, PRIOR_SD, Parameter
from bottomlock.replay.tune.passes import RECOVERY_S, Pass, Recording, horizons_of

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

    @classmethod
    def of(cls, one: Parameter, value: float, log_sd: float, gain: float) -> "TunedParameter":
        """What was found of a parameter: nothing where its logarithm is not determined."""
        old = one.start if one.is_given else 0.0
        if log_sd < DETERMINED * PRIOR_SD:
            return cls(one.key, one.words, old, value, log_sd * value, is_determined=True, gain=gain)
        return cls(one.key, one.words, old, old, one.start * PRIOR_SD, is_determined=False, gain=0.0)

    @property
    def remark(self) -> str:
        """The comment beside the tuned value."""
        old = f"{self.old:.3g}" if self.old != 0.0 else "none"
        return f"tuned: ± {self.sd:.2g} (1 sigma), was {old}, log-likelihood gain {self.gain:.3g}"


@dataclass(frozen=True, eq=False)
class Tuned:
    """What `tune_case` found.

    Attributes:
        case: as it was read.
        parameters: that were tuned.
        fraction: of the recording that they were estimated on.
        outliers: beams left out of the comparison, and all of them.
        terms: what the rest of the recording says, by values (old or new), sensor and horizon_s: count, error_over_sd,
            and score, the mean negative log-likelihood of a row. Nothing of values with which the filter failed.
        gain, gain_sd: of the composite log-likelihood there.
        has_settled: whether the search came to its end.
        passes, wall_s: what it took.
    """

    case: Case
    parameters: tuple[TunedParameter, ...]
    fraction: float
    outliers: tuple[int, int]
    terms: list[dict[str, Any]]
    gain: float
    gain_sd: float
    has_settled: bool
    passes: int
    wall_s: float

    @property
    def is_better(self) -> bool:
        """Whether the new values are better by more than chance on the part that they were not estimated on."""
        return self.gain > (GAIN_SIGMAS * self.gain_sd if np.isfinite(self.gain_sd) else 0.0)

    @property
    def written(self) -> dict[str, TunedParameter]:
        """The new values by their keys; none where they are not better on the rest."""
        return {one.key: one for one in self.parameters if one.is_determined and self.is_better}

    def record(self) -> dict[str, Any]:
        """What was tuned, by versions, case and files with their SHA-256, and what was found, as JSON holds it."""
        tuned = {name: value for name, value in vars(self).items() if name != "case"} | {
            "status": "complete",
            "kind": "tune",
            "version": kernel.kernel_version(),
            "versions": library_versions(),
            "case": self.case.name,
            "configuration_hash": self.case.content_hash(),
            "files": file_digests(self.case),
            "dvl_file": hashlib.sha256(geometry_text(self.case.dvl.geometry).encode()).hexdigest(),
            "is_better": self.is_better,
            "parameters": [vars(one) | {"is_written": one.key in self.written} for one in self.parameters],
        }
        return dict(plain(tuned))


def tune_case(
    path: str | Path | Case,
    *,
    fraction: float = 0.5,
    threads: int = 0,
    progress: Progress = lambda *_: None,
) -> Tuned:
    """Tunes a case by the likelihood of its recording; the result does not depend on the threads.

    Args:
        path: the case's file, or a case.
        fraction: of the recording, from its start, that is estimated on; the rest judges.
        threads: their number, 0 for one per core.
        progress: called after each iteration with the part that is done and the number of passes over the recording.

    Raises:
        ScenarioError: for a case that is not valid or has beams made from a velocity, and a fraction outside 0.2 to
            0.8.
        DataError: as `read_streams`, for a recording that is too short, and where the filter fails with every noise.
    """
    if not 0.2 <= fraction <= 0.8:
        raise ScenarioError(
            f"fraction is {fraction:g}", expected="0.2 to 0.8: the rest of the recording judges"
        )
    started = time.perf_counter()
    case = path if isinstance(path, Case) else load_case(path)
    if case.dvl.source != "beams":
        raise ScenarioError(
            f'is "{case.dvl.source}"', place=f"case {case.name}", key="dvl.source", expected='"beams"',
            hint="beams made from a velocity close exactly, so they show no noise of a beam",
        )  # fmt: skip
    recording = Recording.read(case)
    start_ns, end_ns = recording.prepared.alignment.time_ns, recording.prepared.streams.inertial.time_ns[-1]
    part_s = fraction * (end_ns - start_ns) * 1e-9
    split_ns, horizons = int(start_ns + part_s * 1e9), horizons_of(part_s)
    if not horizons:
        raise DataError(
            f"the first {fraction:.0%} of the recording last {part_s:.0f} s",
            expected="80 s or more to tune on",
        )
    block_s, first = horizons[-1] + RECOVERY_S, recording.until(split_ns)
    with ThreadPoolExecutor(threads or os.cpu_count()) as executor:
        tuned, has_settled, flown = _estimate(first, first.passes(horizons), executor, block_s, progress)
        rest = Criterion(recording, recording.passes(horizons), (), executor, split_ns, flown)
        values = {one.key: one.value for one in tuned.values() if one.is_determined}
        old, new = rest.innovations([{}, values])
    gain, gain_sd = gain_of(rest, old, new, block_s)
    valid, both = recording.prepared.streams.beams.valid[recording.prepared.pings], {"old": old, "new": new}
    return Tuned(
        case=case,
        parameters=tuple(tuned[one.key] for one in recording.noise),
        fraction=fraction,
        outliers=(int((valid & ~recording.valid).sum()), int(valid.sum())),
        terms=[{"values": name} | term for name, one in both.items() for term in terms_of(one)],
        gain=gain,
        gain_sd=gain_sd,
        has_settled=has_settled,
        passes=rest.flown,
        wall_s=time.perf_counter() - started,
    )


def _estimate(
    recording: Recording, passes: Sequence[Pass], executor: Executor, block_s: float, progress: Progress
) -> tuple[dict[str, TunedParameter], bool, int]:
    """What was found of each setting by its key, whether the search came to its end, and the number of passes.

    What the recording does not determine stays as it is, and the rest is found beside that.
    """
    tuned: dict[str, TunedParameter] = {}
    noise, has_settled, flown, left = recording.noise, True, 0, 1.0
    factors = np.array([one.key in INERTIAL_NOISE for one in noise])
    starts = [np.log([one.start for one in noise]) + factors * np.log(factor) for factor in START_FACTORS]
    while noise:
        criterion = Criterion(recording, passes, noise, executor, flown=flown, left=left)
        found = criterion.best(starts, progress)
        before = np.tile(found.at, (len(noise), 1))
        np.fill_diagonal(before, criterion.start)
        gains = [value - found.value for value, _ in criterion.at(list(before))]
        sds = criterion.uncertainty(found, block_s).tolist()
        for one, *numbers in zip(noise, np.exp(found.at).tolist(), sds, gains, strict=True):
            tuned[one.key] = TunedParameter.of(one, *numbers)
        has_settled, flown, left = found.gain_left < SETTLED, criterion.flown, 0.5 * left
        kept = [k for k, one in enumerate(noise) if tuned[one.key].is_determined]
        starts = [found.at[kept]]
        noise = tuple(noise[k] for k in kept) if len(kept) < len(noise) else ()
    return tuned, has_settled, flown


def terms_of(innovations: Innovations | None) -> list[dict[str, Any]]:
    """The terms of a candidate, a row a sensor and horizon; none where its filter ended in an error."""
    if innovations is None:
        return []
    value, nis = (pl.col(name).sum() / pl.col("rows").sum() for name in ("value", "nis"))
    terms = innovations.table.group_by(TERM).agg(count=pl.len(), error_over_sd=nis.sqrt(), score=value)
    return terms.sort(TERM).to_dicts()


def gain_of(
    criterion: Criterion, old: Innovations | None, new: Innovations | None, block_s: float
) -> tuple[float, float]:
    """Gain of the composite log-likelihood and its 1 sigma, from blocks of the recording.

    A filter that ended in an error has lost.
    """
    if old is None or new is None:
        return (FAILED if old is None else -FAILED), 0.0
    gain = criterion.weights * (old.table["value"] - new.table["value"]).to_numpy()
    sums = block_sums(new.table, gain, block_s)
    return float(gain.sum()), float(np.sqrt(len(sums)) * sums.std(ddof=1)) if len(sums) > 1 else np.nan


def record_of(out: Path) -> Path:
    """The record beside a tuned case."""
    return out.with_suffix(".json")


def require_free(path: Path, out: Path, *, inputs: Iterable[Path] = (), force: bool) -> None:
    """Checks where the tuned case is to go.

    Raises:
        OutputError: for a name that is not that of a TOML file, the case itself or one of the files it reads, another
            folder, and a file that is there already without `force`.
    """
    if out.suffix.lower() != ".toml":
        raise OutputError(place=out, expected="a name that ends in .toml, the tuned case to write")
    if out.parent.resolve() != path.parent.resolve():
        raise OutputError(
            f"the case names its files relative to {path.parent}",
            place=out,
            hint="write the tuned case into the same folder",
        )
    check_apart([record_of(out)], [path, *inputs])
    check_free(out, inputs=[path, *inputs], force=force)


def write_tuned(path: Path, tuned: Tuned, out: Path, *, force: bool = False) -> None:
    """Writes the tuned case, with its ends of lines, and beside it the record of how it was found.

    Raises:
        OutputError: as `require_free`, or where a file cannot be written.
        ScenarioError: for a key that is not on a line of its own.
    """
    require_free(path, out, force=force)
    values = {key: float(f"{one.value:.4g}") for key, one in tuned.written.items()}
    remarks = {key: one.remark for key, one in tuned.written.items()}
    text = edited(read_text(path), values, remarks, place=str(path))
    parse_case(text, place=str(path), folder=path.parent)
    text = text.replace("\n", "\r\n") if b"\r\n" in path.read_bytes() else text
    write_record(record_of(out), tuned.record(), {out.name: write_text(out, text)})
