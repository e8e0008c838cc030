"""From chunks to tables. Of a scenario whose chunks are not all in, memory holds the norms of the errors alone."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import polars as pl
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from bottomlock.campaign.chunk import Chunk, ChunkTables, chunks_of
from bottomlock.campaign.selector_counts import merged
from bottomlock.config.scenario import Scenario
from bottomlock.statistics import campaign


class Tables(NamedTuple):
    """The tables of a campaign: `tables.campaign.RUNS`, `ENSEMBLE`, `CONSISTENCY`, `CHOICES`."""

    runs: pl.DataFrame
    ensemble: pl.DataFrame
    consistency: pl.DataFrame
    choices: pl.DataFrame


class Aggregate:
    """The tables of a campaign while its chunks come in, in any order."""

    def __init__(self, scenarios: Sequence[Scenario]) -> None:
        """`scenarios`: in the order of the tables."""
        self._scenarios = {one.name: one for one in scenarios}
        self._chunks = {one.name: chunks_of(one) for one in scenarios}
        self._parts: dict[Chunk, tuple[NDArray[np.float64], pl.DataFrame, pl.DataFrame]] = {}
        self._finished: dict[str, Tables] = {}
        self._time_ns: dict[str, NDArray[np.int64]] = {}

    def add(self, chunk: Chunk, tables: ChunkTables) -> None:
        """Takes the tables of a chunk; with the last chunk of a scenario its tables are made."""
        norms = campaign.error_norms(tables.samples)
        values = campaign.norm_arrays(
            norms, chunk.runs, len(self._scenarios[chunk.scenario].campaign.methods)
        )
        self._time_ns[chunk.scenario] = norms["time_ns"].head(values.shape[-1]).to_numpy()
        self._parts[chunk] = (values, campaign.runs_table(norms, tables.counts), tables.choices)
        if all(one in self._parts for one in self._chunks[chunk.scenario]):
            self._finished[chunk.scenario] = self._finish(chunk.scenario)

    def _finish(self, name: str) -> Tables:
        scenario = self._scenarios[name]
        norms, runs, choices = zip(*(self._parts.pop(chunk) for chunk in self._chunks[name]), strict=True)
        # With one BLAS thread the last bits do not depend on the number of cores.
        with threadpool_limits(limits=1, user_api="blas"):
            ensemble, consistency = campaign.ensemble_and_consistency(
                name,
                scenario.campaign.methods,
                self._time_ns[name],
                norms,
                full_degrees=scenario.filter.states,
            )
        return Tables(pl.concat(runs), ensemble, consistency, merged(choices))

    def tables(self) -> Tables:
        """The tables; every chunk has been added."""
        parts = [self._finished[name] for name in self._scenarios]
        tables = Tables(*(pl.concat(tables) for tables in zip(*parts, strict=True)))
        return tables._replace(consistency=campaign.judge(tables.consistency))
