"""A Monte Carlo campaign: scenarios x runs x arms to tables, in chunks that survive an interruption.

Chunk boundaries depend on the scenario alone, never on threads; a run's numbers depend on nothing but the seed, the
trajectory's name and the run's number. So any cutting, any number of threads and any resumption give the same bits.
"""

import hashlib
import json
import platform
import shutil
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from bottomlock import kernel, stats
from bottomlock.choices import choice_counts, merged
from bottomlock.conditions import schedule
from bottomlock.errors import OutputError, ScenarioError
from bottomlock.feedback import fly_on_estimates
from bottomlock.output import read_json, write_json, write_parquet
from bottomlock.plant import Flight
from bottomlock.plant.closed_loop import cross_track_m
from bottomlock.scenario import Scenario
from bottomlock.schema import FIXES_COUNTS, PATHS, SAMPLES
from bottomlock.trajectory import Truth
from bottomlock.world import World, make_world, trajectory_key

CHUNK_STEPS = 6_000_000
"""Filter steps of one kernel call: a second or two of one core, so that progress and interruption stay lively."""

FLEET_VEHICLES = 512
"""Vehicles that fly on estimates side by side: more cost less each, and more is lost with an unfinished chunk."""


_TIMES = ("sample_time_ns", "dvl_time_ns")


@dataclass(frozen=True)
class Progress:
    """What a campaign tells while it runs; runs under way count in part."""

    trajectory: str
    runs_done: float
    runs_total: int


@dataclass(frozen=True)
class Results:
    """The tables of a finished campaign."""

    runs: pl.DataFrame
    ensemble: pl.DataFrame
    consistency: pl.DataFrame
    manifest: dict[str, Any]


@dataclass
class _Clock:
    """Wall time inside and outside the kernel."""

    started: float = field(default_factory=time.perf_counter)
    kernel_s: float = 0.0
    batch_s: float = 0.0

    @property
    def wall_s(self) -> float:
        return time.perf_counter() - self.started


def configuration_hash(worlds: Sequence[World]) -> str:
    """SHA-256 of all that decides the numbers of a campaign, apart from the number of runs."""
    content = [
        (w.scenario.name, w.fingerprint(), w.scenario.campaign.seed, list(w.scenario.campaign.arms))
        for w in worlds
    ]
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()


