"""From chunks to tables, with one chunk and then one method in memory at a time."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
import polars as pl
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from bottomlock.campaign.chunk import ChunkResult
from bottomlock.campaign.error_blocks import ErrorBlocks, open_blocks
from bottomlock.campaign.partition import Chunk, Partition
from bottomlock.campaign.selector_counts import merged
from bottomlock.errors import DataError
from bottomlock.statistics import campaign

_NEES = ("nees", "nees_velocity_attitude")


class Tables(NamedTuple):
    """The tables of a campaign: `tables.campaign.RUNS`, `ENSEMBLE`, `CONSISTENCY`, `CHOICES`."""

    runs: pl.DataFrame
    ensemble: pl.DataFrame
    consistency: pl.DataFrame
    choices: pl.DataFrame


class Aggregate:
    """The tables of a campaign while its chunks come in, in any order."""

    def __init__(self, scenarios: dict[str, "_ScenarioAggregate"]) -> None:
        """`scenarios`: in the order of the tables."""
        self._scenarios = scenarios

    def add(self, chunk: Chunk, result: ChunkResult) -> None:
        """Takes the tables of a chunk.

        Raises:
            DataError: for other sample times than those of the scenario's chunks before.
            OutputError: on a full disk.
        """
        self._scenarios[chunk.scenario].add(chunk, result)

    def tables(self) -> Tables:
        """The tables; every chunk has been added."""
        # With one BLAS thread the last bits do not depend on the number of cores.
        with threadpool_limits(limits=1, user_api="blas"):
            parts = [scenario.tables() for scenario in self._scenarios.values()]
        tables = Tables(*(pl.concat(tables) for tables in zip(*parts, strict=True)))
        return tables._replace(consistency=campaign.judge(tables.consistency))


class _ScenarioAggregate:
    """The tables of one scenario while its chunks come in."""

    def __init__(self, out: Path, partition: Partition, opened: ExitStack) -> None:
        """`out`: a folder with room for the error norms; `opened` closes what is held there."""
        self._out = out
        self._partition = partition
        self._opened = opened
        self._blocks: ErrorBlocks | None = None
        self._time_ns = np.empty(0, dtype=np.int64)
        self._runs: dict[Chunk, pl.DataFrame] = {}
        self._choices: dict[Chunk, pl.DataFrame] = {}

    def add(self, chunk: Chunk, result: ChunkResult) -> None:
        """As `Aggregate.add`."""
        samples = result.samples
        per_method = samples.height // (chunk.runs * len(self._partition.methods))
        time_ns = samples["time_ns"].head(per_method).to_numpy()
        if self._blocks is None:
            self._time_ns = time_ns
            self._blocks = self._opened.enter_context(open_blocks(self._out, self._partition, len(time_ns)))
        if not np.array_equal(time_ns, self._time_ns):
            raise DataError(
                f"{self._out}: chunk {chunk.file_ending} of {chunk.scenario} has other sample times than the others"
            )
        norms = campaign.error_norms(samples)
        self._blocks.put(chunk, norms)
        self._runs[chunk] = campaign.runs_table(norms, result.counts)
        self._choices[chunk] = result.choices

    def tables(self) -> Tables:
        """Runs chunk by chunk, the ensemble method by method."""
        partition, chunks = self._partition, self._partition.chunks()
        assert self._blocks is not None
        ensemble: list[pl.DataFrame] = []
        nees: dict[str, list[NDArray[np.float64]]] = {method: [] for method in partition.methods}
        for block in self._blocks.blocks:
            method, errors = partition.methods[block.method], self._blocks.get(block)
            ensemble.append(
                campaign.ensemble_rows(partition.scenario, method, self._time_ns[block.times], errors)
            )
            nees[method].append(np.stack([errors[name].mean(axis=0) for name in _NEES]))
        consistency = [
            campaign.consistency_rows(
                partition.scenario,
                method,
                dict(zip(_NEES, np.concatenate(means, axis=1), strict=True)),
                runs=partition.runs,
                full_degrees=partition.nees_degrees,
            )
            for method, means in nees.items()
        ]
        return Tables(
            pl.concat([self._runs[chunk] for chunk in chunks]),
            pl.concat(ensemble),
            pl.concat(consistency),
            merged([self._choices[chunk] for chunk in chunks]),
        )


@contextmanager
def open_aggregate(out: Path, partitions: Sequence[Partition]) -> Iterator[Aggregate]:
    """An empty aggregate; it keeps error norms in files without a name on the file system of `out`."""
    with ExitStack() as opened:
        yield Aggregate({one.scenario: _ScenarioAggregate(out, one, opened) for one in partitions})
