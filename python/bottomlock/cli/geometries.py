"""The command `bottomlock geometries`: the packaged DVLs, with a picture of their beams."""

import numpy as np

from bottomlock.cli.console import console
from bottomlock.io.beams import read_geometry, read_instrument_file
from bottomlock.io.packaged_geometries import packaged_geometries

_COLUMNS, _ROWS = 25, 11
_EDGE = 0.62
"""Sine of the tilt at the edge of a picture: 38 degrees."""


def geometries() -> None:
    """List the packaged DVL geometries, with a picture of the beams.

    The picture looks down from above: forward is up, starboard right; a beam's number stands where it looks.
    """
    for name in packaged_geometries():
        console.print(text_of(name), highlight=False)


def text_of(name: str) -> str:
    """Name, tilts, azimuths, noise and picture of a geometry."""
    instrument, settings = read_geometry(name), read_instrument_file(name)
    b = np.asarray(instrument.geometry.directions_p)
    tilts = np.rad2deg(np.arccos(np.clip(b[:, 2], -1.0, 1.0)))
    azimuths = np.rad2deg(np.arctan2(b[:, 1], b[:, 0]))
    tilted, around = ", ".join(f"{x:.1f}" for x in tilts), ", ".join(f"{x:.0f}" for x in azimuths + 0.0)
    noise = f"noise {1e3 * float(instrument.beam_sd_mps.mean()):.0f} mm/s"
    head = [f"{name}: {settings.name}", f"  tilts {tilted} deg; azimuths {around} deg to starboard; {noise}"]
    return "\n".join([*head, *(f"    {line}".rstrip() for line in picture(b)), ""])


def picture(directions_p: "np.ndarray[tuple[int, int], np.dtype[np.float64]]") -> list[str]:
    """Lines of a plan view of beams (B, 3): numbers where they look, a cross where the instrument is.

    >>> picture(np.array([[0.5, 0.0, 0.866], [0.0, 0.5, 0.866], [-0.5, 0.0, 0.866]]))[1].strip()
    '1'
    """
    rows = [[" "] * _COLUMNS for _ in range(_ROWS)]
    middle = (_ROWS // 2, _COLUMNS // 2)
    rows[middle[0]][middle[1]] = "+"
    for k, (x, y, _) in enumerate(directions_p):
        row = round(middle[0] - x / _EDGE * (_ROWS // 2))
        column = round(middle[1] + y / _EDGE * (_COLUMNS // 2))
        rows[int(np.clip(row, 0, _ROWS - 1))][int(np.clip(column, 0, _COLUMNS - 1))] = str(k + 1)
    return ["".join(row) for row in rows]
