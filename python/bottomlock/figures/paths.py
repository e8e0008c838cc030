"""A true trajectory: plan view and depth."""

import polars as pl

from bottomlock.figures.palette import STROKES
from bottomlock.figures.series import Curve, Figure, Panel, Track, frame_of


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
