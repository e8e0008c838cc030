"""One chunk: runs of one scenario to tables. It needs only the built scenario and can run anywhere."""

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from threading import Event
from typing import Any

import numpy as np
import polars as pl

from bottomlock import kernel, own_method
from bottomlock.campaign.build import BuiltScenario
from bottomlock.campaign.closed_loop import run_closed_loop
from bottomlock.campaign.reckoned import with_reckoning
from bottomlock.campaign.selector_counts import choice_counts
from bottomlock.config.scenario import Scenario
from bottomlock.own_method import DEAD_RECKONING
from bottomlock.simulation.build import trajectory_key
from bottomlock.simulation.measurement_schedule import measurement_schedule
from bottomlock.statistics.rms import rms
from bottomlock.tables.campaign import BIASES, OUTCOMES, SAMPLES

CHUNK_STEPS = 12_000_000
"""Filter steps of one kernel call: a second or two of one core, so that progress and interruption stay responsive."""

EVEN_RUNS = 16
"""Larger chunks hold a multiple of this number of runs, which fills the SIMD lanes and shares the threads evenly."""

CLOSED_LOOP_VEHICLES = 512
"""Vehicles simulated side by side in closed loop. More of them cost less each; an unfinished chunk loses more."""

NEES = ("nees", "nees_velocity_attitude")
FIXES = ("fixes_accepted", "fixes_rejected", "fixes_beyond_linear_range")


@dataclass(frozen=True)
class Chunk:
    """Runs of one scenario that are computed and written together."""

    scenario: str
    first_run: int
    runs: int


@dataclass(frozen=True)
class ChunkTables:
    """The tables of a chunk.

    Attributes:
        samples: `tables.campaign.SAMPLES`, a row per run, method and second, in this order.
        choices: `tables.campaign.CHOICES`, the choices of the selectors.
        counts: `tables.campaign.OUTCOMES`, a row per run and method.
    """

    samples: pl.DataFrame
    choices: pl.DataFrame
    counts: pl.DataFrame


ChunkResults = Generator[tuple[Chunk, ChunkTables], None, None]

RunChunks = Callable[[Sequence[Chunk], Callable[[Chunk, float], None]], ChunkResults]
"""Yields every chunk with its tables, in any order; closing the generator cancels what is under way.

The second argument may be called with a chunk under way and the fraction done, 0 to 1."""


def runs_per_chunk(scenario: Scenario) -> int:
    """Size of the chunks, which depends on the scenario alone: not on runs, threads or engine.

    >>> from bottomlock.config.scenario import load_scenario
    >>> runs_per_chunk(load_scenario("straight").with_overrides(methods=["tc"]))
    304
    """
    trajectory, methods = scenario.trajectory, len(scenario.campaign.methods)
    steps = round(trajectory.duration_s * scenario.imu.rate_hz) + 1
    size = CHUNK_STEPS // (steps * methods)
    if trajectory.feedback == "estimate":
        size = CLOSED_LOOP_VEHICLES // (methods if trajectory.pilot == "own" else 1)
    return max(1, size if size < EVEN_RUNS else size - size % EVEN_RUNS)


def chunks_of(scenario: Scenario) -> list[Chunk]:
    """The chunks of a scenario, in the order of their runs."""
    runs, size = scenario.campaign.runs, runs_per_chunk(scenario)
    return [Chunk(scenario.name, first, min(size, runs - first)) for first in range(0, runs, size)]


def run_chunk(
    built: BuiltScenario,
    chunk: Chunk,
    *,
    threads: int = 1,
    progress: Callable[[float], None] = lambda _: None,
    stop: Event | None = None,
) -> ChunkTables:
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
    scenario = built.scenario
    for place in scenario.campaign.own_methods:
        # In a worker process nothing has read the scenario's text.
        own_method.load(place)
    methods = scenario.campaign.methods
    if built.closed_loop:
        result = run_closed_loop(
            built.simulation, methods, pilot=scenario.trajectory.pilot, trajectory_key=trajectory_key(scenario.name),
            first_run=chunk.first_run, runs=chunk.runs, threads=threads, progress=progress,
        )  # fmt: skip
    else:
        result = _on_truth(built, chunk, threads, stop)
    keys = pl.DataFrame(
        {
            "run": np.repeat(np.arange(chunk.first_run, chunk.first_run + chunk.runs), len(methods)),
            "method": list(methods) * chunk.runs,
        }
    ).with_columns(pl.lit(chunk.scenario).alias("trajectory"))
    choices = choice_counts(
        result["choice"], trajectory=chunk.scenario, methods=methods, dvl_time_ns=result["dvl_time_ns"]
    )
    return ChunkTables(
        _of_filters(_samples(result, keys), NEES), choices, _of_filters(_outcomes(result, keys), FIXES)
    )


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
        result = with_reckoning(result, built, chunk.first_run, chunk.runs, schedule, model, options)
    offset = built.cross_track_m
    if offset is not None:
        offset = np.broadcast_to(offset, (chunk.runs, len(methods), len(offset)))
    times = {name: schedule[name] for name in ("sample_time_ns", "dvl_time_ns")}
    return {**result, "cross_track_m": offset, **times}


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
        *(pl.Series(name, result[name].reshape(-1)) for name in FIXES),
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
