"""Takes readings that are none out of depth, attitude and GPS, and says which."""

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
    standing,
    yaw_steps,
)
from bottomlock.recordings.streams import Attitudes, Depths, Flags, Floats, Inertial, Positions, Times

STILL = "stands still"
MANY = 0.01
"""Part of a stream left out from which it is told first."""
DOUBTFUL = 0.1
"""Part of a stream beside a step from which the other part may be the right one."""


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
        steps = _steps(stream, inertial)
        if steps is None:
            continue
        offsets, near, size = steps
        beside = beside_the_steps(offsets, near)
        if beside.any():
            found.append(
                _left(name, size(float(np.abs(np.diff(offsets)).max())), stream.time_ns, beside, steps=True)
            )
            aiding[name] = stream.kept(~beside)
    return tuple(found)


def _values(stream: Depths | Attitudes | Positions) -> Floats:
    if isinstance(stream, Depths):
        return stream.depth_m[:, None]
    if isinstance(stream, Attitudes):
        # A compass that stands still beside inclinometers that do not is as wrong; to the last digit after rotations.
        C = stream.attitude.as_matrix()
        return np.asarray(np.arctan2(C[:, 1, 0], C[:, 0, 0])[:, None].round(9))
    return stream.position_t_m[:, :2]


def _steps(
    stream: Depths | Attitudes | Positions, inertial: Inertial
) -> tuple[Floats, float, Callable[[float], str]] | None:
    if isinstance(stream, Depths):
        return depth_steps(stream), 0.5 * SINK_M, lambda size: f"steps by up to {size:.1f} m"
    if isinstance(stream, Attitudes):
        return (
            yaw_steps(stream, inertial), 0.5 * TURN_RAD,
            lambda size: f"steps by up to {np.rad2deg(size):.0f} deg of yaw that the gyros do not show",
        )  # fmt: skip
    return None


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
