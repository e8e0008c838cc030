"""TUM trajectory: `time_s x y z qx qy qz qw` a line, after one with frames and description that begins with #."""

import numpy as np

from bottomlock.errors import DataError
from bottomlock.export.decimals import decimal, seconds
from bottomlock.export.tracks import ExportTrack

IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])


def tum(track: ExportTrack) -> str:
    """A trajectory, m; of a track without an attitude the orientation is the identity, not to be compared.

    Raises:
        DataError: for a track without positions.
    """
    orientation = track.orientation_enu_flu
    if orientation is None:
        orientation = np.tile(IDENTITY, (len(track.time_ns), 1))
    position = track.position_enu_m
    if position is None:
        raise DataError(
            "has velocities and no positions, which TUM needs", place=track.name, hint="export csv or mcap"
        )
    rows = np.hstack([position, orientation])
    lines = (
        " ".join([seconds(time_ns), *map(decimal, row)])
        for time_ns, row in zip(track.time_ns, rows, strict=True)
    )
    frames = "east north up from the origin, orientation of forward left up; " + track.description.replace(
        "\n", " "
    )
    return "\n".join([f"# {frames}", *lines]) + "\n"
