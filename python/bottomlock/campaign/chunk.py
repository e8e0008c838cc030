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
from bottomlock.campaign.closed_loop import run_closed_loop
from bottomlock.campaign.partition import RunRange
from bottomlock.campaign.selector_counts import choice_counts
from bottomlock.plant import Flight
from bottomlock.plant.closed_loop import cross_track_m
from bottomlock.simulation.build import Simulation, trajectory_key
from bottomlock.simulation.measurement_schedule import measurement_schedule
from bottomlock.statistics.rms import rms
from bottomlock.tables.campaign import BIASES, OUTCOMES, SAMPLES
from bottomlock.truth.truth import Truth


@dataclass(frozen=True)
class Chunk:
    """A unit of work: some runs in a world. Flown again, it gives the same bits."""

    simulation: Simulation
    span: RunRange

    @property
    def name(self) -> str:
        """The scenario's name."""
        return self.simulation.scenario.name

    @property
    def on_estimate(self) -> bool:
        """Whether its vehicles fly on what they believe."""
        return self.simulation.scenario.trajectory.feedback == "estimate"


@dataclass(frozen=True)
class ChunkResult:
    """The tables of a chunk (`tables.campaign`: SAMPLES, CHOICES, OUTCOMES), seconds in the kernel and in all."""

    samples: pl.DataFrame
    choices: pl.DataFrame
    counts: pl.DataFrame
    kernel_s: float
    work_s: float


def run_chunk(
    chunk: Chunk,
    *,
    threads: int = 1,
    progress: Callable[[float], None] = lambda _: None,
    kernel_lock: AbstractContextManager[Any] | None = None,
) -> ChunkResult:
    """Flies the runs of a chunk with every method.

    Args:
        chunk: what to fly.
        threads: 0 for as many as there are cores. The numbers do not depend on it.
        tell: hears the part that is behind, 0 to 1, where a chunk takes its time.
        turn: entered while the kernel works, which has all threads for itself.

    Raises:
        KernelError: for input that the kernel refuses, naming run and method.
    """
    scenario = chunk.simulation.scenario
    fly = _on_estimate if chunk.on_estimate else _on_truth
    with kernel_lock or nullcontext():
        started = time.perf_counter()
        result = fly(chunk, threads, progress)
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
    return ChunkResult(samples, choices, counts, kernel_s, time.perf_counter() - started)


@dataclass(frozen=True)
class SharedTruth:
    """What all runs on the truth share: the truth, and the cross-track error of a vehicle that swam it."""

    truth: Truth
    offset_m: np.ndarray[Any, Any] | None


@dataclass(frozen=True)
class _Known:
    """A world that is recognised by its content."""

    fingerprint: str
    simulation: Simulation = field(compare=False)


@lru_cache(maxsize=2)
def _course(known: _Known) -> SharedTruth:
    """A truth is made once per process, not once per chunk: chunks come as copies of one world."""
    simulation = known.simulation
    if simulation.vehicle is None:
        return SharedTruth(simulation.truth(), None)
    flight = simulation.flight()
    return SharedTruth(flight.truth, _offset_m(flight))


def true_course(simulation: Simulation) -> Truth:
    """The truth of a world, remembered where its runs have been flown in this process."""
    return _course(_Known(simulation.fingerprint(), simulation)).truth


def _on_truth(chunk: Chunk, threads: int, _tell: Callable[[float], None]) -> dict[str, Any]:
    """Runs that share one truth."""
    simulation, span, scenario = chunk.simulation, chunk.span, chunk.simulation.scenario
    course = _course(_Known(simulation.fingerprint(), simulation))
    key = trajectory_key(scenario.name)
    plan: Any = measurement_schedule(
        simulation, course.truth, trajectory_key=key, first_run=span.first_run, runs=span.runs
    )
    model: Any = scenario.kernel_model(simulation.gravity_mps2)
    options: Any = scenario.kernel_options()
    truth: Any = course.truth.kernel_arrays()
    result = kernel.run_batch(
        simulation.geometry, truth, model, model, options, plan, list(scenario.campaign.methods),
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


def _on_estimate(chunk: Chunk, threads: int, progress: Callable[[float], None]) -> dict[str, Any]:
    """Runs whose vehicles fly on what they believe."""
    scenario = chunk.simulation.scenario
    return run_closed_loop(
        chunk.simulation,
        scenario.campaign.methods,
        pilot=scenario.trajectory.pilot,
        trajectory_key=trajectory_key(scenario.name),
        first_run=chunk.span.first_run,
        runs=chunk.span.runs,
        threads=threads,
        progress=progress,
    )


def _offset_m(flight: Flight) -> np.ndarray[Any, Any]:
    """Cross-track error of a flight on the truth, five times a second as of those on an estimate."""
    passage = flight.passage
    every = max(1, round(len(passage.time_ns) / (flight.mission.duration_s * 5.0)))
    return cross_track_m(flight.mission, passage.segment[::every], passage.state[::every, :3])


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
        else np.stack([rms(offset, axis=-1), np.abs(offset).max(axis=-1)])
    )
    counts = keys.with_columns(
        pl.lit(name).alias("trajectory"),
        pl.Series("nis_mean_over_fixes", result["nis_mean"].reshape(-1)).fill_nan(None),
        pl.Series("fixes_accepted", result["fixes_accepted"].reshape(-1)),
        pl.Series("fixes_rejected", result["fixes_rejected"].reshape(-1)),
        pl.Series("cross_track_rms_over_time_m", astray[0].reshape(-1)).fill_nan(None),
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
