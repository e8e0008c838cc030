"""What a finished replay exports: estimates of the chosen methods in each what-if case, and the reference."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from bottomlock.errors import DataError, ScenarioError
from bottomlock.export.formats import check_formats, write_export
from bottomlock.export.tracks import Export, ExportTrack, environment_at
from bottomlock.files.overwriting import digests_of
from bottomlock.files.replay_tables import FORWARD, ReplayTables
from bottomlock.geodesy import Place
from bottomlock.kernel.models import Environment
from bottomlock.recordings.axes import from_angles
from bottomlock.recordings.streams import Floats
from bottomlock.replay.dive_plots import taken
from bottomlock.replay.report import read_replay
from bottomlock.replay.vehicle_motion import level_axes

REFERENCE = "reference"


def export_of_replay(tables: ReplayTables, methods: Sequence[str] | None = None) -> Export:
    """Forward and smoothed, in every what-if case, then the reference where there is one.

    Fixes are those of the forward pass.

    Args:
        tables: of the replay.
        methods: to export; the one to take by default.

    Raises:
        ScenarioError: for a method that the replay has not run.
        DataError: for a replay without one position.
    """
    manifest = tables.manifest
    chosen = [taken(manifest)] if methods is None else _chosen(methods, manifest["methods"])
    origin = None if manifest["origin"] is None else Place(**manifest["origin"])
    stated = manifest["configuration"]["origin"]
    latitude_rad = np.deg2rad(stated["latitude_deg"]) if origin is None else origin.latitude_rad
    environment = environment_at(latitude_rad, stated["earth"])
    tracks = [
        track
        for what_if, words in manifest["what_if"]
        for method in chosen
        for track in _estimates(tables, what_if, words, method, origin, environment)
    ]
    if tables.path is not None:
        rows = _placed(tables.path)
        if rows.height:
            tracks.append(_reference(manifest, rows, tables.path.height, origin))
    if not any(track.group for track in tracks):
        raise DataError("the replay has no position to export: its start has none")
    groups = list(dict.fromkeys(track.group for track in tracks if track.group))
    fixes = [
        ("Fix", f"{group}_{method}/fix", tables.of(group).innovations.filter(method=method))
        for group in groups
        for method in dict.fromkeys(track.method for track in tracks if track.group == group)
    ]
    pings = {group: tables.of(group).pings for group in groups}
    return Export(manifest["case"], tracks, pings, fixes)


def _chosen(methods: Sequence[str], known: Sequence[str]) -> list[str]:
    """The methods that a user names, each once.

    Raises:
        ScenarioError: for one that is not known.
    """
    for method in methods:
        if method not in known:
            raise ScenarioError(
                "is not in the replay", place=f"'{method}'", expected=f"of {', '.join(known)}"
            )
    return list(dict.fromkeys(methods))


def _reference(
    manifest: Mapping[str, Any], rows: pl.DataFrame, times: int, origin: Place | None
) -> ExportTrack:
    """The reference, of so many times."""
    section = manifest["configuration"]["reference"]
    has_height = section["height"] is not None or section["down"] is not None
    words = f"{manifest['case']}: reference, {manifest['reference_note'] or 'as recorded'}"
    words += "" if has_height else "; heights were not recorded"
    return ExportTrack(
        name=REFERENCE,
        method=REFERENCE,
        group="",
        description=words + _without(times - rows.height),
        rows=rows,
        position_t_m=_position(rows),
        origin=origin,
        attitude=None,
        has_height=has_height,
    )


def _without(times: int) -> str:
    """Times that a track leaves out, in words; none for none."""
    return f"; {times} times without a position are left out" if times else ""


def _estimates(
    tables: ReplayTables,
    what_if: str,
    words: str,
    method: str,
    origin: Place | None,
    environment: Environment,
) -> Iterator[ExportTrack]:
    """The passes of a method in a what-if case."""
    manifest = tables.manifest
    samples = tables.of(what_if).samples.filter(method=method)
    answer = manifest.get("answer", {})
    for (which,), every in samples.group_by(["pass"], maintain_order=True):
        rows = _placed(every)
        if not rows.height:
            continue
        end = "" if which == FORWARD else f"_{which}"
        description = f"{manifest['case']}: {words}; method {method}, {which}"
        if manifest["semi_synthetic"]:
            description += "; semi-synthetic"
        if answer.get("method") != method:
            description += f"; not the track to take ({answer.get('sentence', 'there is no verdict')})"
        description += _without(every.height - rows.height)
        position = _position(rows)
        angles = np.deg2rad(rows.select("roll_deg", "pitch_deg", "yaw_deg").to_numpy())
        attitude = level_axes(environment, position) * from_angles(*angles.T)
        name = f"{what_if}_{method}{end}"
        yield ExportTrack(name, method, what_if, description, rows, position, origin, attitude)


def _placed(rows: pl.DataFrame) -> pl.DataFrame:
    """The rows with a position: a reference may have none at times, dead reckoning before its first ping."""
    return rows.filter(pl.all_horizontal(pl.col("north_m", "east_m", "down_m").is_not_null()))


def _position(rows: pl.DataFrame) -> Floats:
    return rows.select("north_m", "east_m", "down_m").to_numpy()


def export_replay(
    folder: str | Path, formats: Sequence[str], *, methods: Sequence[str] | None = None, force: bool = False
) -> list[Path]:
    """Writes the tracks of a replay to `export/` in its folder; an earlier export in the same format is replaced.

    Args:
        folder: of the replay.
        formats: of `formats.FORMATS`.
        methods: whose tracks are exported; the one to take by default.
        force: replace files that have changed since they were written.

    Returns:
        The files.

    Raises:
        DataError: as `read_replay` and `check_formats`, and for tracks that a format cannot hold.
        ScenarioError: as `check_formats`, and for a method that the replay has not run.
        OutputError: as `write_export`.
    """
    folder = Path(folder)
    tables = read_replay(folder)
    check_formats(formats, has_origin=tables.manifest["origin"] is not None)
    made_from = digests_of(folder, [folder / "manifest.json"])
    return write_export(
        lambda: export_of_replay(tables, methods), formats, folder, "replay", made_from, force=force
    )
