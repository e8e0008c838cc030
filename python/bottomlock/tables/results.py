"""A finished campaign, read back from its directory and checked: the tables, and the errors run by run."""

import importlib.metadata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from bottomlock.atomic_write import read_json
from bottomlock.errors import DataError
from bottomlock.tables.campaign import CHOICES, CONSISTENCY, ENSEMBLE, PATHS, RUNS, SAMPLES
from bottomlock.tables.check import check
from bottomlock.tables.studies import SWEEP
from bottomlock.units import DEGREES_PER_RADIAN

Array = NDArray[np.float64]

COMPONENTS = tuple(
    f"{quantity}_{axis}"
    for quantity, axes in (
        ("position", ("north", "east", "down")),
        ("misalignment", ("north", "east", "down")),
        ("velocity", ("surge", "sway", "heave")),
    )
    for axis in axes
)
"""The nine components of the error, in the order of `Errors.ratio_rms`."""


@dataclass(frozen=True)
class Errors:
    """Errors of one trajectory: for each method a matrix of runs × times, in one order for all methods."""

    time_s: Array
    velocity_mps: Mapping[str, Array]
    attitude_deg: Mapping[str, Array]
    heading_deg: Mapping[str, Array]
    """Misalignment about the vertical: the part of the attitude error that no velocity shows."""
    claimed_velocity_mps: Mapping[str, Array]
    """Root of the sum of the three claimed variances."""
    nees: Mapping[str, Array]
    ratio_rms: Mapping[str, Array]
    """RMS over runs and times of error / claimed standard deviation, one for each of `COMPONENTS`."""

    def of(self, quantity: str) -> Mapping[str, Array]:
        """The norms of a quantity, "velocity" (m/s) or "attitude" (deg), for each method."""
        return {"velocity": self.velocity_mps, "attitude": self.attitude_deg}[quantity]


@dataclass(frozen=True)
class Study:
    """The tables of a finished campaign; truth, sweep and choices where the directory has them."""

    folder: Path
    manifest: dict[str, Any]
    runs: pl.DataFrame
    ensemble: pl.DataFrame
    consistency: pl.DataFrame
    paths: pl.DataFrame | None
    sweep: pl.DataFrame | None
    choices: pl.DataFrame | None

    @property
    def trajectories(self) -> list[str]:
        """Trajectories in the order in which they were flown."""
        return self.ensemble["trajectory"].unique(maintain_order=True).to_list()

    def methods(self, trajectory: str) -> list[str]:
        """Methods of a trajectory in the campaign's order."""
        rows = self.ensemble.filter(pl.col("trajectory") == trajectory)
        return rows["method"].unique(maintain_order=True).to_list()

    def configuration(self, trajectory: str) -> dict[str, Any]:
        """The scenario of a trajectory, as the manifest keeps it."""
        return dict(self.manifest["scenarios"][trajectory]["configuration"])


def read_study(folder: Path) -> Study:
    """The tables of a finished campaign.

    Raises:
        DataError: for a directory that holds no finished campaign of this version, and for a table that is missing,
            damaged, of other columns, or of other trajectories or methods than the manifest names.
    """
    if not folder.is_dir():
        raise DataError(f"{folder}: no such directory; `bottomlock run` makes one")
    manifest = _manifest(folder)
    runs, ensemble, consistency = (
        check(_parquet(folder / f"{name}.parquet"), columns, place=str(folder / f"{name}.parquet"))
        for name, columns in (("runs", RUNS), ("ensemble", ENSEMBLE), ("consistency", CONSISTENCY))
    )
    for name, table in (("runs", runs), ("ensemble", ensemble), ("consistency", consistency)):
        _agree(folder / f"{name}.parquet", table, manifest)
    return Study(
        folder=folder,
        manifest=manifest,
        runs=runs,
        ensemble=ensemble,
        consistency=consistency,
        paths=_optional(folder / "truth.parquet", PATHS),
        sweep=_optional(folder / "sweep.parquet", SWEEP),
        choices=_optional(folder / "choices.parquet", CHOICES),
    )


def locked_out(study: Study, trajectory: str, method: str) -> int:
    """Number of runs in which the gate of a method rejects more than half of its fixes: it flies on without them."""
    runs = study.runs.filter((pl.col("trajectory") == trajectory) & (pl.col("method") == method))
    lost = runs["fixes_rejected"] > runs["fixes_accepted"]
    return int(lost.sum())


def read_errors(study: Study, trajectory: str) -> Errors:
    """The errors of one trajectory from its chunks; only norms are held in memory.

    Raises:
        DataError: for a chunk that is missing, damaged or incomplete.
    """
    scenario = study.manifest["scenarios"][trajectory]
    methods, runs = sorted(study.methods(trajectory)), int(scenario["runs"])
    parts = [
        _chunk(path, methods, last - first + 1)
        for path, first, last in _tiling(study.folder / "chunks" / trajectory, runs)
    ]
    time_s = parts[0][0]
    if any(not np.array_equal(time_s, part[0]) for part in parts):
        raise DataError(f"{study.folder / 'chunks' / trajectory}: the chunks were sampled at different times")
    stacked = {
        name: np.concatenate([part[1][name] for part in parts], axis=0)
        for name in parts[0][1]
        if name != "ratio"
    }
    weights = np.array([part[1]["nees"].shape[0] for part in parts], dtype=np.float64) / runs
    ratio = np.sqrt(np.tensordot(weights, np.stack([part[1]["ratio"] for part in parts]), axes=1))
    by_method = {
        name: {method: np.ascontiguousarray(values[:, k]) for k, method in enumerate(methods)}
        for name, values in stacked.items()
    }
    return Errors(
        time_s=time_s,
        velocity_mps=by_method["velocity"],
        attitude_deg=by_method["attitude"],
        heading_deg=by_method["heading"],
        claimed_velocity_mps=by_method["claimed"],
        nees=by_method["nees"],
        ratio_rms={method: ratio[k] for k, method in enumerate(methods)},
    )


