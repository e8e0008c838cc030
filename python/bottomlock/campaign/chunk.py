"""One chunk: runs of one scenario to tables. It needs only the built scenario and can run anywhere.

Dead reckoning takes the very readings that the filters have in the kernel: every reading is drawn under the campaign's
key, so that it is drawn again here, bit for bit.
"""

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bottomlock import kernel, own_method
from bottomlock.campaign.build import BuiltScenario
from bottomlock.campaign.closed_loop import run_closed_loop
from bottomlock.config.scenario import Scenario
from bottomlock.dead_reckoning.sensors import Sensors, reckon
from bottomlock.files.columns import BIASES, CHOICES, OUTCOMES, SAMPLES
from bottomlock.kernel import SOURCES
from bottomlock.kernel.models import InitialState, Model, Options
from bottomlock.own_method import DEAD_RECKONING
from bottomlock.recordings.streams import Attitudes, Depths
from bottomlock.simulation.build import trajectory_key
from bottomlock.simulation.measurement_schedule import measurement_schedule
from bottomlock.statistics.rms import rms

_AXES = ("surge", "sway", "heave")


def choice_counts(
    choice: NDArray[np.uint8], *, trajectory: str, methods: Sequence[str], dvl_time_ns: NDArray[np.int64]
) -> pl.DataFrame:
    """Counts of a batch's choices (runs, methods, pings, 3), `files.columns.CHOICES`."""
    counts = np.stack([(choice == code).sum(axis=0) for code in range(len(SOURCES))])
    # By method, component, source and ping.
    counts = counts.transpose(1, 3, 0, 2)
    method, component, source, ping = np.nonzero(counts)
    columns = {
        "trajectory": [trajectory] * len(ping),
        "method": [methods[k] for k in method.tolist()],
        "time_ns": dvl_time_ns[ping],
        "component": [_AXES[k] for k in component.tolist()],
        "source": [SOURCES[k] for k in source.tolist()],
        "runs_chosen": counts[method, component, source, ping],
    }
    return pl.DataFrame(columns, schema_overrides=dict(CHOICES)).select(list(CHOICES))


def merged(tables: Sequence[pl.DataFrame]) -> pl.DataFrame:
    """The counts of several batches added up."""
    keys = [name for name in CHOICES if name != "runs_chosen"]
    return pl.concat(tables).group_by(keys, maintain_order=True).agg(pl.col("runs_chosen").sum()).sort(keys)


NOT_ESTIMATED = ("nees", "nees_velocity_attitude", "nis_mean", "final_bias_error", "final_bias_sd")
"""What a batch holds of a filter alone; NaN for dead reckoning."""


def with_reckoning(
    result: dict[str, Any],
    built: BuiltScenario,
    first_run: int,
    runs: int,
    schedule: Mapping[str, Any],
    model: Model,
    options: Options,
) -> dict[str, Any]:
    """The batch of the filters with dead reckoning in its place among the campaign's methods."""
    place = built.scenario.campaign.methods.index(DEAD_RECKONING)
    arrays = [_run(built, first_run + k, _of_run(schedule, k), model, options) for k in range(runs)]
    missing: dict[str, Any] = dict(
        zip(("error", "sd"), (np.stack(part) for part in zip(*arrays, strict=True)), strict=True)
    )
    missing |= dict.fromkeys(NOT_ESTIMATED, np.nan)
    missing |= {"choice": kernel.NO_CHOICE}
    return {name: np.insert(values, place, missing.get(name, 0), axis=1) for name, values in result.items()}


def _of_run(schedule: Mapping[str, Any], k: int) -> Any:  # noqa: ANN401 - the kernel's `ScheduleDict`
    """The schedule of one run, without the water: beams that are lost by chance differ between runs."""
    valid = schedule["beam_valid"]
    ground = {key: value for key, value in schedule.items() if not key.startswith("water_")}
    return {**ground, "beam_valid": valid[k] if valid.ndim == 3 else valid}


