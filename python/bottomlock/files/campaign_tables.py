"""A finished campaign, read back from its directory and checked: the tables, and the samples chunk by chunk."""

import importlib.metadata
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from bottomlock.errors import DataError
from bottomlock.files.columns import CHOICES, CONSISTENCY, ENSEMBLE, PATHS, RUNS, SAMPLES, SWEEP, check
from bottomlock.files.records import DIGESTS, read_record, read_recorded_table, record_of

VARIANTS = "variants.json"
"""In a folder of variants: their folders and values."""

KIND = "variants"

AGAIN = "the same command that made the campaign writes it again"


@dataclass(frozen=True)
class CampaignResults:
    """The tables of a campaign; choices and paths are None where a folder has none."""

    manifest: dict[str, Any]
    runs: pl.DataFrame
    ensemble: pl.DataFrame
    consistency: pl.DataFrame
    choices: pl.DataFrame | None
    paths: pl.DataFrame | None

    @property
    def trajectories(self) -> list[str]:
        """Trajectories in the order of the campaign."""
        return self.ensemble["trajectory"].unique(maintain_order=True).to_list()

    def methods(self, trajectory: str) -> list[str]:
        """Methods of a trajectory in the campaign's order."""
        rows = self.ensemble.filter(pl.col("trajectory") == trajectory)
        return rows["method"].unique(maintain_order=True).to_list()

    def configuration(self, trajectory: str) -> dict[str, Any]:
        """The scenario of a trajectory, as the manifest records it."""
        return dict(self.manifest["scenarios"][trajectory]["configuration"])


@dataclass(frozen=True)
class CampaignTables(CampaignResults):
    """The tables in the folder of a finished campaign; the sweep is None where it has none."""

    folder: Path
    sweep: pl.DataFrame | None


def read_campaign_tables(folder: Path) -> CampaignTables:
    """The tables of a finished campaign, read from its directory and checked.

    Raises:
        DataError: for a directory without a finished campaign of this version, and for a table that is missing, has
            changed since it was written, or has other columns, trajectories or methods than expected.
    """
    if not folder.is_dir():
        found = "is a file, expected a directory" if folder.exists() else "no such directory"
        raise DataError(found, place=folder, hint="`bottomlock run` makes one")
    manifest = _manifest(folder)
    runs, ensemble, consistency = (
        check(_table(folder / f"{name}.parquet", manifest), columns, place=str(folder / f"{name}.parquet"))
        for name, columns in (("runs", RUNS), ("ensemble", ENSEMBLE), ("consistency", CONSISTENCY))
    )
    for name, table in (("runs", runs), ("ensemble", ensemble), ("consistency", consistency)):
        _agree(folder / f"{name}.parquet", table, manifest)
    return CampaignTables(
        folder=folder,
        manifest=manifest,
        runs=runs,
        ensemble=ensemble,
        consistency=consistency,
        paths=_optional(folder / "truth.parquet", PATHS, manifest),
        sweep=_optional(folder / "sweep.parquet", SWEEP, _sweep_record(folder, manifest)),
        choices=_optional(folder / "choices.parquet", CHOICES, manifest),
    )


def read_samples(campaign: CampaignTables, trajectory: str) -> Iterator[tuple[pl.DataFrame, int]]:
    """The samples of one trajectory chunk by chunk (`files.columns.SAMPLES`), each with its number of runs.

    The rows are sorted by run, method and time; every method of every run has every time.

    Raises:
        DataError: for a chunk that is missing, incomplete, or has changed since it was written.
    """
    methods = campaign.methods(trajectory)
    for path, runs in sample_files(campaign.folder, campaign.manifest, trajectory):
        yield _chunk(path, methods, runs), runs


def sample_files(folder: Path, manifest: Mapping[str, Any], trajectory: str) -> list[tuple[Path, int]]:
    """The samples of one trajectory, a file a chunk, each with its number of runs."""
    stated = manifest["scenarios"][trajectory]
    runs, size = int(stated["runs"]), int(stated["runs_per_chunk"])
    chunks = [(first, min(size, runs - first)) for first in range(0, runs, size)]
    return [(chunk_file(folder, trajectory, "samples", first, count), count) for first, count in chunks]


def chunk_file(folder: Path, trajectory: str, kind: str, first_run: int, runs: int) -> Path:
    """A file of a chunk: `samples`, `choices`, `counts`, or its `record`.

    >>> chunk_file(Path("out"), "straight", "samples", 304, 196).as_posix()
    'out/chunks/straight/samples-00000304-00000499.parquet'
    """
    ending = "json" if kind == "record" else "parquet"
    return folder / "chunks" / trajectory / f"{kind}-{first_run:08d}-{first_run + runs - 1:08d}.{ending}"


