"""Exports a finished replay to the folder `export` in its own."""

from collections.abc import Sequence
from pathlib import Path

from bottomlock.errors import DataError, ScenarioError
from bottomlock.files.overwriting import Files, Result, digests_of
from bottomlock.replay.export.comma_separated import comma_separated
from bottomlock.replay.export.geographic import NO_ORIGIN
from bottomlock.replay.export.geojson import geojson
from bottomlock.replay.export.gpx import gpx
from bottomlock.replay.export.kml import kml
from bottomlock.replay.export.layout import layout
from bottomlock.replay.export.mcap_file import mcap, writer_library
from bottomlock.replay.export.tracks import export_tracks
from bottomlock.replay.export.tum import tum
from bottomlock.replay.report import ReplayTables, read_replay

EARTH = {"kml": kml, "geojson": geojson, "gpx": gpx}
"""Formats that need a place on the Earth; one file has every track."""
FORMATS = (*EARTH, "csv", "tum", "mcap")
FOLDER = "export"


def check_formats(formats: Sequence[str], *, has_origin: bool) -> None:
    """Checks what can be known before a replay.

    Raises:
        ScenarioError: for none, and for one that is unknown.
        DataError: for a format on the Earth without an origin there, and where mcap is wanted and not installed.
    """
    if not formats:
        raise ScenarioError(
            f"--export names no format, expected of {', '.join(FORMATS)}, separated by commas"
        )
    for name in formats:
        if name not in FORMATS:
            raise ScenarioError(f"--export: '{name}' is no format, expected of {', '.join(FORMATS)}")
    if not has_origin and any(name in EARTH for name in formats):
        raise DataError(NO_ORIGIN)
    if "mcap" in formats:
        writer_library()


def export_replay(
    folder: str | Path, formats: Sequence[str], *, methods: Sequence[str] | None = None, force: bool = False
) -> list[Path]:
    """Writes the tracks of a replay to `export/` in its folder; an earlier export there is replaced.

    Args:
        folder: of the replay.
        formats: of `FORMATS`.
        methods: whose tracks are exported; the one to take by default.
        force: replace files that have changed since they were written.

    Returns:
        The files.

    Raises:
        DataError: as `read_replay` and `check_formats`, and for tracks that a format cannot hold.
        ScenarioError: as `check_formats`, and for a method that the replay has not run.
        OutputError: for a file of these names that is not of ours, one that has changed since without `force`, and
            where the folder cannot be written.
    """
    folder = Path(folder)
    tables = read_replay(folder)
    check_formats(formats, has_origin=tables.manifest["origin"] is not None)
    result = Result(folder, "export", "replay", digests_of(folder, [folder / "manifest.json"]), beside=True)
    result.check(force=force)
    return result.write(export_files(tables, formats, methods), force=force)


def export_files(tables: ReplayTables, formats: Sequence[str], methods: Sequence[str] | None = None) -> Files:
    """The contents of the files, by name."""
    tracks, case = export_tracks(tables, methods), tables.manifest["case"]
    files: Files = {}
    for name, make in EARTH.items():
        if name in formats:
            files[f"{FOLDER}/tracks.{name}"] = make(case, tracks)
    if "csv" in formats:
        files |= {f"{FOLDER}/{track.name}.csv": comma_separated(track, tables.pings) for track in tracks}
    if "tum" in formats:
        files |= {f"{FOLDER}/{track.name}.tum": tum(track) for track in tracks}
    if "mcap" in formats:
        files[f"{FOLDER}/tracks.mcap"] = mcap(tables, tracks)
        files[f"{FOLDER}/foxglove_layout.json"] = layout(tracks, tables.manifest["beams"])
    return files
