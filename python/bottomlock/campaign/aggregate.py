"""From chunks to tables, one chunk and then one method in memory at a time."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from bottomlock.atomic_write import write_json, write_parquet
from bottomlock.campaign.directory import MANIFEST, TABLES, read_choices, read_counts, read_samples
from bottomlock.campaign.error_blocks import Blocks, open_blocks
from bottomlock.campaign.partition import Partition, RunRange
from bottomlock.campaign.selector_counts import merged
from bottomlock.errors import DataError
from bottomlock.statistics import campaign

_NEES = ("nees", "nees_velocity_attitude")

Tables = tuple[pl.DataFrame, pl.DataFrame, pl.DataFrame, pl.DataFrame]


@dataclass(frozen=True)
class Results:
    """The tables of a finished campaign."""

    runs: pl.DataFrame
    ensemble: pl.DataFrame
    consistency: pl.DataFrame
    manifest: dict[str, Any]


class Tally:
    """The tables of one scenario while its chunks come in, in any order."""

    def __init__(self, out: Path, plan: Partition, opened: ExitStack) -> None:
        """For chunks that are in `out` or on their way there; `opened` closes what is held on disk."""
        self._out = out
        self._plan = plan
        self._opened = opened
        self._blocks: Blocks | None = None
        self._time_ns = np.empty(0, dtype=np.int64)
        self._runs: dict[RunRange, pl.DataFrame] = {}
        self._choices: dict[RunRange, pl.DataFrame] = {}

    def take(
        self, span: RunRange, samples: pl.DataFrame, counts: pl.DataFrame, choices: pl.DataFrame
    ) -> None:
        """A chunk's tables.

        Raises:
            DataError: for other times than those of the chunks before.
            OutputError: on a full disk.
        """
        time_ns = samples["time_ns"].head(samples.height // (span.runs * len(self._plan.methods))).to_numpy()
        if self._blocks is None:
            self._time_ns = time_ns
            self._blocks = self._opened.enter_context(open_blocks(self._out, self._plan, len(time_ns)))
        if not np.array_equal(time_ns, self._time_ns):
            raise DataError(
                f"{self._out}: chunk {span.stem} of {self._plan.name} has other times than the others"
            )
        norms = campaign.error_norms(samples)
        self._blocks.put(span, norms)
        self._runs[span] = campaign.runs_table(norms, counts)
        self._choices[span] = choices

    def tables(self) -> Tables:
        """The tables: runs chunk by chunk, the ensemble method by method; chunks not taken yet are read from disk.

        Raises:
            DataError: for a chunk that is missing or damaged.
        """
        out, plan, spans = self._out, self._plan, self._plan.spans()
        for span in spans:
            if span not in self._runs:
                self.take(
                    span,
                    read_samples(out, plan, span),
                    read_counts(out, plan, span),
                    read_choices(out, plan, span),
                )
        assert self._blocks is not None
        ensemble: list[pl.DataFrame] = []
        nees: dict[str, list[NDArray[np.float64]]] = {method: [] for method in plan.methods}
        for block in self._blocks.blocks:
            method, errors = plan.methods[block.method], self._blocks.get(block)
            ensemble.append(campaign.ensemble_rows(plan.name, method, self._time_ns[block.times], errors))
            nees[method].append(np.stack([errors[name].mean(axis=0) for name in _NEES]))
        consistency = [
            campaign.consistency_rows(
                plan.name,
                method,
                dict(zip(_NEES, np.concatenate(means, axis=1), strict=True)),
                runs=plan.runs,
                full_degrees=plan.nees_degrees,
            )
            for method, means in nees.items()
        ]
        runs = pl.concat([self._runs[span] for span in spans])
        return (
            runs,
            pl.concat(ensemble),
            pl.concat(consistency),
            merged([self._choices[span] for span in spans]),
        )


@contextmanager
def open_tallies(out: Path, plans: Sequence[Partition]) -> Iterator[dict[str, Tally]]:
    """The tallies of a campaign by scenario, for as long as they are needed."""
    with ExitStack() as opened:
        yield {plan.name: Tally(out, plan, opened) for plan in plans}


def tabulate(out: Path, tallies: Mapping[str, Tally]) -> Tables:
    """Makes and writes the tables of a campaign: runs, ensemble, consistency, choices.

    Raises:
        DataError: for a chunk that is missing or damaged.
        OutputError: where the tables cannot be written.
    """
    # One thread of the BLAS: how many there are would move the last bits, and none is waited for.
    with threadpool_limits(limits=1, user_api="blas"):
        parts = [tally.tables() for tally in tallies.values()]
    runs, ensemble, consistency, choices = (pl.concat(tables) for tables in zip(*parts, strict=True))
    for name, table in zip(TABLES, (runs, ensemble, consistency, choices), strict=True):
        write_parquet(out / name, table)
    return runs, ensemble, consistency, choices


def finish(out: Path, tallies: Mapping[str, Tally], manifest: dict[str, Any]) -> Results:
    """The tables, and then the manifest that calls the campaign complete."""
    runs, ensemble, consistency, _ = tabulate(out, tallies)
    write_json(out / MANIFEST, manifest)
    return Results(runs=runs, ensemble=ensemble, consistency=consistency, manifest=manifest)
