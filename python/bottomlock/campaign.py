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
from bottomlock.errors import OutputError, ScenarioError
from bottomlock.output import read_json, write_json, write_parquet
from bottomlock.plant import Flight, Mission, fly, load_vehicle
from bottomlock.plant.tables import mission_from_table
from bottomlock.scenario import EARTH_RATE_RADPS, Scenario
from bottomlock.schema import FIXES_COUNTS, SAMPLES
from bottomlock.sensors import schedule
from bottomlock.trajectory import Truth, make_truth

CHUNK_STEPS = 6_000_000
"""Filter steps of one kernel call: a second or two of one core, so that progress and interruption stay lively."""


@dataclass(frozen=True)
class Progress:
    """What a campaign tells while it runs."""

    trajectory: str
    runs_done: int
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


def trajectory_key(name: str) -> int:
    """Key of a trajectory's random numbers: the first eight bytes of the SHA-256 of its name.

    >>> trajectory_key("straight") == trajectory_key("straight") != trajectory_key("lawn_mower")
    True
    """
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "little")


def configuration_hash(scenarios: Sequence[Scenario]) -> str:
    """SHA-256 of all that decides the numbers of a campaign, apart from the number of runs."""
    content = [(s.name, s.content_hash(), s.campaign.seed, list(s.campaign.arms)) for s in scenarios]
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()


def gravity_of(scenario: Scenario) -> float:
    """Gravity of a scenario in m/s²: as stated, or normal gravity at its latitude and depth."""
    environment = scenario.environment
    if environment.gravity != "normal":
        return float(environment.gravity)
    return kernel.normal_gravity_mps2(float(np.deg2rad(environment.latitude_deg)), environment.depth_m)


def mission_of(scenario: Scenario) -> Mission:
    """The mission that the vehicle swims: the trajectory section with the keys of `[mission]` over it.

    Raises:
        ScenarioError: for a kind that the vehicle does not know, and for wrong keys of `[mission]`.
    """
    settings = scenario.trajectory
    table = {"kind": settings.kind, "speed_mps": settings.speed_mps, "duration_s": settings.duration_s}
    return mission_from_table(table | scenario.mission, scenario.name)


def flight_of(scenario: Scenario, gravity_mps2: float) -> Flight:
    """The vehicle's flight through a scenario; read from the cache where it was swum before.

    Raises:
        ScenarioError: for a vehicle or mission that makes no sense.
    """
    environment = scenario.environment
    return fly(
        load_vehicle(scenario.trajectory.vehicle),
        mission_of(scenario),
        latitude_rad=float(np.deg2rad(environment.latitude_deg)),
        gravity_mps2=gravity_mps2,
        earth_rate_radps=EARTH_RATE_RADPS if environment.earth_rotation else 0.0,
        imu_rate_hz=scenario.imu.rate_hz,
    )


def truth_of(scenario: Scenario, gravity_mps2: float) -> Truth:
    """The truth of a scenario: analytic, or swum by the vehicle."""
    if scenario.trajectory.source == "vehicle":
        return flight_of(scenario, gravity_mps2).truth
    return make_truth(scenario, gravity_mps2)


def geometry_of(scenario: Scenario) -> kernel.BeamGeometry:
    """The beams of a scenario.

    Raises:
        ScenarioError: for directions that are not unit vectors, and beams that lie in a plane.
    """
    dvl = scenario.dvl
    try:
        return kernel.make_geometry(
            dvl.configuration,
            tilt_rad=float(np.deg2rad(dvl.tilt_deg)),
            tilts_rad=np.deg2rad(dvl.tilts_deg or ()),
            azimuths_rad=np.deg2rad(dvl.azimuths_deg or ()),
            directions=dvl.directions,
            lever_arms_p_m=dvl.lever_arms_m,
            mounting_rpy_rad=np.deg2rad(
                [dvl.mounting_roll_deg, dvl.mounting_pitch_deg, dvl.mounting_yaw_deg]
            ),
            sound_speed_scale=dvl.sound_speed_scale,
        )
    except kernel.KernelError as error:
        raise ScenarioError(f"scenario {scenario.name}: dvl: {error}") from error


