"""A campaign's directory made of whole cloth: the tests say which errors a method makes and what it claims."""

import importlib.metadata
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from bottomlock.files.atomic_write import write_parquet
from bottomlock.files.campaign_tables import chunk_file
from bottomlock.files.columns import (
    BIASES,
    CONSISTENCY,
    ENSEMBLE,
    OUTCOMES,
    PATHS,
    RUNS,
    SAMPLES,
    SWEEP,
    VIRTUAL_BEAM_FACTOR,
)
from bottomlock.files.records import write_record, write_recorded_table
from bottomlock.statistics import campaign
from tests.analytic import analytic
from tests.recorded import add_table, edit_record

TRAJECTORIES = ("straight", "figure_eight", "lawn_mower")
METHODS = ("ins", "lc", "tc", "vb", "nsv", "plcf", "vhv")
TIMES_S = np.array([1.0, *range(5, 251, 5)])

# Velocity error in m/s and misalignment in degrees at each time, for a trajectory and a method.
Size = Callable[[str, str, np.ndarray[Any, Any]], tuple[Any, Any]]


def quiet(_: str, method: str, time_s: np.ndarray[Any, Any]) -> tuple[Any, Any]:
    """The INS drifts to 34 m/s; the others err by 0.1 m/s; nobody's attitude changes."""
    return (34.0 * time_s / 250.0 if method == "ins" else 0.1), 1.4


def write_campaign(
    folder: Path,
    size: Size = quiet,
    *,
    runs: int = 40,
    trajectories: Sequence[str] = TRAJECTORIES,
    methods: Sequence[str] = METHODS,
    scatter: float = 0.3,
    own_scatter: float = 0.0,
    chunks: int = 2,
) -> Path:
    """Writes every table of a finished campaign.

    The root mean square over runs of a method's error is `size`, to the last digit. Runs scatter about it by the part
    `scatter`, the same for all methods of a run, and by `own_scatter`, each method for itself.
    """
    folder.mkdir(parents=True, exist_ok=True)
    tables: dict[str, list[pl.DataFrame]] = {"runs": [], "ensemble": [], "consistency": []}
    for number, name in enumerate(trajectories):
        samples = _samples(name, size, methods, runs, (scatter, own_scatter), number)
        per_chunk = -(-runs // chunks)
        for first in range(0, runs, per_chunk):
            part = samples.filter(pl.col("run").is_between(first, first + per_chunk - 1))
            path, record = (
                chunk_file(folder, name, kind, first, part["run"].n_unique())
                for kind in ("samples", "record")
            )
            write_record(record, {}, {path.name: write_parquet(path, part)})
        norms = campaign.error_norms(samples)
        tables["runs"].append(campaign.runs_table(norms, _counts(name, methods, runs)))
        arrays = campaign.norm_arrays(norms.sort("run", maintain_order=True), runs, len(methods))
        ensemble, means = campaign.ensemble_and_consistency(
            name, methods, (TIMES_S * 1e9).astype(np.int64), [arrays], full_degrees=20
        )
        tables["ensemble"].append(ensemble)
        tables["consistency"].append(campaign.judge(means))
    digests = {
        f"{name}.parquet": write_parquet(folder / f"{name}.parquet", pl.concat(parts).cast(dict(columns)))  # type: ignore[arg-type]
        for (name, parts), columns in zip(tables.items(), (RUNS, ENSEMBLE, CONSISTENCY), strict=True)
    }
    manifest = {
        "status": "complete",
        "version": importlib.metadata.version("bottomlock"),
        "configuration_hash": "0" * 64,
        "scenarios": {
            name: {
                "seed": 1,
                "runs": runs,
                "runs_per_chunk": -(-runs // chunks),
                "methods": list(methods),
                "configuration": analytic(name).model_dump(mode="json"),
            }
            for name in trajectories
        },
    }
    write_record(folder / "manifest.json", manifest, digests)
    return folder


def write_whole(folder: Path, methods: Sequence[str], size: Size = quiet, *before: tuple[Any, ...]) -> Path:
    """One of twelve runs with a path and a sweep, of this row after `before`."""
    write_campaign(folder, size, runs=12, methods=methods)
    time_s = np.arange(0.0, 251.0)
    path = {"trajectory": ["straight"] * time_s.size, "time_ns": (time_s * 1e9).astype(np.int64)}
    place = {"north_m": 2.0 * time_s, "east_m": np.sin(time_s), "depth_m": 20.0 + time_s / 7.0}
    add_table(folder, "truth.parquet", pl.DataFrame(path | place, schema=dict(PATHS)))
    rows = [*before, (VIRTUAL_BEAM_FACTOR, "10", "straight", "vb", 0.2, 1.3, 19.9, None)]
    sweep = pl.DataFrame(rows, schema=dict(SWEEP), orient="row")
    write_recorded_table(folder / "sweep.parquet", sweep, {"configuration_hash": "0" * 64})
    return folder


def edit_manifest(folder: Path, edit: Callable[[dict[str, Any]], object]) -> None:
    """Changes the manifest in place; it states the tables as they are."""
    edit_record(folder / "manifest.json", edit)


def _samples(
    name: str, size: Size, methods: Sequence[str], runs: int, scatter: tuple[float, float], seed: int
) -> pl.DataFrame:
    generator = np.random.default_rng(seed)
    shared = generator.normal(size=runs)
    parts = []
    for method in methods:
        factor = np.exp(scatter[0] * shared + scatter[1] * generator.normal(size=runs))
        factor /= np.sqrt(np.mean(factor**2))
        velocity, attitude = (np.broadcast_to(part, TIMES_S.shape) for part in size(name, method, TIMES_S))
        count = runs * TIMES_S.size
        columns: dict[str, Any] = {column: np.zeros(count) for column in SAMPLES if column.startswith("err_")}
        columns |= {column: np.ones(count) for column in SAMPLES if column.startswith("sd_")}
        columns["err_velocity_surge_mps"] = np.outer(factor, velocity).ravel()
        columns["err_misalignment_down_rad"] = np.deg2rad(np.outer(factor, attitude)).ravel()
        columns |= {"nees": np.full(count, 20.0), "nees_velocity_attitude": np.full(count, 6.0)}
        columns |= {"trajectory": [name] * count, "method": [method] * count}
        columns["run"] = np.repeat(np.arange(runs), TIMES_S.size)
        columns["time_ns"] = np.tile((TIMES_S * 1e9).astype(np.int64), runs)
        parts.append(pl.DataFrame(columns).select(list(SAMPLES)))
    return pl.concat(parts)


def _counts(name: str, methods: Sequence[str], runs: int) -> pl.DataFrame:
    """Every fix accepted; aided methods leave half of each bias on the straight and a fifth elsewhere."""
    left = 0.5 if name == "straight" else 0.2
    sizes = np.random.default_rng(len(name)).normal(size=(runs, len(BIASES)))
    rows = [
        (name, run, method, None if method == "ins" else 2.0, 0 if method == "ins" else 250, 0, 0, 0.1, 0.2)
        + tuple(sizes[run] * (1.0 if method == "ins" else left))
        + (1.0,) * len(BIASES)
        for run in range(runs)
        for method in methods
    ]
    return pl.DataFrame(rows, schema=dict(OUTCOMES), orient="row")
