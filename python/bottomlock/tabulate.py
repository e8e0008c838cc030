"""From chunks on disk to tables, one arm in memory at a time."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from bottomlock import stats
from bottomlock.blocks import open_blocks
from bottomlock.choices import merged
from bottomlock.directory import MANIFEST, TABLES, read_choices, read_counts, read_samples
from bottomlock.errors import DataError
from bottomlock.output import write_json, write_parquet
from bottomlock.plan import Plan, Span

_NEES = ("nees", "nees_velocity_attitude")

Tables = tuple[pl.DataFrame, pl.DataFrame, pl.DataFrame, pl.DataFrame]


@dataclass(frozen=True)
class Results:
    """The tables of a finished campaign."""

    runs: pl.DataFrame
    ensemble: pl.DataFrame
    consistency: pl.DataFrame
    manifest: dict[str, Any]


def tabulate(out: Path, plans: Sequence[Plan]) -> Tables:
    """Makes and writes the tables of a campaign whose chunks are all there: runs, ensemble, consistency, choices.

    Raises:
        DataError: for a chunk that is missing or damaged.
        OutputError: where the tables cannot be written.
    """
    parts = [_tables(out, plan) for plan in plans]
    runs, ensemble, consistency, choices = (pl.concat(tables) for tables in zip(*parts, strict=True))
    for name, table in zip(TABLES, (runs, ensemble, consistency, choices), strict=True):
        write_parquet(out / name, table)
    return runs, ensemble, consistency, choices


def finish(out: Path, plans: Sequence[Plan], manifest: dict[str, Any]) -> Results:
    """The tables, and then the manifest that calls the campaign complete."""
    runs, ensemble, consistency, _ = tabulate(out, plans)
    write_json(out / MANIFEST, manifest)
    return Results(runs=runs, ensemble=ensemble, consistency=consistency, manifest=manifest)


def _tables(out: Path, plan: Plan) -> Tables:
    """The tables of one scenario: runs chunk by chunk, what goes over the runs arm by arm."""
    runs: list[pl.DataFrame] = []
    spans = plan.spans()
    time_ns = _times(read_samples(out, plan, spans[0]), plan, spans[0])
    ensemble: list[pl.DataFrame] = []
    nees: dict[str, list[NDArray[np.float64]]] = {arm: [] for arm in plan.arms}
    with open_blocks(out, plan, len(time_ns)) as blocks:
        for span in spans:
            samples = read_samples(out, plan, span)
            if not np.array_equal(_times(samples, plan, span), time_ns):
                raise DataError(f"{out}: chunk {span.stem} of {plan.name} has other times than the first one")
            norms = stats.error_norms(samples)
            runs.append(stats.runs_table(norms, read_counts(out, plan, span)))
            blocks.put(span, norms)
        for block in blocks.blocks:
            arm, errors = plan.arms[block.arm], blocks.get(block)
            ensemble.append(stats.ensemble_rows(plan.name, arm, time_ns[block.times], errors))
            nees[arm].append(np.stack([errors[name].mean(axis=0) for name in _NEES]))
    consistency = [
        stats.consistency_rows(
            plan.name,
            arm,
            dict(zip(_NEES, np.concatenate(means, axis=1), strict=True)),
            runs=plan.runs,
            full_degrees=plan.nees_degrees,
        )
        for arm, means in nees.items()
    ]
    choices = merged([read_choices(out, plan, span) for span in spans])
    return pl.concat(runs), pl.concat(ensemble), pl.concat(consistency), choices


def _times(samples: pl.DataFrame, plan: Plan, span: Span) -> NDArray[np.int64]:
    """Times of the samples of each run and arm."""
    return samples["time_ns"].head(samples.height // (span.runs * len(plan.arms))).to_numpy()
