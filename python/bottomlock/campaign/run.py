"""A Monte Carlo campaign: scenarios built, cut into chunks, run on an engine, and summed up in tables.

Chunk boundaries depend on the scenario alone, never on threads or the engine. The numbers of a run depend on nothing
but the seed, the trajectory's name and the run's number. Any engine and any resumption therefore give the same bits.
"""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import polars as pl
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from bottomlock import kernel
from bottomlock.campaign.build import (
    AnyScenarios,
    build_scenarios,
    build_simulations,
    check_found_elsewhere,
    scenarios_of,
    true_paths,
)
from bottomlock.campaign.chunk import Chunk, ChunkTables, chunks_of, merged, runs_per_chunk
from bottomlock.campaign.engine import Engine, check_engine, open_engine
from bottomlock.campaign.folder import (
    TABLES,
    Identity,
    check_owner,
    identity_of,
    read_chunk,
    start_folder,
    write_chunk,
    write_tables,
)
from bottomlock.campaign.results import Results, read_results
from bottomlock.config.scenario import Scenario
from bottomlock.files.output_folder import locked
from bottomlock.files.overwriting import check_apart, remove_outdated
from bottomlock.files.versions import library_versions
from bottomlock.own_method import AnyMethod
from bottomlock.statistics import campaign


class Tables(NamedTuple):
    """The tables of a campaign: `files.columns.RUNS`, `ENSEMBLE`, `CONSISTENCY`, `CHOICES`."""

    runs: pl.DataFrame
    ensemble: pl.DataFrame
    consistency: pl.DataFrame
    choices: pl.DataFrame


class Aggregate:
    """The tables of a campaign while its chunks come in, in any order."""

    def __init__(self, scenarios: Sequence[Scenario]) -> None:
        """`scenarios`: in the order of the tables."""
        self._scenarios = {scenario.name: scenario for scenario in scenarios}
        self._chunks = {scenario.name: chunks_of(scenario) for scenario in scenarios}
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
        if all(part in self._parts for part in self._chunks[chunk.scenario]):
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


__all__ = ["CampaignProgress", "Results", "check_campaign", "read_results", "run_campaign"]


@dataclass(frozen=True)
class CampaignProgress:
    """How far a campaign is.

    Attributes:
        trajectory: the scenario under way.
        runs_done: its finished runs; a chunk under way may count in part.
        runs_total: all of its runs.
        campaign_runs: the runs of all scenarios.
        resumed: whether these runs were finished by an earlier start.
    """

    trajectory: str
    runs_done: float
    runs_total: int
    campaign_runs: int
    resumed: bool = False


def run_campaign(
    scenarios: AnyScenarios,
    folder: str | Path | None = None,
    *,
    runs: int | None = None,
    seed: int | None = None,
    methods: Iterable[AnyMethod] | None = None,
    engine: Engine = "local",
    scheduler: str | None = None,
    threads: int = 0,
    force: bool = False,
    progress: Callable[[CampaignProgress], None] | None = None,
) -> Results:
    """Runs a campaign, in memory or in a folder in which it resumes.

    A folder gets `runs.parquet`, `ensemble.parquet`, `consistency.parquet`, `choices.parquet`, `truth.parquet` and
    `manifest.json`, and each chunk of the samples as a file in `chunks/`. An interruption keeps finished chunks; the
    next start skips those that are whole, and runs one that has changed on the disk again, with a `Note`.

    Args:
        scenarios: one or several of different names: each a Scenario, a packaged name or the path of a file.
        folder: new, empty, or of the same configuration; None keeps all in memory.
        runs: number of runs in place of the scenarios' own.
        seed: in place of the scenarios' own.
        methods: in place of the scenarios' own.
        engine: "local" or "dask", see `engine.open_engine`. The numbers do not depend on it.
        scheduler: address of a Dask scheduler.
        threads: 0 for as many as there are cores. The numbers do not depend on it.
        force: start over in a folder of another configuration.
        progress: called after each chunk, and during a chunk in closed loop.

    Raises:
        ScenarioError: for two scenarios of one name, and for what `load_scenario` and `build_simulation` reject.
        OutputError: for a folder that holds something else, is in use by another process, or cannot be written.
        DataError: for a manifest on disk that is damaged.
        EngineError: for an engine that is not there or breaks down.
        KernelError: for input that the kernel rejects, naming run and method.
    """
    started = time.perf_counter()
    check_engine(engine, threads=threads, scheduler=scheduler)
    wanted = scenarios_of(scenarios, runs=runs, seed=seed, methods=methods)
    if engine != "local":
        check_found_elsewhere(wanted)
    simulations = build_simulations(wanted)
    identity, out = identity_of(simulations), None if folder is None else Path(folder)
    chunks = [chunk for scenario in wanted for chunk in chunks_of(scenario)]
    manifest = _manifest(wanted, identity) | {"engine": engine, "threads": threads}
    counter, samples = _RunCounter(chunks, progress), dict[Chunk, pl.DataFrame]()
    # The folder comes before the truth, which may take long: one that is not ours is rejected at once.
    with _held(out, wanted, identity, force=force):
        built = build_scenarios(simulations)
        aggregate, paths = Aggregate(wanted), true_paths(built)
        # The engine comes first: nothing is written, let alone removed, for a cluster that is not there.
        with open_engine(engine, built, threads=threads, scheduler=scheduler) as run_chunks:
            missing = chunks
            if out is not None:
                start_folder(out, manifest, force=force)
                missing = _missing(out, chunks, identity, aggregate)
                counter.find(set(chunks) - set(missing))
            with closing(run_chunks(missing, counter.report)) as results:
                for chunk, tables in results:
                    if out is None:
                        samples[chunk] = tables.samples
                    else:
                        write_chunk(out, chunk, tables, identity)
                    aggregate.add(chunk, tables)
                    counter.finish(chunk)
        done = aggregate.tables()
        manifest["wall_time_s"] = round(time.perf_counter() - started, 3)
        if out is not None:
            write_tables(out, [*done, paths], manifest)
            # A report of this campaign, and a page that compares it with its neighbours.
            for place in (out, out.parent):
                remove_outdated(place)
    in_memory = pl.concat([samples[chunk] for chunk in chunks], rechunk=False) if out is None else None
    return Results(manifest, done.runs, done.ensemble, done.consistency, done.choices, paths, out, in_memory)


