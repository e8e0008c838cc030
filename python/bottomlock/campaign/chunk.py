"""One chunk: runs of one scenario to tables. It needs only the built scenario and can run anywhere."""

import time
from collections.abc import Callable, Generator
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
import polars as pl

from bottomlock import kernel, own_method
from bottomlock.campaign.build import BuiltScenario
from bottomlock.campaign.closed_loop import run_closed_loop
from bottomlock.campaign.partition import Chunk
from bottomlock.campaign.reckoned import with_reckoning
from bottomlock.campaign.selector_counts import choice_counts
from bottomlock.own_method import DEAD_RECKONING
from bottomlock.simulation.build import trajectory_key
from bottomlock.simulation.measurement_schedule import measurement_schedule
from bottomlock.statistics.rms import rms
from bottomlock.tables.campaign import BIASES, OUTCOMES, SAMPLES

NEES = ("nees", "nees_velocity_attitude")
FIXES = ("fixes_accepted", "fixes_rejected", "fixes_beyond_linear_range")


@dataclass(frozen=True)
class ChunkResult:
    """The tables of a chunk.

    Attributes:
        samples: `tables.campaign.SAMPLES`, a row per run, method and second.
        choices: `tables.campaign.CHOICES`, the choices of the selectors.
        counts: `tables.campaign.OUTCOMES`, a row per run and method.
        kernel_s: seconds in the kernel; zero for a chunk that was read.
        work_s: seconds in all; zero for a chunk that was read.
        directory: the campaign directory that holds its files; None for a chunk that was computed.
    """

    samples: pl.DataFrame
    choices: pl.DataFrame
    counts: pl.DataFrame
    kernel_s: float = 0.0
    work_s: float = 0.0
    directory: Path | None = None


ChunkResults = Generator[tuple[Chunk, ChunkResult], None, None]


def run_chunk(
    built: BuiltScenario,
    chunk: Chunk,
    *,
    threads: int = 1,
    progress: Callable[[float], None] = lambda _: None,
    stop: Event | None = None,
) -> ChunkResult:
    """Runs a chunk with every method of its scenario; run again, it gives the same bits.

    Args:
        built: the scenario.
        chunk: the runs.
        threads: 0 for as many as there are cores. The numbers do not depend on it.
        progress: called with the fraction done, 0 to 1, during a chunk in closed loop.
        stop: ends the kernel call early, with KernelError, once another thread has set it.

    Raises:
        KernelError: for input that the kernel rejects, naming run and method.
    """
    for place in built.scenario.campaign.own_methods:
        # In a worker process nothing has read the scenario's text.
        own_method.load(place)
    started = time.perf_counter()
    result = (
        _closed_loop(built, chunk, threads, progress)
        if built.closed_loop
        else _on_truth(built, chunk, threads, stop)
    )
    kernel_s = time.perf_counter() - started
    methods = built.scenario.campaign.methods
    keys = pl.DataFrame(
        {
            "run": np.repeat(np.arange(chunk.first_run, chunk.first_run + chunk.runs), len(methods)),
            "method": list(methods) * chunk.runs,
        }
    ).with_columns(pl.lit(chunk.scenario).alias("trajectory"))
    samples = _of_filters(_samples(result, keys), NEES)
    counts = _of_filters(_outcomes(result, keys), FIXES)
    choices = choice_counts(
        result["choice"], trajectory=chunk.scenario, methods=methods, dvl_time_ns=result["dvl_time_ns"]
    )
    return ChunkResult(samples, choices, counts, kernel_s, time.perf_counter() - started)


def _of_filters(table: pl.DataFrame, columns: tuple[str, ...]) -> pl.DataFrame:
    """The table with columns that only a filter has null for dead reckoning."""
    if not (table["method"] == DEAD_RECKONING).any():
        return table
    return table.with_columns(pl.when(pl.col("method") != DEAD_RECKONING).then(pl.col(columns)))


