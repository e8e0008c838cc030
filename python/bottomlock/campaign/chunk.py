"""A chunk: runs of one scenario, flown to two tables. It depends on nothing but itself and can be sent elsewhere."""

import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
import polars as pl

from bottomlock import kernel
from bottomlock.campaign.closed_loop import fly_on_estimates
from bottomlock.campaign.partition import Span
from bottomlock.campaign.selector_counts import choice_counts
from bottomlock.plant import Flight
from bottomlock.plant.closed_loop import cross_track_m
from bottomlock.simulation.build import World, trajectory_key
from bottomlock.simulation.measurement_schedule import schedule
from bottomlock.tables.schema import BIASES, OUTCOMES, SAMPLES
from bottomlock.truth.trajectory import Truth


@dataclass(frozen=True)
class Chunk:
    """A unit of work: some runs in a world. Flown again, it gives the same bits."""

    world: World
    span: Span

    @property
    def name(self) -> str:
        """The scenario's name."""
        return self.world.scenario.name

    @property
    def on_estimate(self) -> bool:
        """Whether its vehicles fly on what they believe."""
        return self.world.scenario.trajectory.feedback == "estimate"


@dataclass(frozen=True)
class Flown:
    """The tables of a chunk (`schema.SAMPLES`, `CHOICES`, `OUTCOMES`), seconds in the kernel and altogether."""

    samples: pl.DataFrame
    choices: pl.DataFrame
    counts: pl.DataFrame
    kernel_s: float
    work_s: float


def fly_chunk(
    chunk: Chunk,
    *,
    threads: int = 1,
    tell: Callable[[float], None] = lambda _: None,
    turn: AbstractContextManager[Any] | None = None,
) -> Flown:
    """Flies the runs of a chunk with every method.

    Args:
        chunk: what to fly.
        threads: 0 for as many as there are cores. The numbers do not depend on it.
        tell: hears the part that is behind, 0 to 1, where a chunk takes its time.
        turn: entered while the kernel works, which has all threads for itself.

    Raises:
        KernelError: for input that the kernel refuses, naming run and method.
    """
    scenario = chunk.world.scenario
    fly = _on_estimate if chunk.on_estimate else _on_truth
    with turn or nullcontext():
        started = time.perf_counter()
        result = fly(chunk, threads, tell)
        kernel_s = time.perf_counter() - started
    samples, counts = _frames(
        result,
        name=scenario.name,
        methods=scenario.campaign.methods,
        first_run=chunk.span.first_run,
        sample_time_ns=result["sample_time_ns"],
    )
    choices = choice_counts(
        result["choice"],
        trajectory=scenario.name,
        methods=scenario.campaign.methods,
        dvl_time_ns=result["dvl_time_ns"],
    )
    return Flown(samples, choices, counts, kernel_s, time.perf_counter() - started)


@dataclass(frozen=True)
class _Course:
    """What all runs on the truth share: the truth, and the cross-track error of a vehicle that swam it."""

    truth: Truth
    offset_m: np.ndarray[Any, Any] | None


@dataclass(frozen=True)
class _Known:
    """A world that is recognised by its content."""

    fingerprint: str
    world: World = field(compare=False)


@lru_cache(maxsize=2)
def _course(known: _Known) -> _Course:
    """A truth is made once per process, not once per chunk: chunks come as copies of one world."""
    world = known.world
    if world.vehicle is None:
        return _Course(world.truth(), None)
    flight = world.flight()
    return _Course(flight.truth, _offset_m(flight))


def true_course(world: World) -> Truth:
    """The truth of a world, remembered where its runs have been flown in this process."""
    return _course(_Known(world.fingerprint(), world)).truth


def _on_truth(chunk: Chunk, threads: int, _tell: Callable[[float], None]) -> dict[str, Any]:
    """Runs that share one truth."""
    world, span, scenario = chunk.world, chunk.span, chunk.world.scenario
    course = _course(_Known(world.fingerprint(), world))
    key = trajectory_key(scenario.name)
    plan: Any = schedule(world, course.truth, trajectory_key=key, first_run=span.first_run, runs=span.runs)
    model: Any = scenario.kernel_model(world.gravity_mps2)
    options: Any = scenario.kernel_options()
    truth: Any = course.truth.kernel_arrays()
    result = kernel.run_batch(
        world.geometry, truth, model, model, options, plan, list(scenario.campaign.methods),
        seed=scenario.campaign.seed, trajectory_key=key, first_run=span.first_run, runs=span.runs,
        threads=threads,
    )  # fmt: skip
    offset = course.offset_m
    if offset is not None:
        offset = np.broadcast_to(offset, (span.runs, len(scenario.campaign.methods), len(offset)))
    return {
        **result,
        "cross_track_m": offset,
        **{key: plan[key] for key in ("sample_time_ns", "dvl_time_ns")},
    }


def _on_estimate(chunk: Chunk, threads: int, tell: Callable[[float], None]) -> dict[str, Any]:
    """Runs whose vehicles fly on what they believe."""
    scenario = chunk.world.scenario
    return fly_on_estimates(
        chunk.world,
        scenario.campaign.methods,
        pilot=scenario.trajectory.pilot,
        trajectory_key=trajectory_key(scenario.name),
        first_run=chunk.span.first_run,
        runs=chunk.span.runs,
        threads=threads,
        tell=tell,
    )


def _offset_m(flight: Flight) -> np.ndarray[Any, Any]:
    """Cross-track error of a flight on the truth, five times a second as of those on an estimate."""
    history = flight.history
    every = max(1, round(len(history.time_ns) / (flight.mission.duration_s * 5.0)))
    return cross_track_m(flight.mission, history.segment[::every], history.state[::every, :3])


def _frames(
    result: dict[str, Any],
    *,
    name: str,
    methods: Sequence[str],
    first_run: int,
    sample_time_ns: np.ndarray[Any, Any],
) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Samples and fix counts of one kernel call as tables; its `cross_track_m` (runs, methods, ticks) may be None."""
    runs, method_count, samples = result["nees"].shape
    keys = pl.DataFrame(
        {
            "run": np.repeat(np.arange(first_run, first_run + runs), method_count),
            "method": list(methods) * runs,
        }
    )
    offset = result["cross_track_m"]
    astray = (
        np.full((2, runs, method_count), np.nan)
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
        *(
            pl.Series(f"{kind}_{bias}", result[key][:, :, k].reshape(-1)).fill_nan(None)
            for kind, key in (("err", "final_bias_error"), ("sd", "final_bias_sd"))
            for k, bias in enumerate(BIASES)
        ),
    ).select(list(OUTCOMES))
    # Columns as they lie in memory already, where they come from a batch.
    columns = {
        name: values[..., k].reshape(-1)
        for prefix, values in (("err_", result["error"]), ("sd_", result["sd"]))
        for k, name in enumerate(name for name in SAMPLES if name.startswith(prefix))
    }
    frame = pl.DataFrame(
        {
            "run": np.repeat(keys["run"].to_numpy(), samples),
            "method": np.repeat(np.arange(runs * method_count) % method_count, samples),
            "time_ns": np.tile(sample_time_ns, runs * method_count),
            **columns,
            "nees": result["nees"].reshape(-1),
            "nees_velocity_attitude": result["nees_velocity_attitude"].reshape(-1),
        }
    )
    names = pl.col("method").replace_strict(range(method_count), list(methods), return_dtype=pl.String)
    return frame.with_columns(names, pl.lit(name).alias("trajectory")).select(list(SAMPLES)), counts
