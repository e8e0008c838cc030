"""Takes readings that are none out of pings, depth, attitude and GPS, and says which."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from bottomlock.recordings.finding import Finding
from bottomlock.recordings.screen import (
    SINK_M,
    TURN_RAD,
    LeftOut,
    beside_the_steps,
    depth_steps,
    repeated,
    standing,
    yaw_steps,
)
from bottomlock.recordings.streams import Attitudes, Beams, Depths, Flags, Floats, Inertial, Positions, Times

STILL = "stands still"
MANY = 0.01
"""Part of a stream left out from which it is told first."""
DOUBTFUL = 0.1
"""Part of a stream beside a step from which the other part may be the right one."""

STEPS: dict[str, tuple[Callable[[Any, Inertial], Floats], float, float, str]] = {
    "depth": (lambda depths, _: depth_steps(depths), SINK_M, 1.0, "steps by up to {:.1f} m"),
    "attitude": (
        yaw_steps, TURN_RAD, float(np.deg2rad(1.0)), "steps by up to {:.0f} deg of yaw that the gyros do not show",
    ),
}  # fmt: skip
"""Streams with steps: their sum up to each row, the least one, its unit, and words."""


def screened(aiding: dict[str, Any], inertial: Inertial, *, made: bool) -> tuple[LeftOut, ...]:
    """Takes the rows out of the streams of `aiding`, in place, and returns what was left out.

    Args:
        aiding: streams by their sections.
        inertial: readings of the IMU.
        made: they are made of the attitude, which then stays whole.
    """
    found: list[LeftOut] = []
    for name in ("depth", "attitude", "gps"):
        stream = aiding.get(name)
        if stream is None:
            continue
        stood = standing(stream.time_ns, _values(stream))
        if made and name == "attitude":
            if stood.any():
                found.append(replace(_left(name, STILL, stream.time_ns, stood), doubtful=True, used=True))
            continue
        if stood.any() and not stood.all():
            found.append(_left(name, STILL, stream.time_ns, stood))
            stream = aiding[name] = stream.kept(~stood)
        if name not in STEPS:
            continue
        steps_of, least, unit, words = STEPS[name]
        offsets = steps_of(stream, inertial)
        beside = beside_the_steps(offsets, 0.5 * least)
        if beside.any():
            why = words.format(float(np.abs(np.diff(offsets)).max()) / unit)
            found.append(_left(name, why, stream.time_ns, beside, steps=True))
            aiding[name] = stream.kept(~beside)
    return tuple(found)


def moving(beams: Beams) -> tuple[Beams, tuple[LeftOut, ...]]:
    """The beams without those that stand still, and what was left out."""
    stood = repeated(beams.time_ns, beams.velocity_mps, beams.valid)
    if not stood.any():
        return beams, ()
    left = _left("dvl", STILL, beams.time_ns, stood)
    return replace(beams, valid=beams.valid & ~stood[:, None]), (left,)


def _values(stream: Depths | Attitudes | Positions) -> Floats:
    if isinstance(stream, Depths):
        return stream.depth_m[:, None]
    if isinstance(stream, Attitudes):
        # A compass that stands still beside inclinometers that do not is as wrong; to the last digit after rotations.
        C = stream.attitude.as_matrix()
        return np.asarray(np.arctan2(C[:, 1, 0], C[:, 0, 0])[:, None].round(9))
    return stream.position_t_m[:, :2]


def _left(name: str, why: str, time_ns: Times, rows: Flags, *, steps: bool = False) -> LeftOut:
    first = int(np.flatnonzero(rows)[0])
    doubtful = steps and float(rows.mean()) > DOUBTFUL
    return LeftOut(name, why, int(rows.sum()), len(rows), float(time_ns[first]) * 1e-9, doubtful)


def left_out_findings(left_out: tuple[LeftOut, ...]) -> list[Finding]:
    """A finding of each stream of which more than 1 % is left out; a warning where the other part may be right."""
    return [
        Finding(
            "left_out", "warning" if one.doubtful else "note", one.share, one.words,
            f"{one.rows} of {one.of} rows, the first at {one.first_s:.3f} s.",
            f"Look at {one.stream}.file from there on"
            + ("." if one.used else "; the filter goes on without these rows."),
            f"{one.stream}.file", size=one.share, unit="1", expected="readings that change as the vehicle does",
        )
        for one in left_out
        if one.share > MANY
    ]  # fmt: skip