def _on_truth(built: BuiltScenario, chunk: Chunk, threads: int, stop: Event | None) -> dict[str, Any]:
    """Runs that share one truth."""
    simulation, scenario = built.simulation, built.scenario
    methods = list(scenario.campaign.methods)
    filters = [method for method in methods if method != DEAD_RECKONING]
    key = trajectory_key(scenario.name)
    schedule: Any = measurement_schedule(
        simulation, built.truth, trajectory_key=key, first_run=chunk.first_run, runs=chunk.runs
    )
    model, options = scenario.kernel_model(simulation.gravity_mps2), scenario.kernel_options()
    truth: Any = built.truth.kernel_arrays()
    result: Any = kernel.run_batch(
        simulation.geometry, truth, model, model, options, schedule, filters,
        seed=scenario.campaign.seed, trajectory_key=key, first_run=chunk.first_run, runs=chunk.runs,
        threads=threads, stop=stop,
    )  # fmt: skip
    if filters != methods:
        result = with_reckoning(result, built, chunk, schedule, model, options)
    offset = built.cross_track_m
    if offset is not None:
        offset = np.broadcast_to(offset, (chunk.runs, len(methods), len(offset)))
    return {
        **result,
        "cross_track_m": offset,
        "sample_time_ns": schedule["sample_time_ns"],
        "dvl_time_ns": schedule["dvl_time_ns"],
    }


def _closed_loop(
    built: BuiltScenario, chunk: Chunk, threads: int, progress: Callable[[float], None]
) -> dict[str, Any]:
    """Runs whose vehicles are guided on an estimate."""
    scenario = built.scenario
    return run_closed_loop(
        built.simulation,
        scenario.campaign.methods,
        pilot=scenario.trajectory.pilot,
        trajectory_key=trajectory_key(scenario.name),
        first_run=chunk.first_run,
        runs=chunk.runs,
        threads=threads,
        progress=progress,
    )


def _outcomes(result: dict[str, Any], keys: pl.DataFrame) -> pl.DataFrame:
    """A row per run and method (`tables.campaign.OUTCOMES`); `cross_track_m` (runs, methods, ticks) may be None."""
    offset = result["cross_track_m"]
    if offset is None:
        cross_track = np.full((2, keys.height), np.nan)
    else:
        extremes = [rms(offset, axis=-1), np.abs(offset).max(axis=-1)]
        cross_track = np.stack(extremes).reshape(2, -1)
    return keys.with_columns(
        pl.Series("nis_mean_over_fixes", result["nis_mean"].reshape(-1)).fill_nan(None),
        pl.Series("fixes_accepted", result["fixes_accepted"].reshape(-1)),
        pl.Series("fixes_rejected", result["fixes_rejected"].reshape(-1)),
        pl.Series("fixes_beyond_linear_range", result["fixes_beyond_linear_range"].reshape(-1)),
        pl.Series("cross_track_rms_over_time_m", cross_track[0]).fill_nan(None),
        pl.Series("cross_track_max_m", cross_track[1]).fill_nan(None),
        *(
            pl.Series(f"{kind}_{bias}", result[key][:, :, k].reshape(-1)).fill_nan(None)
            for kind, key in (("err", "final_bias_error"), ("sd", "final_bias_sd"))
            for k, bias in enumerate(BIASES)
        ),
    ).select(list(OUTCOMES))


def _samples(result: dict[str, Any], keys: pl.DataFrame) -> pl.DataFrame:
    """A row per run, method and second (`tables.campaign.SAMPLES`)."""
    samples = result["nees"].shape[-1]
    columns = {
        name: values[..., k].reshape(-1).astype(np.float32)
        for prefix, values in (("err_", result["error"]), ("sd_", result["sd"]))
        for k, name in enumerate(name for name in SAMPLES if name.startswith(prefix))
    }
    methods = keys["method"].unique(maintain_order=True).to_list()
    frame = pl.DataFrame(
        {
            "run": np.repeat(keys["run"].to_numpy(), samples),
            "method": np.repeat(np.arange(keys.height) % len(methods), samples),
            "time_ns": np.tile(result["sample_time_ns"], keys.height),
            **columns,
            **{name: result[name].reshape(-1).astype(np.float32) for name in NEES},
        }
    )
    names = pl.col("method").replace_strict(range(len(methods)), methods, return_dtype=pl.String)
    return frame.with_columns(names, pl.lit(keys["trajectory"][0]).alias("trajectory")).select(list(SAMPLES))
