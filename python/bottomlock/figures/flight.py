"""Figures of a vehicle's motion: its path; depth, speed, flow angles, actuators, ranges and beams against time."""

import numpy as np
import polars as pl

from bottomlock.figures.palette import FAINT, STROKES
from bottomlock.figures.series import BEAM_COLOURS, Curve, Figure, Panel, Track, frame_of, valid_panel

_FIRST, _SECOND = BEAM_COLOURS[:2]


def flight_figure(telemetry: pl.DataFrame, beams: pl.DataFrame) -> Figure:
    """The panels of a flight above one another, under the trajectory's name."""
    title = str(telemetry["trajectory"][0]).replace("_", " ")
    return Figure(title, flight_panels(telemetry, beams), int(telemetry["time_ns"][0]))


def flight_panels(telemetry: pl.DataFrame, beams: pl.DataFrame) -> list[Panel]:
    """What a vehicle did, and which beams returned.

    Args:
        telemetry: the columns of `plant.telemetry`, SI and rad.
        beams: `time_ns`, a boolean column `beam1_valid` and so on, and over a seabed `beam1_range_m` and so on.
    """

    def curve(
        label: str, name: str, colour: str, *, scale: float = 1.0, dash: tuple[float, ...] = ()
    ) -> Curve:
        value = scale * telemetry[name].to_numpy()
        return Curve(label, colour, telemetry["time_ns"].to_numpy(), value, dash=dash)

    degrees = float(np.rad2deg(1.0))
    wanted = curve("commanded", "depth_wanted_m", FAINT, dash=(6.0, 3.0))
    flow = [
        curve("sideslip", "sideslip_rad", _FIRST, scale=degrees),
        curve("angle of attack", "angle_of_attack_rad", _SECOND, scale=degrees),
    ]
    return [
        Panel("depth, m", [wanted, curve("actual", "depth_m", _FIRST)], downwards=True),
        Panel("speed, m/s", [curve("over ground", "speed_mps", _FIRST)]),
        Panel("flow angles, °", flow, decimals=1),
        _drives(telemetry),
        *_ranges(beams),
        valid_panel(beams["time_ns"].to_numpy(), _numbered(beams, "valid").astype(bool)),
    ]


def _drives(telemetry: pl.DataFrame) -> Panel:
    """Angles of the fins, or thrusts of a vehicle without."""
    fins = [name for name in telemetry.columns if name.startswith("fin_")]
    drives = fins or [name for name in telemetry.columns if name.startswith("thrust_")]
    time_ns, scale = telemetry["time_ns"].to_numpy(), float(np.rad2deg(1.0)) if fins else 1.0
    curves = [
        Curve(
            name.split("_")[1],
            BEAM_COLOURS[k % len(BEAM_COLOURS)],
            time_ns,
            scale * telemetry[name].to_numpy(),
        )
        for k, name in enumerate(drives)
    ]
    return Panel("fins, °" if fins else "thrust, N", curves, decimals=1)


def _ranges(beams: pl.DataFrame) -> list[Panel]:
    """Range of every beam to the seabed; none without one."""
    if "beam1_range_m" not in beams.columns:
        return []
    time_ns = beams["time_ns"].to_numpy()
    curves = [
        Curve(f"beam {k + 1}", BEAM_COLOURS[k % len(BEAM_COLOURS)], time_ns, reach)
        for k, reach in enumerate(_numbered(beams, "range_m").T)
    ]
    return [Panel("range, m", curves, decimals=1)]


def _numbered(beams: pl.DataFrame, end: str) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """(n, beams) the columns of the beams that end so; NaN where there is no value."""
    return beams.select(pl.col(f"^beam[0-9]+_{end}$").cast(pl.Float64).fill_null(np.nan)).to_numpy()


def path_figure(paths: pl.DataFrame, trajectory: str) -> Figure:
    """Plan view above depth, whose axis holds every trajectory of the table.

    Args:
        paths: the columns of `files.columns.PATHS`.
        trajectory: one of its trajectories.
    """
    path, colour = paths.filter(pl.col("trajectory") == trajectory).sort("time_ns"), STROKES["tc"].colour
    step = max(1, -(-path.height // 1000))
    path = pl.concat([path.gather_every(step), path.tail(1)]).unique("time_ns", maintain_order=True)
    time_ns, north_m, east_m, depth_m = (
        path[name].to_numpy() for name in ("time_ns", "north_m", "east_m", "depth_m")
    )
    deepest = (0.0, float(paths["depth_m"].to_numpy().max(initial=0.0)))
    track = Track("", colour, time_ns, north_m, east_m)
    depth = Panel(
        "depth, m", [Curve("", colour, time_ns, depth_m)], decimals=1, downwards=True, least=deepest
    )
    title = trajectory.replace("_", " ")
    return Figure(title, [depth], size_in=(4.2, 4.8), tracks=[track], frame=frame_of([track]))
