"""The formats by name: what each needs, its files, and how they are written beside one another."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from bottomlock.errors import DataError, ScenarioError
from bottomlock.export.geographic import NO_ORIGIN, geojson, kml
from bottomlock.export.mcap_file import mcap, writer_library
from bottomlock.export.text import comma_separated, tum
from bottomlock.export.tracks import Export, ExportTrack
from bottomlock.files.overwriting import Files, Result

EARTH: Mapping[str, Callable[[str, Sequence[ExportTrack]], str]] = {"kml": kml, "geojson": geojson}
"""Formats that need a place on the Earth; one file has every track."""
POSITIONS = (*EARTH, "tum")
"""Formats that have nothing but positions and attitudes."""
FORMATS = (*EARTH, "csv", "tum", "mcap")
FOLDER = "export"


def check_formats(formats: Sequence[str], *, has_origin: bool = True, has_position: bool = True) -> None:
    """Checks what can be known beforehand.

    Raises:
        ScenarioError: for none, and for one that is unknown.
        DataError: for a format on the Earth without an origin there, one of positions without any, and where mcap is
            wanted and not installed.
    """
    if not formats:
        raise ScenarioError(
            "names no format", key="--export", expected=f"of {', '.join(FORMATS)}, separated by commas"
        )
    for name in formats:
        if name not in FORMATS:
            raise ScenarioError(
                "is no format", place="--export", key=f"'{name}'", expected=f"of {', '.join(FORMATS)}"
            )
        if not has_position and name in POSITIONS:
            raise DataError(
                f'{name} needs positions, and mode = "velocity" estimates none',
                place="--export",
                hint="export csv or mcap",
            )
        if not has_origin and name in EARTH:
            raise DataError(NO_ORIGIN)
    if "mcap" in formats:
        writer_library()


def files_of(export: Export, name: str) -> Files:
    """The contents of the files of a format, by name.

    Raises:
        DataError: for tracks that the format cannot hold.
    """
    tracks = export.tracks
    if name in EARTH:
        return {f"tracks.{name}": EARTH[name](export.title, tracks)}
    if name == "csv":
        return {f"{one.name}.csv": comma_separated(one, export.pings.get(one.group)) for one in tracks}
    if name == "tum":
        return {f"{one.name}.tum": tum(one) for one in tracks}
    return {"tracks.mcap": mcap(export)}


def results_of(
    folder: Path,
    formats: Sequence[str],
    command: str,
    made_from: Mapping[str, str],
    inputs: Sequence[Path] = (),
) -> list[tuple[str, Result]]:
    """A result for each format, so that they stand beside one another and each replaces its own alone."""
    return [
        (name, Result(folder, f"{FOLDER}_{name}", command, made_from, inputs, beside=True))
        for name in dict.fromkeys(formats)
    ]


def write_export(
    export: Export, results: Sequence[tuple[str, Result]], *, force: bool, folder: str | None = FOLDER
) -> list[Path]:
    """Writes every format, or, where one cannot be made, none.

    Args:
        export: the tracks.
        results: of `results_of`.
        force: replace files that have changed since they were written.
        folder: of the files, below that of the results; None for that itself.

    Returns:
        The files.

    Raises:
        DataError: for tracks that a format cannot hold.
        OutputError: for a file of these names that is not of ours, one that has changed since without `force`, and
            where the folder cannot be written.
    """
    before = "" if folder is None else f"{folder}/"
    made = [
        (result, {f"{before}{name}": content for name, content in files_of(export, kind).items()})
        for kind, result in results
    ]
    return [path for result, files in made for path in result.write(files, force=force)]