def _manifest(folder: Path) -> dict[str, Any]:
    path = folder / "manifest.json"
    manifest = read_json(path)
    if manifest is None or not isinstance(manifest.get("scenarios"), dict) or "version" not in manifest:
        raise DataError(f"{folder}: holds no campaign of ours (no manifest.json of `bottomlock run`)")
    version = importlib.metadata.version("bottomlock")
    if manifest["version"] != version:
        raise DataError(
            f"{path}: the campaign is of version {manifest['version']} and this is {version}; "
            f"install that version, or fly it again with `bottomlock run --force`"
        )
    if manifest.get("status") != "complete":
        raise DataError(
            f"{path}: the campaign is not finished (status '{manifest.get('status')}'); "
            f"the same `bottomlock run` resumes it"
        )
    for name, scenario in manifest["scenarios"].items():
        for key in ("runs", "seed", "methods", "configuration"):
            if not isinstance(scenario, dict) or key not in scenario:
                raise DataError(f"{path}: scenario '{name}' lacks '{key}'")
    return manifest


def _parquet(path: Path, columns: Sequence[str] | None = None) -> pl.DataFrame:
    if not path.is_file():
        raise DataError(f"{path}: is missing; the same `bottomlock run` writes it again")
    try:
        return pl.read_parquet(path, columns=None if columns is None else list(columns))
    except (OSError, pl.exceptions.PolarsError) as error:
        raise DataError(
            f"{path}: cannot be read as the table it should be ({str(error).splitlines()[0]})"
        ) from error


def _optional(path: Path, columns: Mapping[str, pl.DataType]) -> pl.DataFrame | None:
    """A table that a campaign may have; columns beyond ours are left alone."""
    if not path.is_file():
        return None
    frame = _parquet(path)
    return check(frame.select([name for name in frame.columns if name in columns]), columns, place=str(path))


def _agree(path: Path, table: pl.DataFrame, manifest: dict[str, Any]) -> None:
    """The table has the trajectories and methods that the manifest names, no more and no less."""
    for name, scenario in manifest["scenarios"].items():
        found = set(table.filter(pl.col("trajectory") == name)["method"].unique().to_list())
        if found != set(scenario["methods"]):
            raise DataError(
                f"{path}: trajectory '{name}' has the methods {', '.join(sorted(found)) or 'none'}; "
                f"the manifest names {', '.join(sorted(scenario['methods']))}"
            )
    strange = set(table["trajectory"].unique().to_list()) - set(manifest["scenarios"])
    if strange:
        raise DataError(f"{path}: trajectory '{min(strange)}' is not in the manifest")


def _tiling(folder: Path, runs: int) -> list[tuple[Path, int, int]]:
    """Chunks that hold each run once; a campaign that grew leaves shorter ones beside them."""
    found: dict[int, list[int]] = {}
    for path in folder.glob("samples-*-*.parquet"):
        numbers = path.stem.split("-")[1:]
        if len(numbers) == 2 and all(part.isdigit() for part in numbers) and int(numbers[1]) < runs:
            found.setdefault(int(numbers[0]), []).append(int(numbers[1]))
    chain, run = [], 0
    while run < runs:
        if run not in found:
            raise DataError(
                f"{folder}: the chunk that begins with run {run} is missing, {runs} runs are expected; "
                f"the same `bottomlock run` flies it again"
            )
        last = max(found[run])
        chain.append((folder / f"samples-{run:08d}-{last:08d}.parquet", run, last))
        run = last + 1
    return chain


def _chunk(path: Path, methods: list[str], runs: int) -> tuple[Array, dict[str, Array]]:
    """Times, and runs × methods × times of each norm; under "ratio" the mean square of error / deviation."""
    columns = [name for name in SAMPLES if name not in ("trajectory", "nees_velocity_attitude")]
    frame = _parquet(path, columns).sort("run", "method", "time_ns")
    time_ns = frame["time_ns"].unique().sort()
    shape = (runs, len(methods), len(time_ns))
    if frame.height != runs * len(methods) * len(time_ns) or frame["run"].n_unique() != runs:
        raise DataError(
            f"{path}: has {frame.height} rows, expected {shape[0]} runs × {shape[1]} methods × {shape[2]} times"
        )
    if sorted(frame["method"].unique().to_list()) != methods:
        raise DataError(f"{path}: its methods are not those of the manifest")

    def cube(name: str) -> Array:
        return np.asarray(frame[name].to_numpy().reshape(shape), dtype=np.float64)

    def norm(prefix: str) -> Array:
        return np.sqrt(sum((cube(name) ** 2 for name in columns if name.startswith(prefix)), np.zeros(shape)))

    values = {
        "velocity": norm("err_velocity_"),
        "attitude": norm("err_misalignment_") * DEGREES_PER_RADIAN,
        "heading": np.abs(cube("err_misalignment_down_rad")) * DEGREES_PER_RADIAN,
        "claimed": norm("sd_velocity_"),
        "nees": cube("nees"),
    }
    units = {"position": "m", "misalignment": "rad", "velocity": "mps"}
    squares = []
    for component in COMPONENTS:
        unit = units[component.split("_")[0]]
        squares.append(
            ((cube(f"err_{component}_{unit}") / cube(f"sd_{component}_{unit}")) ** 2).mean(axis=(0, 2))
        )
    values["ratio"] = np.stack(squares, axis=-1)
    return time_ns.to_numpy() * 1e-9, values
