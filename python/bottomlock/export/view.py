"""A finished replay in Rerun, a viewer of other makers: vehicle, beams, claimed σ, tracks and curves over one time.

The world is east-north-up from the origin, the vehicle forward-left-up, as Rerun and ROS have them. Positions are in
single precision there, curves in double.
"""

import os
import shutil
import sys
import sysconfig
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any, cast

import numpy as np
import polars as pl

from bottomlock.errors import BottomlockError, DataError, OutputError, note
from bottomlock.export.replay import export_of_replay
from bottomlock.export.tracks import ExportTrack
from bottomlock.figures.palette import stroke
from bottomlock.files.atomic_write import write_bytes
from bottomlock.files.overwriting import check_free
from bottomlock.io.beams import Instrument, read_geometry
from bottomlock.own_method import DEAD_RECKONING
from bottomlock.pages.plots import is_utc
from bottomlock.recordings.axes import FLU_FROM_FRD
from bottomlock.recordings.streams import Floats, Times
from bottomlock.replay.dive_plots import LOST_COLOURS, REFERENCE, taken
from bottomlock.replay.page import featured_in
from bottomlock.replay.report import ReplayTables
from bottomlock.statistics.replay import summary_table
from bottomlock.support.extras import install

UTC, SECONDS = "utc", "since_start"
"""The time lines; a log whose clock is not Unix time has the second alone."""
SIGMAS = 2.0
"""Of the ellipsoid around the vehicle, as of the ellipses of the page's map."""
BEAM_M = 5.0
"""Length at which a beam is drawn: a replay keeps no ranges."""
BODY_HALF_M = (1.0, 0.25, 0.25)
VALID_COLOUR, LOST_COLOUR = "#2e9e5b", LOST_COLOURS[2]


def viewer_library() -> ModuleType:
    """The library rerun.

    Raises:
        DataError: where it is not installed.
    """
    try:
        import rerun  # noqa: PLC0415 - an extra
        import rerun.blueprint  # noqa: PLC0415
    except ImportError as error:
        raise DataError(f"a replay is viewed by Rerun, which is not installed: {install('view')}") from error
    return cast(ModuleType, rerun)


def check_view(file: Path | None, *, window: bool, inputs: Sequence[Path] = (), force: bool = False) -> None:
    """Checks what can be known before a replay.

    Raises:
        DataError: where rerun is not installed.
        OutputError: for a file that does not end in .rrd, is there without `force` or is read, and for a window where
            there is no display.
    """
    viewer_library()
    if file is not None:
        if file.suffix != ".rrd":
            raise OutputError(f"{file}: expected a name that ends in .rrd, which Rerun opens")
        check_free(file, inputs=inputs, force=force)
    if (
        window
        and sys.platform == "linux"
        and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    ):
        raise OutputError(
            "there is no display for --view; write a file with --view-file DIVE.rrd, and open it with "
            "`rerun DIVE.rrd` where there is one"
        )


def save_view(tables: ReplayTables, file: Path, methods: Sequence[str] | None = None) -> None:
    """Writes a replay to a file that Rerun opens.

    Args:
        tables: of the replay.
        file: a name that ends in .rrd.
        methods: to show; by default those that the page shows first.

    Raises:
        ScenarioError: for a method that the replay has not run.
        DataError: where rerun is not installed, and for a replay without a position.
        OutputError: where the file cannot be written.
    """
    stream = _stream(tables)
    sink = stream.binary_stream()
    _send(stream, tables, methods)
    write_bytes(file, sink.read())


def open_view(tables: ReplayTables, methods: Sequence[str] | None = None) -> None:
    """Opens Rerun with a replay; the viewer goes on when the command ends. Arguments as of `save_view`.

    Raises:
        ScenarioError: for a method that the replay has not run.
        DataError: where rerun is not installed, and for a replay without a position.
        OutputError: where its viewer does not start or does not take the replay.
    """
    stream = _stream(tables)
    # Of an environment that is not activated, the PATH does not have it.
    viewer = shutil.which("rerun", path=sysconfig.get_path("scripts"))
    try:
        viewer_library().spawn(executable_path=viewer, recording=stream)
        _send(stream, tables, methods)
    except (RuntimeError, OSError) as error:
        why = str(error).strip().splitlines()[0]
        raise OutputError(
            f"Rerun's viewer does not start ({why}); write a file with --view-file DIVE.rrd instead"
        ) from error


