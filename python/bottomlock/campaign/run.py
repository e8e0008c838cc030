"""A Monte Carlo campaign, one step after another: built, partitioned, run, aggregated, written.

Chunk boundaries depend on the scenario alone, never on threads, shards or the engine. The numbers of a run depend on
nothing but the seed, the trajectory's name and the run's number. Any partition, any engine and any resumption therefore
give the same bits.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from bottomlock.campaign.aggregate import Tables, open_aggregate
from bottomlock.campaign.build import (
    AnyScenarios,
    build_scenarios,
    build_simulations,
    check_found_elsewhere,
    scenarios_of,
    true_paths,
)
from bottomlock.campaign.chunk_files import Identity, is_finished, read_chunk, write_chunk
from bottomlock.campaign.directory import (
    MANIFEST,
    TABLES,
    TRUTH,
    check_owner,
    open_directory,
    start_directory,
    write_tables,
)
from bottomlock.campaign.engine import ChunkSource, Engine, LocalEngine, check_engine, open_engine
from bottomlock.campaign.manifest import Clock, describe, identity_of
from bottomlock.campaign.partition import Chunk, Partition, Shard, all_chunks
from bottomlock.campaign.shown_results import ShownResults
from bottomlock.config.scenario import Scenario
from bottomlock.files.overwriting import check_apart, remove_outdated
from bottomlock.files.records import write_record
from bottomlock.simulation.build import Simulation
from bottomlock.tables.results import read_campaign_tables


@dataclass(frozen=True)
class CampaignProgress:
    """How far a campaign is.

    Attributes:
        trajectory: the scenario under way.
        runs_done: its finished runs; a chunk under way may count in part.
        runs_total: all of its runs.
        campaign_runs: the runs of all scenarios.
        found: whether these runs were finished by an earlier start.
    """

    trajectory: str
    runs_done: float
    runs_total: int
    campaign_runs: int
    found: bool = False


@dataclass(frozen=True, repr=False)
class Results(ShownResults):
    """The tables of a finished campaign (`tables.campaign.RUNS`, `ENSEMBLE`, `CONSISTENCY`), and its manifest.

    Attributes:
        runs, ensemble, consistency: the tables.
        manifest: as `manifest.json` has it.
        folder: where all of it was written.
        paths: the true paths (`tables.campaign.PATHS`); None where the campaign has none.
    """

    runs: pl.DataFrame
    ensemble: pl.DataFrame
    consistency: pl.DataFrame
    manifest: dict[str, Any]
    folder: Path
    paths: pl.DataFrame | None = None


def read_results(folder: str | Path) -> Results:
    """The results of a campaign that `run_campaign` or `bottomlock run` has finished in a folder.

    Raises:
        DataError: for a folder without a finished campaign of this version, and for a table that is missing or has
            changed since it was written.
    """
    tables = read_campaign_tables(Path(folder))
    return Results(
        tables.runs, tables.ensemble, tables.consistency, tables.manifest, tables.folder, tables.paths
    )


@dataclass(frozen=True)
class Campaign:
    """The work of a campaign.

    Attributes:
        partitions: how each scenario is cut into chunks, in order.
        shard: the part that is computed here; None for all of it.
        identity: what decides the numbers.
        paths: the true paths, `tables.campaign.PATHS`.
        description: the manifest's entries that are known beforehand, see `manifest.describe`.
    """

    partitions: tuple[Partition, ...]
    shard: Shard | None
    identity: Identity
    paths: pl.DataFrame
    description: dict[str, Any]


def run_campaign(
    scenarios: AnyScenarios,
    out: str | Path,
    *,
    threads: int = 0,
    engine: Engine = "local",
    scheduler: str | None = None,
    force: bool = False,
    recover: bool = False,
    progress: Callable[[CampaignProgress], None] = lambda _: None,
) -> Results:
    """Runs or resumes a campaign and writes its tables to `out`.

    Writes `runs.parquet`, `ensemble.parquet`, `consistency.parquet`, `choices.parquet`, `truth.parquet` and
    `manifest.json`, and the samples in `chunks/`. An interruption keeps finished chunks; the next start skips those
    that are whole, and runs one that has changed on the disk again, with a `Note`.

    Args:
        scenarios: one or several of different names: each a Scenario, a packaged name or the path of a file.
        out: directory; new, empty, or of the same configuration.
        threads: 0 for as many as there are cores. The numbers do not depend on it.
        engine: "local" or "dask", see `engine.open_engine`. The numbers do not depend on it.
        scheduler: address of a Dask scheduler.
        force: start over in a directory of another configuration.
        recover: go on in a directory whose manifest is damaged or missing; chunks of this campaign that are whole are
            kept.
        progress: called after each chunk, and during a chunk in closed loop.

    Raises:
        ScenarioError: for two scenarios of one name, and for what `load_scenario` and `build_simulation` reject.
        OutputError: for a directory that holds something else, is in use by another process, or cannot be written.
        DataError: for a manifest on disk that is damaged.
        EngineError: for an engine that is not there or breaks down.
        KernelError: for input that the kernel rejects, naming run and method.
    """
    out = Path(out)
    tables, campaign, manifest = _simulate(
        scenarios, out, None, threads, engine, scheduler, force=force, recover=recover, progress=progress
    )
    assert tables is not None
    return Results(tables.runs, tables.ensemble, tables.consistency, manifest, out, campaign.paths)


def run_shard(
    scenarios: AnyScenarios,
    out: str | Path,
    shard: Shard | str,
    *,
    threads: int = 0,
    engine: Engine = "local",
    scheduler: str | None = None,
    force: bool = False,
    recover: bool = False,
    progress: Callable[[CampaignProgress], None] = lambda _: None,
) -> dict[str, Any]:
    """Runs or resumes one shard of a campaign; `merge.merge_shards` joins all shards to the campaign.

    `out` gets the shard's chunks and a manifest of status "shard", and no tables; `shard` may be text such as "1/4".
    Everything else is as for `run_campaign`.

    Returns:
        The manifest.

    Raises:
        As `run_campaign`.
        ScenarioError: also for a method of one's own that is in this process alone, and for a text that is no shard.
    """
    out = Path(out)
    shard = shard if isinstance(shard, Shard) else Shard.parse(str(shard))
    _, _, manifest = _simulate(
        scenarios, out, shard, threads, engine, scheduler, force=force, recover=recover, progress=progress
    )
    return manifest


@contextmanager
def campaign_directory(
    scenarios: Sequence[Scenario], out: Path, *, force: bool = False, recover: bool = False
) -> Iterator[None]:
    """Holds the directory of a campaign, and rejects one that is not its own before anything is computed.

    Raises:
        As `run_campaign`.
    """
    with open_directory(out, identity_of(build_simulations(scenarios)), force=force, recover=recover):
        yield


def check_campaign(
    scenarios: Sequence[Scenario],
    out: Path,
    *,
    shard: Shard | None = None,
    force: bool = False,
    recover: bool = False,
) -> None:
    """Rejects scenarios and a directory that a campaign would be rejected for, and changes nothing.

    Raises:
        As `run_campaign`.
    """
    identity = identity_of(build_simulations(scenarios))
    check_owner(out, identity, shard, force=force, recover=recover)


def _simulate(
    given: AnyScenarios,
    out: Path,
    shard: Shard | None,
    threads: int,
    engine: Engine,
    scheduler: str | None,
    *,
    force: bool,
    recover: bool,
    progress: Callable[[CampaignProgress], None],
) -> tuple[Tables | None, Campaign, dict[str, Any]]:
    """Builds and partitions the scenarios, and executes the campaign on an engine; as `execute`, with the campaign."""
    clock = Clock()
    check_engine(engine, threads=threads, scheduler=scheduler)
    scenarios = scenarios_of(given)
    if engine != "local" or shard is not None:
        check_found_elsewhere(scenarios)
    simulations = build_simulations(scenarios)
    identity = identity_of(simulations)
    check_apart(
        [out / name for name in (*TABLES, TRUTH)],
        [file for scenario in scenarios for file in scenario.files()],
    )
    # The directory comes before the truth, which may take long: a directory that is not ours is rejected at once.
    with open_directory(out, identity, shard=shard, force=force, recover=recover):
        built = build_scenarios(simulations)
        partitions = tuple(Partition.of(scenario) for scenario in scenarios)
        description = describe(built, partitions, identity, threads=threads, engine=engine, shard=shard)
        campaign = Campaign(partitions, shard, identity, true_paths(built), description)
        # The engine comes first: nothing is written, let alone removed, for a cluster that is not there.
        with open_engine(engine, built, threads=threads, scheduler=scheduler) as source:
            tables, manifest = execute(campaign, source, out, clock, force=force, progress=progress)
    return tables, campaign, manifest


def execute(
    campaign: Campaign,
    source: ChunkSource,
    out: Path,
    clock: Clock,
    *,
    force: bool,
    progress: Callable[[CampaignProgress], None] = lambda _: None,
) -> tuple[Tables | None, dict[str, Any]]:
    """Runs the chunks that are missing or not whole, aggregates all of them, and writes the tables.

    Args:
        campaign: what is to be computed.
        source: an engine, or the directories of shards.
        out: the campaign's directory, held by `open_directory`.
        clock: started with the campaign.
        force: start over in a directory of another campaign.
        progress: as for `run_campaign`.

    Returns:
        The tables, None for a shard, and the manifest.
    """
    partitions, description = {one.scenario: one for one in campaign.partitions}, campaign.description
    identity = campaign.identity
    start_directory(out, force=force)
    write_record(out / MANIFEST, description | clock.times() | {"status": "running"}, {})
    chunks = all_chunks(campaign.partitions, campaign.shard)
    found = [chunk for chunk in chunks if is_finished(out, chunk, identity)]
    counter = _RunCounter(chunks, found, progress)
    missing = [chunk for chunk in chunks if chunk not in set(found)]
    tables = None
    with open_aggregate(out, campaign.partitions) as aggregate:
        with closing(source.run(missing, counter.report)) as results:
            for chunk, result in results:
                started = time.perf_counter()
                write_chunk(out, chunk, result, identity)
                if campaign.shard is None:
                    aggregate.add(chunk, result)
                clock.kernel_s += result.kernel_s
                clock.batch_s += result.work_s + time.perf_counter() - started
                counter.finish(chunk)
        if campaign.shard is None:
            for chunk in found:
                aggregate.add(chunk, read_chunk(out, chunk, partitions[chunk.scenario], identity))
            tables = aggregate.tables()
    written = write_tables(out, campaign.paths, tables)
    manifest = description | clock.times() | {"status": "shard" if tables is None else "complete"}
    write_record(out / MANIFEST, manifest, written)
    # A report of this campaign, and a page that compares it with its neighbours.
    for folder in (out, out.parent):
        remove_outdated(folder)
    return tables, manifest


def run_in_memory(
    simulations: Sequence[Simulation],
    room: Path,
    *,
    threads: int = 0,
    progress: Callable[[CampaignProgress], None] = lambda _: None,
) -> Tables:
    """The tables of a campaign of which nothing is kept; the numbers are those of `run_campaign`.

    Args:
        simulations: of its scenarios.
        room: a folder that has room for what memory does not hold.
        threads: 0 for as many as there are cores.
        progress: called after each chunk.

    Raises:
        KernelError: for input that the kernel rejects, naming run and method.
        OutputError: on a full disk.
    """
    built = build_scenarios(simulations)
    partitions = [Partition.of(one.scenario) for one in built]
    chunks = all_chunks(partitions)
    counter = _RunCounter(chunks, [], progress)
    with (
        open_aggregate(room, partitions) as aggregate,
        closing(LocalEngine(built, threads).run(chunks, counter.report)) as results,
    ):
        for chunk, result in results:
            aggregate.add(chunk, result)
            counter.finish(chunk)
        return aggregate.tables()


class _RunCounter:
    """Counts finished runs by scenario and reports them."""

    def __init__(
        self, chunks: Sequence[Chunk], found: Sequence[Chunk], progress: Callable[[CampaignProgress], None]
    ) -> None:
        """Reports the runs of chunks that an earlier start has finished."""
        self._progress = progress
        self._total = dict.fromkeys((chunk.scenario for chunk in chunks), 0)
        self._done = dict.fromkeys(self._total, 0)
        for chunk in chunks:
            self._total[chunk.scenario] += chunk.runs
        for chunk in found:
            self._done[chunk.scenario] += chunk.runs
        for name, runs in self._done.items():
            if runs:
                self._call(name, runs, found=True)

    def report(self, chunk: Chunk, fraction: float) -> None:
        """Reports a chunk in progress."""
        self._call(chunk.scenario, self._done[chunk.scenario] + chunk.runs * fraction)

    def finish(self, chunk: Chunk) -> None:
        """Reports a finished chunk."""
        self._done[chunk.scenario] += chunk.runs
        self._call(chunk.scenario, self._done[chunk.scenario])

    def _call(self, name: str, runs: float, *, found: bool = False) -> None:
        total = sum(self._total.values())
        self._progress(CampaignProgress(name, runs, self._total[name], total, found))
