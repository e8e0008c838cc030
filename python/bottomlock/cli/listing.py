"""The command `bottomlock list`: what ships with the package, and copies of it to edit."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from bottomlock.cli.common import Force
from bottomlock.cli.console import console, narrow_table, print_json, say
from bottomlock.cli.parameters import Json

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Kind = Literal["scenarios", "vehicles", "geometries", "grades", "methods", "formats"]

_COLUMNS, _ROWS = 25, 11
_EDGE = 0.62
"""Sine of the tilt at the edge of a picture: 38 degrees."""


def list_(
    kind: Kind,
    /,
    *,
    copy: str | None = None,
    out: Annotated[Path | None, Parameter(alias=("-o", "--to"))] = None,
    json: Json = False,
    force: Force = False,
) -> None:
    """List scenarios, vehicles, geometries, grades, methods or formats of the package, or copy one.

    Scenarios, vehicles, DVL geometries with a picture of their beams, grades of instruments with their sources,
    methods, and formats of recorded logs. A picture looks down from above: forward is up, starboard right; a beam's
    number stands where it looks.

    Args:
        kind: What is listed.
        copy: Name of a scenario, vehicle or geometry to copy.
        out: File to write; NAME.toml in this directory by default.
    """
    from bottomlock.config.instrument_grades import KINDS, listing
    from bottomlock.config.packaged import copy_packaged
    from bottomlock.io.beams import packaged_geometries

    if copy is not None:
        file = copy_packaged(kind, copy, out or Path(f"{copy}.toml"), force=force)
        then = f"; edit it, then: bottomlock run {file}" if kind == "scenarios" else ""
        say(f"wrote {file}{then}")
    elif json:
        print_json(described(kind))
    elif kind == "geometries":
        for name in packaged_geometries():
            console.print(text_of(name), highlight=False)
    elif kind == "grades":
        for sensor, title in KINDS.items():
            console.print(f"Grades of {title}:\n", *listing(sensor), sep="\n", highlight=False, markup=False)
    else:
        columns = [kind.removesuffix("s"), "description"]
        console.print(narrow_table("", columns, described(kind).items(), left=2))


def described(kind: Kind) -> dict[str, str]:
    """What is listed, by name, with a line on each; grades by their kind and name."""
    from bottomlock.config.instrument_grades import KINDS, grades
    from bottomlock.config.scenario import packaged_scenarios
    from bottomlock.figures.palette import stroke
    from bottomlock.io.beams import packaged_geometries, read_instrument_file
    from bottomlock.io.formats import BYTES, PATHS
    from bottomlock.kernel import METHODS
    from bottomlock.own_method import DEAD_RECKONING
    from bottomlock.plant import load_vehicle, packaged_vehicles

    if kind == "scenarios":
        return packaged_scenarios()
    if kind == "vehicles":
        return {name: load_vehicle(name).description for name in packaged_vehicles()}
    if kind == "geometries":
        return {name: read_instrument_file(name).name for name in packaged_geometries()}
    if kind == "grades":
        return {f"{of}/{grade.name}": grade.title for of in KINDS for grade in grades(of).values()}
    if kind == "methods":
        return {name: stroke(name).meaning for name in (*METHODS, DEAD_RECKONING)}
    return {form.name: form.title for form in (*BYTES, *PATHS)}


def text_of(name: str) -> str:
    """Name, tilts, azimuths, noise and picture of a geometry."""
    import numpy as np

    from bottomlock.io.beams import read_geometry, read_instrument_file

    instrument, settings = read_geometry(name), read_instrument_file(name)
    b = np.asarray(instrument.geometry.directions_p)
    tilts = np.rad2deg(np.arccos(np.clip(b[:, 2], -1.0, 1.0)))
    azimuths = np.rad2deg(np.arctan2(b[:, 1], b[:, 0]))
    tilted, around = ", ".join(f"{x:.1f}" for x in tilts), ", ".join(f"{x:.0f}" for x in azimuths + 0.0)
    noise = f"noise {1e3 * float(instrument.beam_sd_mps.mean()):.0f} mm/s"
    head = [f"{name}: {settings.name}", f"  tilts {tilted} deg; azimuths {around} deg to starboard; {noise}"]
    return "\n".join([*head, *(f"    {line}".rstrip() for line in picture(b)), ""])


def picture(directions_p: NDArray[np.float64]) -> list[str]:
    """Lines of a plan view of beams (B, 3): numbers where they look, a cross where the instrument is.

    >>> import numpy as np
    >>> picture(np.array([[0.5, 0.0, 0.866], [0.0, 0.5, 0.866], [-0.5, 0.0, 0.866]]))[1].strip()
    '1'
    """
    import numpy as np

    rows = [[" "] * _COLUMNS for _ in range(_ROWS)]
    middle = (_ROWS // 2, _COLUMNS // 2)
    rows[middle[0]][middle[1]] = "+"
    for k, (x, y, _) in enumerate(directions_p):
        row = round(middle[0] - x / _EDGE * (_ROWS // 2))
        column = round(middle[1] + y / _EDGE * (_COLUMNS // 2))
        rows[int(np.clip(row, 0, _ROWS - 1))][int(np.clip(column, 0, _COLUMNS - 1))] = str(k + 1)
    return ["".join(row) for row in rows]
