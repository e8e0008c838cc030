"""A Monte Carlo campaign: scenarios x runs x methods to tables, in chunks that survive an interruption.

Chunk boundaries depend on the scenario alone, never on threads, shards or the engine; a run's numbers depend on nothing
but the seed, the trajectory's name and the run's number. So any cutting, any engine and any resumption give the same
bits.
"""

import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl
from threadpoolctl import threadpool_limits

from bottomlock.atomic_write import write_json, write_parquet
from bottomlock.campaign.aggregate import Results, finish, open_tallies
from bottomlock.campaign.chunk import Chunk, ChunkResult, true_course
from bottomlock.campaign.directory import MANIFEST, TRUTH, is_finished, prepare, write_chunk
from bottomlock.campaign.engine import Engine, open_engine
from bottomlock.campaign.manifest import Clock, configuration_hash, describe
from bottomlock.campaign.partition import Partition, RunRange, Shard
from bottomlock.config.scenario import Scenario
from bottomlock.errors import ScenarioError
from bottomlock.simulation.build import Simulation, build_simulation
from bottomlock.tables.campaign import PATHS


@dataclass(frozen=True)
class CampaignProgress:
    """What a campaign tells while it runs; runs under way count in part, `found` are those of an earlier start."""

    trajectory: str
    runs_done: float
    runs_total: int
    found: bool = False


def run_campaign(
    scenarios: Sequence[Scenario],
    out: Path,
    *,
    threads: int = 0,
    engine: str = "local",
    scheduler: str | None = None,
    force: bool = False,
    progress: Callable[[CampaignProgress], None] = lambda _: None,
) -> Results:
    """Runs or resumes a campaign and writes its tables to `out`.

    Writes `runs.parquet`, `ensemble.parquet`, `consistency.parquet`, `manifest.json` and the samples in
    `chunks/`. Finished chunks are kept by an interruption and skipped on resumption.

    Args:
        scenarios: what to fly, with different names.
        out: directory; new, empty, or of the same configuration.
        threads: 0 for as many as there are cores. The numbers do not depend on it.
        engine: "local" or "dask", see `engine.open_engine`. The numbers do not depend on it.
        scheduler: address of a Dask scheduler.
        force: start over in a directory of another configuration.
        tell: hears of every finished chunk.

    Raises:
        ScenarioError: for two scenarios of one name, and for what `build_simulation` refuses.
        OutputError: for a directory that is not ours or cannot be written.
        DataError: for a chunk on disk that is damaged.
        EngineError: for an engine that is not there or breaks down.
        KernelError: for input that the kernel refuses, naming run and method.
    """
    with open_tallies(out, [Partition.of(scenario) for scenario in scenarios]) as tallies:

        def note(name: str, span: RunRange, flown: ChunkResult) -> None:
            tallies[name].take(span, flown.samples, flown.counts, flown.choices)

        manifest = _flown(
            scenarios, out, None, threads, engine, scheduler, force=force, progress=progress, note=note
        )
        return finish(out, tallies, manifest("complete"))


def run_shard(
    scenarios: Sequence[Scenario],
    out: Path,
    shard: Shard,
    *,
    threads: int = 0,
    engine: str = "local",
    scheduler: str | None = None,
    force: bool = False,
    progress: Callable[[CampaignProgress], None] = lambda _: None,
) -> dict[str, Any]:
    """Runs or resumes one shard of a campaign; `merge.merge_shards` joins all of them to the campaign.

    `out` gets the shard's chunks and a manifest of status "shard", and no tables. Everything else is as for
    `run_campaign`.

    Returns:
        The manifest.
    """
    manifest = _flown(scenarios, out, shard, threads, engine, scheduler, force=force, progress=progress)
    finished = manifest("shard")
    write_json(out / MANIFEST, finished)
    return finished