def _chunk_frames(
    result: dict[str, Any],
    *,
    name: str,
    arms: Sequence[str],
    first_run: int,
    sample_time_ns: np.ndarray[Any, Any],
) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Samples and fix counts of one kernel call as tables; its `cross_track_m` (runs, arms, ticks) may be None."""
    runs, arm_count, samples = result["nees"].shape
    keys = pl.DataFrame(
        {"run": np.repeat(np.arange(first_run, first_run + runs), arm_count), "arm": list(arms) * runs}
    )
    offset = result["cross_track_m"]
    astray = (
        np.full((2, runs, arm_count), np.nan)
        if offset is None
        else np.stack([np.sqrt((offset**2).mean(axis=-1)), np.abs(offset).max(axis=-1)])
    )
    counts = keys.with_columns(
        pl.lit(name).alias("trajectory"),
        pl.Series("nis_mean", result["nis_mean"].reshape(-1)).fill_nan(None),
        pl.Series("fixes_accepted", result["fixes_accepted"].reshape(-1)),
        pl.Series("fixes_rejected", result["fixes_rejected"].reshape(-1)),
        pl.Series("cross_track_rms_m", astray[0].reshape(-1)).fill_nan(None),
        pl.Series("cross_track_max_m", astray[1].reshape(-1)).fill_nan(None),
    ).select(list(FIXES_COUNTS))
    values = np.concatenate([result["error"], result["sd"]], axis=-1).reshape(-1, 18)
    columns = dict(zip([name for name in SAMPLES if name.startswith(("err_", "sd_"))], values.T, strict=True))
    frame = pl.DataFrame(
        {
            "run": np.repeat(keys["run"].to_numpy(), samples),
            "arm": np.repeat(np.arange(runs * arm_count) % arm_count, samples),
            "time_ns": np.tile(sample_time_ns, runs * arm_count),
            **columns,
            "nees": result["nees"].reshape(-1),
            "nees_velocity_attitude": result["nees_velocity_attitude"].reshape(-1),
        }
    )
    names = pl.col("arm").replace_strict(range(arm_count), list(arms), return_dtype=pl.String)
    return frame.with_columns(names, pl.lit(name).alias("trajectory")).select(list(SAMPLES)), counts


def _prepare(out: Path, worlds: Sequence[World], *, force: bool) -> None:
    """Makes sure that the directory is ours: empty, or of the same configuration."""
    manifest_path = out / "manifest.json"
    try:
        occupied = out.exists() and (not out.is_dir() or any(out.iterdir()))
    except OSError as error:
        raise OutputError(f"{out}: cannot be read ({error.strerror})") from error
    if occupied:
        manifest = read_json(manifest_path) if out.is_dir() else None
        if manifest is None or "configuration_hash" not in manifest:
            raise OutputError(f"{out}: is not empty and holds no campaign of ours; choose another directory")
        same = manifest["configuration_hash"] == configuration_hash(worlds)
        if (not same or manifest.get("version") != kernel.kernel_version()) and not force:
            what = "another configuration" if not same else f"version {manifest.get('version')}"
            raise OutputError(
                f"{out}: holds a campaign of {what}; choose another directory or use --force to start over"
            )
        if force:
            for part in (
                "chunks",
                "runs.parquet",
                "ensemble.parquet",
                "consistency.parquet",
                "choices.parquet",
                "truth.parquet",
                "manifest.json",
            ):
                path = out / part
                shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)


def _manifest(worlds: Sequence[World], clock: _Clock, *, status: str, threads: int) -> dict[str, Any]:
    scenarios = [world.scenario for world in worlds]
    return {
        "status": status,
        "version": kernel.kernel_version(),
        "versions": {"python": platform.python_version(), "numpy": np.__version__, "polars": pl.__version__},
        "configuration_hash": configuration_hash(worlds),
        "threads": threads,
        "wall_time_s": round(clock.wall_s, 3),
        "kernel_time_s": round(clock.kernel_s, 3),
        "batch_time_s": round(clock.batch_s, 3),
        "python_share_of_batch": round(1.0 - clock.kernel_s / clock.batch_s, 4)
        if clock.batch_s > 0.0
        else None,
        "nees_degrees": {s.name: 20 if s.filter.estimate_dvl else 15 for s in scenarios},
        "scenarios": {
            s.name: {
                "seed": s.campaign.seed,
                "runs": s.campaign.runs,
                "arms": list(s.campaign.arms),
                "trajectory_key": str(trajectory_key(s.name)),
                "configuration": s.model_dump(mode="json"),
                "options": s.kernel_options(),
            }
            for s in scenarios
        },
    }


@dataclass(frozen=True)
class _Chunk:
    """Runs that are flown and written together."""

    first_run: int
    runs: int

    @property
    def stem(self) -> str:
        return f"{self.first_run:08d}-{self.first_run + self.runs - 1:08d}.parquet"


def _chunks(scenario: Scenario) -> list[_Chunk]:
    """The chunks of a scenario: they depend on it alone."""
    trajectory, settings = scenario.trajectory, scenario.campaign
    steps = round(trajectory.duration_s * scenario.imu.rate_hz) + 1
    size = CHUNK_STEPS // (steps * len(settings.arms))
    if trajectory.feedback == "estimate":
        size = FLEET_VEHICLES // (len(settings.arms) if trajectory.pilot == "own" else 1)
    size = max(1, size)
    return [_Chunk(first, min(size, settings.runs - first)) for first in range(0, settings.runs, size)]


class _OnTruth:
    """Chunks of runs that share one truth."""

    def __init__(self, world: World) -> None:
        flight = world.flight() if world.vehicle is not None else None
        self._world = world
        self._truth: Truth = world.truth() if flight is None else flight.truth
        self._offset_m = None if flight is None else _offset_m(flight)

    def __call__(self, chunk: _Chunk, threads: int, _tell: Callable[[float], None]) -> dict[str, Any]:
        world, scenario = self._world, self._world.scenario
        key = trajectory_key(scenario.name)
        plan: Any = schedule(
            world, self._truth, trajectory_key=key, first_run=chunk.first_run, runs=chunk.runs
        )
        model: Any = scenario.kernel_model(world.gravity_mps2)
        options: Any = scenario.kernel_options()
        truth: Any = self._truth.kernel_arrays()
        result = kernel.run_batch(
            world.geometry, truth, model, model, options, plan, list(scenario.campaign.arms),
            seed=scenario.campaign.seed, trajectory_key=key, first_run=chunk.first_run, runs=chunk.runs,
            threads=threads,
        )  # fmt: skip
        offset = (
            None
            if self._offset_m is None
            else np.broadcast_to(
                self._offset_m, (chunk.runs, len(scenario.campaign.arms), len(self._offset_m))
            )
        )
        return {**result, "cross_track_m": offset, **{key: plan[key] for key in _TIMES}}


class _OnEstimate:
    """Chunks of runs whose vehicles fly on what they believe."""

    def __init__(self, world: World) -> None:
        self._world = world

    def __call__(self, chunk: _Chunk, threads: int, tell: Callable[[float], None]) -> dict[str, Any]:
        scenario = self._world.scenario
        return fly_on_estimates(
            self._world,
            scenario.campaign.arms,
            pilot=scenario.trajectory.pilot,
            trajectory_key=trajectory_key(scenario.name),
            first_run=chunk.first_run,
            runs=chunk.runs,
            threads=threads,
            tell=tell,
        )


def _offset_m(flight: Flight) -> np.ndarray[Any, Any]:
    """Cross-track error of a flight on the truth, five times a second as of those on an estimate."""
    passage = flight.passage
    every = max(1, round(len(passage.time_ns) / (flight.mission.duration_s * 5.0)))
    return cross_track_m(flight.mission, passage.segment[::every], passage.state[::every, :3])


def _fly(
    world: World, folder: Path, clock: _Clock, *, threads: int, tell: Callable[[Progress], None]
) -> None:
    """Works off the chunks of one scenario that are not there yet."""
    scenario = world.scenario
    fly: _OnTruth | _OnEstimate | None = None
    for chunk in _chunks(scenario):
        counts_path = folder / f"counts-{chunk.stem}"
        if not counts_path.exists():
            if fly is None:
                fly = (_OnEstimate if scenario.trajectory.feedback == "estimate" else _OnTruth)(world)

            def part(done: float, chunk: _Chunk = chunk) -> None:
                tell(Progress(scenario.name, chunk.first_run + chunk.runs * done, scenario.campaign.runs))

            started = time.perf_counter()
            result = fly(chunk, threads, part)
            clock.kernel_s += time.perf_counter() - started
            samples, counts = _chunk_frames(
                result,
                name=scenario.name,
                arms=scenario.campaign.arms,
                first_run=chunk.first_run,
                sample_time_ns=result["sample_time_ns"],
            )
            choices = choice_counts(
                result["choice"],
                trajectory=scenario.name,
                arms=scenario.campaign.arms,
                dvl_time_ns=result["dvl_time_ns"],
            )
            # The counts come last: a chunk is finished when they are there.
            write_parquet(folder / f"samples-{chunk.stem}", samples)
            write_parquet(folder / f"choices-{chunk.stem}", choices)
            write_parquet(counts_path, counts)
            clock.batch_s += time.perf_counter() - started
        tell(Progress(scenario.name, chunk.first_run + chunk.runs, scenario.campaign.runs))


def _tables(scenario: Scenario, folder: Path) -> tuple[pl.DataFrame, ...]:
    """Statistics of one scenario from its chunks; only the norms are held in memory."""
    stems = [chunk.stem for chunk in _chunks(scenario)]
    norms = pl.concat([stats.error_norms(pl.read_parquet(folder / f"samples-{stem}")) for stem in stems])
    counts = pl.concat([pl.read_parquet(folder / f"counts-{stem}") for stem in stems])
    degrees = 20 if scenario.filter.estimate_dvl else 15
    return (
        stats.runs_table(norms, counts),
        stats.ensemble_table(norms),
        stats.consistency_table(norms, full_degrees=degrees),
        merged([pl.read_parquet(folder / f"choices-{stem}") for stem in stems]),
    )


def _paths(worlds: Sequence[World]) -> pl.DataFrame:
    """Where the vehicle is each second on the truth (`schema.PATHS`); runs that fly on the estimate go astray of it."""
    parts = []
    for world in worlds:
        truth = world.truth()
        every = slice(None, None, max(1, round(world.scenario.imu.rate_hz)))
        north, east, depth = truth.position_t_m[every].T
        columns = {"time_ns": truth.time_ns[every], "north_m": north, "east_m": east, "depth_m": depth}
        parts.append(pl.DataFrame(columns).with_columns(pl.lit(world.scenario.name).alias("trajectory")))
    return pl.concat(parts).select(list(PATHS))


def run_campaign(
    scenarios: Sequence[Scenario],
    out: Path,
    *,
    threads: int = 0,
    force: bool = False,
    tell: Callable[[Progress], None] = lambda _: None,
) -> Results:
    """Runs or resumes a campaign and writes its tables to `out`.

    Writes `runs.parquet`, `ensemble.parquet`, `consistency.parquet`, `manifest.json` and the samples in
    `chunks/`. Finished chunks are kept by an interruption and skipped on resumption.

    Args:
        scenarios: what to fly, with different names.
        out: directory; new, empty, or of the same configuration.
        threads: 0 for as many as there are cores. The numbers do not depend on it.
        force: start over in a directory of another configuration.
        tell: hears of every finished chunk.

    Raises:
        ScenarioError: for two scenarios of one name, and for what `make_world` refuses.
        OutputError: for a directory that is not ours or cannot be written.
        KernelError: for input that the kernel refuses, naming run and arm.
    """
    names = [scenario.name for scenario in scenarios]
    if not names or len(set(names)) != len(names):
        raise ScenarioError(f"expected scenarios of different names, got {names}")
    worlds = [make_world(scenario) for scenario in scenarios]
    _prepare(out, worlds, force=force)
    clock = _Clock()
    write_json(out / "manifest.json", _manifest(worlds, clock, status="running", threads=threads))
    parts = []
    for world in worlds:
        folder = out / "chunks" / world.scenario.name
        _fly(world, folder, clock, threads=threads, tell=tell)
        parts.append(_tables(world.scenario, folder))
    runs, ensemble, consistency, choices = (pl.concat(tables) for tables in zip(*parts, strict=True))
    write_parquet(out / "runs.parquet", runs)
    write_parquet(out / "ensemble.parquet", ensemble)
    write_parquet(out / "consistency.parquet", consistency)
    write_parquet(out / "choices.parquet", choices)
    write_parquet(out / "truth.parquet", _paths(worlds))
    manifest = _manifest(worlds, clock, status="complete", threads=threads)
    write_json(out / "manifest.json", manifest)
    return Results(runs=runs, ensemble=ensemble, consistency=consistency, manifest=manifest)
