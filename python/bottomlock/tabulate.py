"""From chunks on disk to tables, in memory that does not grow with the number of runs times arms."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from bottomlock import stats
from bottomlock.directory import MANIFEST, TABLES, read_counts, read_samples
from bottomlock.errors import DataError
from bottomlock.output import write_json, write_parquet
from bottomlock.plan import Plan

VALUES_HELD = 32_000_000
"""Error norms in memory at a time, 256 MB; more takes further passes over the chunks."""

Tables = tuple[pl.DataFrame, pl.DataFrame, pl.DataFrame]


@dataclass(frozen=True)
class Results:
    """The tables of a finished campaign."""

    runs: pl.DataFrame
    ensemble: pl.DataFrame
    consistency: pl.DataFrame
    manifest: dict[str, Any]


def tabulate(out: Path, plans: Sequence[Plan]) -> Tables:
    """Makes and writes the tables of a campaign whose chunks are all there: runs, ensemble, consistency.

    Raises:
        DataError: for a chunk that is missing or damaged.
        OutputError: where the tables cannot be written.
    """
    parts = [_tables(out, plan) for plan in plans]
    runs, ensemble, consistency = (pl.concat(tables) for tables in zip(*parts, strict=True))
    for name, table in zip(TABLES, (runs, ensemble, consistency), strict=True):
        write_parquet(out / name, table)
    return runs, ensemble, consistency


def finish(out: Path, plans: Sequence[Plan], manifest: dict[str, Any]) -> Results:
    """The tables, and then the manifest that calls the campaign complete."""
    runs, ensemble, consistency = tabulate(out, plans)
    write_json(out / MANIFEST, manifest)
    return Results(runs=runs, ensemble=ensemble, consistency=consistency, manifest=manifest)


def _tables(out: Path, plan: Plan) -> Tables:
    """The tables of one scenario: runs chunk by chunk, what goes over the runs block by block."""
    runs, time_ns = _runs(out, plan)
    ensemble: list[list[pl.DataFrame]] = [[] for _ in plan.arms]
    nees: list[list[NDArray[np.float64]]] = [[] for _ in plan.arms]
    for arms, times in _blocks(plan, len(time_ns)):
        block = _norms(out, plan, arms, times, len(time_ns))
        for k, values in zip(range(arms.start, arms.stop), block, strict=True):
            errors = dict(zip(stats.NORMS, values, strict=True))
            ensemble[k].append(stats.ensemble_rows(plan.name, plan.arms[k], time_ns[times], errors))
            nees[k].append(np.stack([errors[name].mean(axis=0) for name in _NEES]))
    consistency = [
        stats.consistency_rows(
            plan.name,
            arm,
            dict(zip(_NEES, np.concatenate(means, axis=1), strict=True)),
            runs=plan.runs,
            full_degrees=plan.nees_degrees,
        )
        for arm, means in zip(plan.arms, nees, strict=True)
    ]
    return runs, pl.concat([part for parts in ensemble for part in parts]), pl.concat(consistency)


_NEES = ("nees", "nees_velocity_attitude")


def _runs(out: Path, plan: Plan) -> tuple[pl.DataFrame, NDArray[np.int64]]:
    """The table of runs, and the times of the samples, which all chunks share."""
    parts: list[pl.DataFrame] = []
    shared: NDArray[np.int64] | None = None
    for span in plan.spans():
        samples = read_samples(out, plan, span)
        time_ns = samples["time_ns"].head(samples.height // (span.runs * len(plan.arms))).to_numpy()
        if shared is not None and not np.array_equal(time_ns, shared):
            raise DataError(f"{out}: chunk {span.stem} of {plan.name} has other times than those before it")
        shared = time_ns
        parts.append(stats.runs_table(stats.error_norms(samples), read_counts(out, plan, span)))
    assert shared is not None
    return pl.concat(parts), shared


def _blocks(plan: Plan, times: int) -> Iterator[tuple[slice, slice]]:
    """Arms and times whose norms are held together: whole arms if one fits, else an arm's times in parts.

    The cutting depends on the scenario alone, so that the last bit does not depend on the machine's memory.
    """
    per_time = len(stats.NORMS) * plan.runs
    arms_at_once = VALUES_HELD // (per_time * times)
    times_at_once = times if arms_at_once else max(1, VALUES_HELD // per_time)
    arms_at_once = max(1, arms_at_once)
    for arm in range(0, len(plan.arms), arms_at_once):
        for time in range(0, times, times_at_once):
            yield (
                slice(arm, min(arm + arms_at_once, len(plan.arms))),
                slice(time, min(time + times_at_once, times)),
            )


def _norms(out: Path, plan: Plan, arms: slice, times: slice, all_times: int) -> NDArray[np.float64]:
    """Error norms of all runs, (arms, norms, runs, times)."""
    held = np.empty((arms.stop - arms.start, len(stats.NORMS), plan.runs, times.stop - times.start))
    for span in plan.spans():
        norms = stats.error_norms(read_samples(out, plan, span))
        shape = (span.runs, len(plan.arms), all_times)
        for k, name in enumerate(stats.NORMS):
            chunk = norms[name].to_numpy().reshape(shape)[:, arms, times]
            held[:, k, span.first_run : span.first_run + span.runs] = chunk.swapaxes(0, 1)
    return held