def _flown(
    scenarios: Sequence[Scenario],
    out: Path,
    shard: Shard | None,
    threads: int,
    engine: str,
    scheduler: str | None,
    *,
    force: bool,
    progress: Callable[[CampaignProgress], None],
    note: Callable[[str, RunRange, ChunkResult], None] = lambda _name, _span, _flown: None,
) -> Callable[[str], dict[str, Any]]:
    """Flies what is not there yet, while `note` hears of every chunk; returns the manifest for a status."""
    simulations = _worlds(scenarios)
    clock = Clock()

    def manifest(status: str) -> dict[str, Any]:
        return describe(simulations, status=status, threads=threads, engine=engine, shard=shard, clock=clock)

    # The engine comes first: nothing is written, let alone removed, for a cluster that is not there.
    with open_engine(engine, threads=threads, scheduler=scheduler) as opened:
        prepare(out, configuration_hash(simulations), shard=shard, force=force)
        write_json(out / MANIFEST, manifest("running"))
        _fly(_chunks(simulations, shard), out, opened, clock, progress, note)
    write_parquet(out / TRUTH, _paths(simulations))
    return manifest


def runs_to_fly(scenarios: Sequence[Scenario], shard: Shard | None = None) -> int:
    """How many runs a campaign or one shard of it has."""
    spans = [span for scenario in scenarios for span in Partition.of(scenario).spans()]
    return sum(span.runs for number, span in enumerate(spans) if shard is None or shard.takes(number))


def _paths(simulations: Sequence[Simulation]) -> pl.DataFrame:
    """Where the vehicle is each second on the truth (`tables.campaign.PATHS`); runs steered by the estimate differ."""
    parts = []
    for simulation in simulations:
        truth = true_course(simulation)
        every = slice(None, None, max(1, round(simulation.scenario.imu.rate_hz)))
        north, east, depth = truth.position_t_m[every].T
        columns = {"time_ns": truth.time_ns[every], "north_m": north, "east_m": east, "depth_m": depth}
        parts.append(pl.DataFrame(columns).with_columns(pl.lit(simulation.scenario.name).alias("trajectory")))
    return pl.concat(parts).select(list(PATHS))


def _worlds(scenarios: Sequence[Scenario]) -> list[Simulation]:
    names = [scenario.name for scenario in scenarios]
    if not names or len(set(names)) != len(names):
        raise ScenarioError(f"expected scenarios of different names, got {names}")
    # Threads of the BLAS go on turning while they wait for work, on the cores that the kernel wants next.
    with threadpool_limits(limits=1, user_api="blas"):
        return [build_simulation(scenario) for scenario in scenarios]


def _chunks(simulations: Sequence[Simulation], shard: Shard | None = None) -> list[Chunk]:
    chunks = [
        Chunk(simulation, span)
        for simulation in simulations
        for span in Partition.of(simulation.scenario).spans()
    ]
    return [chunk for number, chunk in enumerate(chunks) if shard is None or shard.takes(number)]


def _fly(
    chunks: Sequence[Chunk],
    out: Path,
    engine: Engine,
    clock: Clock,
    progress: Callable[[CampaignProgress], None],
    note: Callable[[str, RunRange, ChunkResult], None],
) -> None:
    """Works off the chunks that are not there yet."""
    total = dict.fromkeys((chunk.name for chunk in chunks), 0)
    done = dict.fromkeys(total, 0)
    missing = []
    for chunk in chunks:
        total[chunk.name] += chunk.span.runs
        if is_finished(out, chunk.name, chunk.span):
            done[chunk.name] += chunk.span.runs
        else:
            missing.append(chunk)
    for name, runs in done.items():
        if runs:
            progress(CampaignProgress(name, runs, total[name], found=True))

    def part(chunk: Chunk, behind: float) -> None:
        progress(CampaignProgress(chunk.name, done[chunk.name] + chunk.span.runs * behind, total[chunk.name]))

    # Closing the engine's generator calls off what is under way when something fails here.
    with closing(engine.fly(missing, part)) as flying:  # type: ignore[type-var]
        for chunk, flown in flying:
            started = time.perf_counter()
            write_chunk(out, chunk.name, chunk.span, flown)
            note(chunk.name, chunk.span, flown)
            clock.kernel_s += flown.kernel_s
            clock.batch_s += flown.work_s + time.perf_counter() - started
            done[chunk.name] += chunk.span.runs
            progress(CampaignProgress(chunk.name, done[chunk.name], total[chunk.name]))