def _manifest(folder: Path) -> dict[str, Any]:
    path = folder / "manifest.json"
    manifest = read_record(path)
    if manifest is None or not isinstance(manifest.get("scenarios"), dict) or "version" not in manifest:
        raise DataError("holds no campaign of ours (no manifest.json of `bottomlock run`)", place=folder)
    version = importlib.metadata.version("bottomlock")
    if manifest["version"] != version:
        raise DataError(
            f"the campaign is of version {manifest['version']} and this is {version}",
            place=path,
            hint="install that version, or run it again with `bottomlock run --force`",
        )
    if manifest.get("status") != "complete":
        raise DataError(
            f"the campaign is not finished (status '{manifest.get('status')}')",
            place=path,
            hint="the same `bottomlock run` resumes it",
        )
    for name, scenario in manifest["scenarios"].items():
        for key in ("runs", "runs_per_chunk", "seed", "methods", "configuration"):
            if not isinstance(scenario, dict) or key not in scenario:
                raise DataError(f"scenario '{name}' lacks '{key}'", place=path)
    return manifest


def _table(path: Path, record: Mapping[str, Any], columns: Sequence[str] | None = None) -> pl.DataFrame:
    """A table that a record states."""
    return read_recorded_table(path, record, remedy=AGAIN, columns=columns)


def _optional(
    path: Path, columns: Mapping[str, pl.DataType], record: Mapping[str, Any] | None
) -> pl.DataFrame | None:
    """A table that a campaign may have; additional columns are kept. None where no record states it."""
    if record is None or path.name not in record[DIGESTS]:
        if path.exists():
            raise DataError(
                "is not stated by the records of this campaign", place=path, hint=f"{AGAIN}, or remove it"
            )
        return None
    frame = _table(path, record)
    return check(frame.select([name for name in frame.columns if name in columns]), columns, place=str(path))


def _sweep_record(folder: Path, manifest: Mapping[str, Any]) -> dict[str, Any] | None:
    path = record_of(folder / "sweep.parquet")
    record = read_record(path)
    if record is not None and record.get("configuration_hash") != manifest["configuration_hash"]:
        raise DataError("is of another campaign", place=path, hint=AGAIN)
    return record


def _agree(path: Path, table: pl.DataFrame, manifest: dict[str, Any]) -> None:
    """The table has the trajectories and methods that the manifest names, no more and no less."""
    for name, scenario in manifest["scenarios"].items():
        found = set(table.filter(pl.col("trajectory") == name)["method"].unique().to_list())
        if found != set(scenario["methods"]):
            raise DataError(
                f"trajectory '{name}' has the methods {', '.join(sorted(found)) or 'none'}",
                place=path,
                hint=f"the manifest names {', '.join(sorted(scenario['methods']))}",
            )
    strange = set(table["trajectory"].unique().to_list()) - set(manifest["scenarios"])
    if strange:
        raise DataError(f"trajectory '{min(strange)}' is not in the manifest", place=path)


def _chunk(path: Path, methods: Sequence[str], runs: int) -> pl.DataFrame:
    columns = [name for name in SAMPLES if name not in ("trajectory", "nees_velocity_attitude")]
    record = read_record(path.with_name(f"{path.stem.replace('samples', 'record')}.json"))
    if record is None:
        raise DataError("its chunk has no record", place=path, hint=AGAIN)
    frame = _table(path, record, columns).sort("run", "method", "time_ns")
    times = frame["time_ns"].n_unique()
    if frame.height != runs * len(methods) * times or frame["run"].n_unique() != runs:
        raise DataError(
            f"has {frame.height} rows",
            place=path,
            expected=f"{runs} runs × {len(methods)} methods × {times} times",
        )
    if set(frame["method"].unique()) != set(methods):
        raise DataError("its methods are not those of the manifest", place=path)
    return frame


def campaign_folders(folders: list[Path]) -> dict[str, Path]:
    """Campaigns by a short label, in order: a folder of variants stands for each of them.

    Raises:
        DataError: for a folder that is not there, a variant that has not been run, and one campaign named twice.
    """
    found: dict[str, Path] = {}
    for folder in folders:
        if not folder.is_dir():
            raise DataError("no such directory", place=folder, hint="`bottomlock run` makes one")
        record = read_record(folder / VARIANTS)
        if record is None or record.get("kind") != KIND:
            inside = {_label(folder, folders): folder}
        else:
            parent = f"{_label(folder, folders)}/" if len(folders) > 1 else ""
            inside = {f"{parent}{name}": folder / name for name in record["variants"]}
        for label, path in inside.items():
            if path.resolve() in {other.resolve() for other in found.values()}:
                raise DataError("is named twice", place=path)
            found[label] = path
    return found


def _label(folder: Path, folders: list[Path]) -> str:
    """The folder's name, or the path where two share it."""
    names = [one.resolve().name for one in folders]
    name = folder.resolve().name
    return str(folder) if names.count(name) > 1 else name