def _run(
    built: BuiltScenario,
    run: int,
    schedule: Any,  # noqa: ANN401 - the kernel's `ScheduleDict`
    model: Model,
    options: Options,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Errors, true minus estimate, and their 1 sigma, (samples, 9) each, in the order of the kernel's."""
    scenario, truth, geometry = built.scenario, built.truth, built.simulation.geometry
    arrays: Any = truth.kernel_arrays()
    drawn: dict[str, Any] = kernel.simulate_sensors(
        geometry, arrays, model, schedule, imu_sampling=scenario.imu.sampling, options=options,
        seed=scenario.campaign.seed, trajectory_key=trajectory_key(scenario.name), run=run,
    )  # fmt: skip
    compass = drawn["magnetometer_time_ns"]
    rows = np.searchsorted(truth.time_ns, schedule["sample_time_ns"])
    reckoned = reckon(
        geometry,
        model,
        InitialState(**drawn["initial"]),
        Sensors(
            imu_ns=drawn["imu_time_ns"],
            omega_p_radps=drawn["imu_omega_p_radps"],
            force_p_mps2=drawn["imu_force_p_mps2"],
            ping_ns=drawn["dvl_time_ns"],
            beam_mps=drawn["dvl_velocity_mps"],
            beam_valid=drawn["dvl_valid"],
            depths=Depths(drawn["depth_time_ns"], drawn["depth_m"]),
            attitudes=Attitudes(compass, _rotations(drawn["magnetometer_attitude_t_p"]))
            if len(compass)
            else None,
            heading_ns=drawn["heading_time_ns"],
            heading_rad=drawn["heading_rad"],
        ),
        truth.time_ns[rows],
        depth_lever_p_m=np.asarray(options.levers.depth_p_m),
    )
    error = np.hstack(
        [
            truth.position_t_m[rows] - reckoned.position_t_m,
            (_rotations(truth.attitude_t_p[rows]) * reckoned.attitude.inv()).as_rotvec(),
            truth.velocity_p_mps[rows] - reckoned.velocity_p_mps,
        ]
    )
    variances = [
        np.diagonal(cov, axis1=1, axis2=2) for cov in (reckoned.position_cov_m2, reckoned.velocity_cov_m2ps2)
    ]
    attitude = np.broadcast_to(reckoned.attitude_sd_rad, variances[0].shape)
    return error, np.hstack([np.sqrt(variances[0]), attitude, np.sqrt(variances[1])])


def _rotations(attitude_t_p: NDArray[np.float64]) -> Rotation:
    return Rotation.from_quat(attitude_t_p, scalar_first=True)


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
        samples: `files.columns.SAMPLES`, a row per run, method and second, in this order.
        choices: `files.columns.CHOICES`, the choices of the selectors.
        counts: `files.columns.OUTCOMES`, a row per run and method.
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
) -> ChunkTables:
    """Runs a chunk with every method of its scenario; run again, it gives the same bits.

    Args:
        built: the scenario.
        chunk: the runs.
        threads: 0 for as many as there are cores. The numbers do not depend on it.
        progress: called with the fraction done, 0 to 1, during a chunk in closed loop.

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
        result = _on_truth(built, chunk, threads)
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


def _on_truth(built: BuiltScenario, chunk: Chunk, threads: int) -> dict[str, Any]:
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
        threads=threads,
    )  # fmt: skip
    if filters != methods:
        result = with_reckoning(result, built, chunk.first_run, chunk.runs, schedule, model, options)
    offset = built.cross_track_m
    if offset is not None:
        offset = np.broadcast_to(offset, (chunk.runs, len(methods), len(offset)))
    times = {name: schedule[name] for name in ("sample_time_ns", "dvl_time_ns")}
    return {**result, "cross_track_m": offset, **times}


def _outcomes(result: dict[str, Any], keys: pl.DataFrame) -> pl.DataFrame:
    """A row per run and method (`files.columns.OUTCOMES`); `cross_track_m` (runs, methods, ticks) may be None."""
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
    """A row per run, method and second (`files.columns.SAMPLES`)."""
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