def check_campaign(scenarios: Sequence[Scenario], folder: Path, *, force: bool = False) -> None:
    """Rejects scenarios and a folder that `run_campaign` would reject, and changes nothing.

    Raises:
        As `run_campaign`.
    """
    check_owner(folder, identity_of(build_simulations(scenarios)), force=force)


@contextmanager
def _held(
    out: Path | None, scenarios: Sequence[Scenario], identity: Identity, *, force: bool
) -> Iterator[None]:
    """Holds the folder, if any, for this campaign; nothing is changed in one that is rejected."""
    if out is None:
        yield
        return
    check_apart(
        [out / name for name in TABLES], [file for scenario in scenarios for file in scenario.files()]
    )
    check_owner(out, identity, force=force)
    with locked(out):
        # Another process may have held it until now.
        check_owner(out, identity, force=force)
        yield


def _manifest(scenarios: Sequence[Scenario], identity: Identity) -> dict[str, Any]:
    """What decided the numbers: versions, seeds, every setting, and how the runs are cut into chunks."""
    return {
        "version": kernel.kernel_version(),
        "versions": library_versions() | identity["versions"],
        "configuration_hash": identity["configuration_hash"],
        "nees_degrees": {scenario.name: scenario.filter.states for scenario in scenarios},
        "scenarios": {
            scenario.name: {
                "seed": scenario.campaign.seed,
                "runs": scenario.campaign.runs,
                "runs_per_chunk": runs_per_chunk(scenario),
                "methods": list(scenario.campaign.methods),
                "configuration": scenario.model_dump(mode="json"),
                "options": scenario.kernel_options().as_dict(),
            }
            for scenario in scenarios
        },
    }


def _missing(out: Path, chunks: Sequence[Chunk], identity: Identity, aggregate: Aggregate) -> list[Chunk]:
    """The chunks that are to be run; those that are whole are added up."""
    missing = []
    for chunk in chunks:
        tables = read_chunk(out, chunk, identity)
        if tables is None:
            missing.append(chunk)
        else:
            aggregate.add(chunk, tables)
    return missing


class _RunCounter:
    """Counts finished runs by scenario and reports them."""

    def __init__(self, chunks: Sequence[Chunk], progress: Callable[[CampaignProgress], None] | None) -> None:
        self._progress = progress or (lambda _: None)
        self._total = dict.fromkeys((chunk.scenario for chunk in chunks), 0)
        self._done = dict.fromkeys(self._total, 0)
        for chunk in chunks:
            self._total[chunk.scenario] += chunk.runs

    def find(self, chunks: Iterable[Chunk]) -> None:
        """Reports the runs of chunks that an earlier start has finished."""
        for chunk in chunks:
            self._done[chunk.scenario] += chunk.runs
        for name, runs in self._done.items():
            if runs:
                self._call(name, runs, resumed=True)

    def report(self, chunk: Chunk, fraction: float) -> None:
        """Reports a chunk in progress."""
        self._call(chunk.scenario, self._done[chunk.scenario] + chunk.runs * fraction)

    def finish(self, chunk: Chunk) -> None:
        """Reports a finished chunk."""
        self._done[chunk.scenario] += chunk.runs
        self._call(chunk.scenario, self._done[chunk.scenario])

    def _call(self, name: str, runs: float, *, resumed: bool = False) -> None:
        total = sum(self._total.values())
        self._progress(CampaignProgress(name, runs, self._total[name], total, resumed))