def _stream(tables: ReplayTables) -> Any:  # noqa: ANN401 - of a library that need not be installed
    return viewer_library().RecordingStream(f"bottomlock replay: {tables.manifest['case']}")


def _send(stream: Any, tables: ReplayTables, methods: Sequence[str] | None) -> None:  # noqa: ANN401
    """Sends everything of the first draw, the same for each what-if case, and how it is laid out.

    The vehicle follows the first method.
    """
    rr, manifest = viewer_library(), tables.manifest
    methods = _shown(tables) if methods is None else methods
    tracks = export_of_replay(tables, methods).tracks
    start_ns = int(tables.samples["time_ns"].min())  # type: ignore[arg-type]
    instrument = _instrument(manifest["configuration"]["dvl"]["geometry"])
    cases = [name for name, _ in manifest["what_if"]]
    for case in cases:
        stream.log(case, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        own = [track for track in tracks if track.group == case]
        for track in own:
            _send_track(stream, case, track)
            _send_curves(stream, f"{case}/curves", track, start_ns)
        for track in (one for one in tracks if one.method == REFERENCE):
            _send_track(stream, case, track)
        first = (pl.col("what_if") == case) & (pl.col("run") == pl.col("run").min())
        fixes = tables.innovations.filter(first & pl.col("method").is_in(methods))
        _send_nis(stream, f"{case}/curves", fixes, start_ns)
        if own:
            _send_vehicle(stream, case, own[0], start_ns)
        if own and instrument is not None:
            _send_beams(stream, f"{case}/vehicle/beams", instrument, tables.pings.filter(first), start_ns)
    stream.send_blueprint(_blueprint(cases))
    stream.flush()


def _shown(tables: ReplayTables) -> list[str]:
    """The method whose track is to be taken, those that the page shows first, and dead reckoning."""
    manifest, summary = tables.manifest, summary_table(tables.runs)
    featured = [one for case, _ in manifest["what_if"] for one in featured_in(manifest, summary, case)]
    wanted = dict.fromkeys([taken(manifest), *featured, DEAD_RECKONING])
    return [one for one in wanted if one in manifest["methods"]]


def _instrument(geometry: str) -> Instrument | None:
    """The DVL of the replay; None, with a note, where its file is not there any more."""
    try:
        return read_geometry(geometry)
    except BottomlockError as error:
        note(f"the beams are not drawn: {error}")
        return None


def _times(time_ns: Times, start_ns: int) -> list[Any]:
    """The columns of the time lines."""
    rr = viewer_library()
    seconds = rr.TimeColumn(SECONDS, duration=(time_ns - start_ns).astype("timedelta64[ns]"))
    if not is_utc(start_ns):
        return [seconds]
    return [rr.TimeColumn(UTC, timestamp=time_ns.astype("datetime64[ns]")), seconds]


def _label(track: ExportTrack) -> str:
    """Method, and the pass where it is not the forward one."""
    return track.name.removeprefix(f"{track.group}_") if track.group else REFERENCE


def _send_track(stream: Any, case: str, track: ExportTrack) -> None:  # noqa: ANN401
    """The whole way, which is there at every time."""
    rr = viewer_library()
    width = rr.Radius.ui_points(3.0 if track.method == REFERENCE else 1.2)
    name = _label(track)
    strip = rr.LineStrips3D(
        [track.position_enu_m], colors=[_rgba(track.colour)], radii=[width], labels=[name], show_labels=False
    )
    stream.log(f"{case}/tracks/{name}", strip, static=True)


def _send_vehicle(stream: Any, case: str, track: ExportTrack, start_ns: int) -> None:  # noqa: ANN401
    """Pose, body and the ellipsoid of the claimed position."""
    rr = viewer_library()
    times, place = _times(track.time_ns, start_ns), track.position_enu_m
    stream.send_columns(
        f"{case}/vehicle",
        times,
        rr.Transform3D.columns(translation=place, quaternion=track.orientation_enu_flu),
    )
    colour = _rgba(track.colour)
    body = rr.Boxes3D(half_sizes=[BODY_HALF_M], colors=[colour], fill_mode="solid")
    stream.log(f"{case}/vehicle/body", body, static=True)
    sd = track.rows.select("sd_position_east_m", "sd_position_north_m", "sd_position_down_m").to_numpy()
    shape = rr.Ellipsoids3D.columns(half_sizes=SIGMAS * sd, centers=place, colors=[colour] * len(sd))
    stream.send_columns(f"{case}/position_2_sigma", times, shape)


def _send_beams(
    stream: Any,  # noqa: ANN401
    path: str,
    instrument: Instrument,
    pings: pl.DataFrame,
    start_ns: int,
) -> None:
    """The beams in the frame of the vehicle, coloured at each ping by whether they are valid."""
    rr, geometry = viewer_library(), instrument.geometry
    ends = [BEAM_M * np.asarray(geometry.directions_p), np.asarray(geometry.lever_arms_p_m)]
    outer, start = ((FLU_FROM_FRD @ one.T).T for one in ends)
    beams = range(geometry.beams)
    strips = rr.LineStrips3D(
        np.stack([start, start + outer], axis=1), labels=[f"beam {k + 1}" for k in beams], show_labels=False
    )
    stream.log(path, strips, static=True)
    valid = pings.select(f"beam{k + 1}_valid" for k in beams).to_numpy().astype(bool)
    colours = np.where(valid, _rgba(VALID_COLOUR), _rgba(LOST_COLOUR)).ravel()
    columns = rr.LineStrips3D.columns(colors=colours).partition([geometry.beams] * len(valid))
    stream.send_columns(path, _times(pings["time_ns"].to_numpy(), start_ns), columns)


def _rgba(colour: str) -> np.uint32:
    """A colour #rrggbb as Rerun packs it, opaque.

    >>> hex(_rgba("#2e9e5b"))
    '0x2e9e5bff'
    """
    return np.uint32(int(colour[1:] + "ff", 16))


CURVES = {
    **{f"velocity/{axis}": f"{axis}_mps" for axis in ("surge", "sway", "heave")},
    **{f"velocity_sd/{axis}": f"sd_velocity_{axis}_mps" for axis in ("surge", "sway", "heave")},
    **{f"position_sd/{axis}": f"sd_position_{axis}_m" for axis in ("north", "east", "down")},
    "depth": "down_m",
}
"""Columns of `tables.replay.REPLAY_SAMPLES` that are curves, by the place in Rerun's tree, above the method; m, m/s."""


def _send_curves(stream: Any, path: str, track: ExportTrack, start_ns: int) -> None:  # noqa: ANN401
    times = _times(track.time_ns, start_ns)
    for name, column in CURVES.items():
        _send_curve(stream, f"{path}/{name}/{_label(track)}", track.method, times, track.rows[column])


def _send_nis(stream: Any, path: str, innovations: pl.DataFrame, start_ns: int) -> None:  # noqa: ANN401
    """NIS of each ping over its degrees of freedom."""
    fixes = innovations.filter(pl.col("nis").is_not_null() & (pl.col("degrees") > 0))
    for (method,), rows in fixes.group_by("method", maintain_order=True):
        times = _times(rows["time_ns"].to_numpy(), start_ns)
        ratio = (rows["nis"] / rows["degrees"]).alias("nis")
        _send_curve(stream, f"{path}/nis/{method}", str(method), times, ratio)


def _send_curve(stream: Any, path: str, method: str, times: list[Any], value: pl.Series) -> None:  # noqa: ANN401
    """A curve in the colour of its method; NaN where there is no value."""
    rr = viewer_library()
    name = path.rsplit("/", maxsplit=1)[-1]
    stream.log(path, rr.SeriesLines(colors=[_rgba(stroke(method).colour)], names=[name]), static=True)
    numbers: Floats = value.fill_null(np.nan).to_numpy()
    stream.send_columns(path, times, rr.Scalars.columns(scalars=numbers))


def _blueprint(cases: Sequence[str]) -> Any:  # noqa: ANN401
    """A tab for each what-if case: the world at the left, curves at the right."""
    bp = viewer_library().blueprint
    tabs = [
        bp.Horizontal(
            bp.Spatial3DView(origin=case, name="world", contents=["$origin/**", "- $origin/curves/**"]),
            bp.Vertical(*_curve_views(bp, case)),
            column_shares=[3, 2],
            name=case,
        )
        for case in cases
    ]
    return bp.Blueprint(bp.Tabs(*tabs, active_tab=0), collapse_panels=True)


def _curve_views(bp: Any, case: str) -> Iterator[Any]:  # noqa: ANN401
    for name, title in {
        "velocity/surge": "surge, m/s",
        "velocity/sway": "sway, m/s",
        "velocity/heave": "heave, m/s",
        "velocity_sd": "σ of velocity, m/s",
        "position_sd": "σ of position, m",
        "depth": "depth below the origin, m",
        "nis": "NIS over its degrees of freedom",
    }.items():
        yield bp.TimeSeriesView(origin=f"{case}/curves/{name}", name=title)