def _chunk_frames(
    result: dict[str, Any],
    *,
    name: str,
    arms: Sequence[str],
    first_run: int,
    sample_time_ns: np.ndarray[Any, Any],
) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Samples and fix counts of one kernel call as tables."""
    runs, arm_count, samples = result["nees"].shape
    keys = pl.DataFrame(
        {"run": np.repeat(np.arange(first_run, first_run + runs), arm_count), "arm": list(arms) * runs}
    )
    counts = keys.with_columns(
        pl.lit(name).alias("trajectory"),
        pl.Series("nis_mean", result["nis_mean"].reshape(-1)).fill_nan(None),
        pl.Series("fixes_accepted", result["fixes_accepted"].reshape(-1)),
        pl.Series("fixes_rejected", result["fixes_rejected"].reshape(-1)),
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


def _prepare(out: Path, scenarios: Sequence[Scenario], *, force: bool) -> None:
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
        same = manifest["configuration_hash"] == configuration_hash(scenarios)
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
                "manifest.json",
            ):
                path = out / part
                shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)


def _manifest(scenarios: Sequence[Scenario], clock: _Clock, *, status: str, threads: int) -> dict[str, Any]:
    return {
        "status": status,
        "version": kernel.kernel_version(),
        "versions": {"python": platform.python_version(), "numpy": np.__version__, "polars": pl.__version__},
        "configuration_hash": configuration_hash(scenarios),
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


def _chunks(scenario: Scenario, steps: int) -> list[tuple[int, int, str]]:
    """First run, number of runs and file name of each chunk."""
    runs = scenario.campaign.runs
    size = max(1, CHUNK_STEPS // (steps * len(scenario.campaign.arms)))
    starts = range(0, runs, size)
    return [(k, min(size, runs - k), f"{k:08d}-{min(k + size, runs) - 1:08d}.parquet") for k in starts]


def _fly(
    scenario: Scenario, folder: Path, clock: _Clock, *, threads: int, tell: Callable[[Progress], None]
) -> int:
    """Works off the chunks of one scenario that are not there yet; the number of truth samples."""
    gravity = gravity_of(scenario)
    truth = truth_of(scenario, gravity)
    geometry, model, plan = geometry_of(scenario), scenario.kernel_model(gravity), schedule(scenario, truth)
    arms, runs = list(scenario.campaign.arms), scenario.campaign.runs
    for first, count, stem in _chunks(scenario, len(truth.time_ns)):
        counts_path = folder / f"counts-{stem}"
        if not counts_path.exists():
            started = time.perf_counter()
            result: Any = kernel.run_batch(
                geometry, truth.kernel_arrays(), model, model, scenario.kernel_options(), plan, arms,  # type: ignore[arg-type]
                seed=scenario.campaign.seed, trajectory_key=trajectory_key(scenario.name), first_run=first, runs=count,
                threads=threads,
            )  # fmt: skip
            clock.kernel_s += time.perf_counter() - started
            samples, counts = _chunk_frames(
                result, name=scenario.name, arms=arms, first_run=first, sample_time_ns=plan["sample_time_ns"]
            )
            # The counts come last: a chunk is finished when they are there.
            write_parquet(folder / f"samples-{stem}", samples)
            write_parquet(counts_path, counts)
            clock.batch_s += time.perf_counter() - started
        tell(Progress(scenario.name, first + count, runs))
    return len(truth.time_ns)


def _tables(scenario: Scenario, folder: Path, steps: int) -> tuple[pl.DataFrame, pl.DataFrame, pl.DataFrame]:
    """Statistics of one scenario from its chunks; only the norms are held in memory."""
    stems = [stem for _, _, stem in _chunks(scenario, steps)]
    norms = pl.concat([stats.error_norms(pl.read_parquet(folder / f"samples-{stem}")) for stem in stems])
    counts = pl.concat([pl.read_parquet(folder / f"counts-{stem}") for stem in stems])
    degrees = 20 if scenario.filter.estimate_dvl else 15
    return (
        stats.runs_table(norms, counts),
        stats.ensemble_table(norms),
        stats.consistency_table(norms, full_degrees=degrees),
    )


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
        ScenarioError: for two scenarios of one name.
        OutputError: for a directory that is not ours or cannot be written.
        KernelError: for input that the kernel refuses, naming run and arm.
    """
    names = [scenario.name for scenario in scenarios]
    if not names or len(set(names)) != len(names):
        raise ScenarioError(f"expected scenarios of different names, got {names}")
    _prepare(out, scenarios, force=force)
    clock = _Clock()
    write_json(out / "manifest.json", _manifest(scenarios, clock, status="running", threads=threads))
    parts = []
    for scenario in scenarios:
        folder = out / "chunks" / scenario.name
        steps = _fly(scenario, folder, clock, threads=threads, tell=tell)
        parts.append(_tables(scenario, folder, steps))
    runs, ensemble, consistency = (pl.concat(tables) for tables in zip(*parts, strict=True))
    write_parquet(out / "runs.parquet", runs)
    write_parquet(out / "ensemble.parquet", ensemble)
    write_parquet(out / "consistency.parquet", consistency)
    manifest = _manifest(scenarios, clock, status="complete", threads=threads)
    write_json(out / "manifest.json", manifest)
    return Results(runs=runs, ensemble=ensemble, consistency=consistency, manifest=manifest)
