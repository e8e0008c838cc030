"""Tables without names of columns: what they hold by the size and the order of their numbers."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bottomlock.replay.init.any_table import AnyTable
from bottomlock.replay.init.found import numbers
from bottomlock.replay.init.guess import force_unit

Floats = NDArray[np.float64]

UNNAMED = "column_1"
STEADY = 0.25
"""Specific force has a size of gravity whose middle half varies by less than this part of it."""


def named_by_content(table: AnyTable) -> AnyTable:
    """The table with names for what is recognised: a rising time, an IMU by gravity, a depth by the file's name.

    A table with names of its own, and one in which nothing is recognised, is returned as it is.
    """
    if table.frame.columns[0] != UNNAMED or table.frame.height < 3:
        return table
    names = list(table.frame.columns)
    values = np.stack([numbers(table.frame[name]) for name in names], axis=1)
    first = 0
    steps = np.diff(values[:, 0])
    if np.isfinite(values[:, 0]).all() and float((steps > 0.0).mean()) > 0.9:
        names[0], first = "time", 1
    words = _imu(values, names, first) or _depth(table, names, first)
    if not words:
        return table
    frame = table.frame.rename(dict(zip(table.frame.columns, names, strict=True)))
    return replace(table, frame=frame, plain=False, words=f"{words}; {table.words}".rstrip("; "))


def _imu(values: Floats, names: list[str], first: int) -> str:
    """Names two neighbouring groups of three columns, if one of them has the size of gravity."""
    for at in range(first, values.shape[1] - 5):
        for force, omega in ((at, at + 3), (at + 3, at)):
            if _is_force(values[:, force : force + 3]) and not _is_force(values[:, omega : omega + 3]):
                for k, axis in enumerate("xyz"):
                    names[force + k], names[omega + k] = f"force_{axis}", f"omega_{axis}"
                return (
                    f"no names: columns {force + 1} to {force + 3} have the size of gravity, columns {omega + 1} to "
                    f"{omega + 3} beside them are taken for angular rates"
                )
    return ""


def _is_force(three: Floats) -> bool:
    size = np.linalg.norm(three, axis=1)
    if not np.isfinite(size).mean() > 0.9:
        return False
    found = force_unit(three)
    low, middle, high = np.nanpercentile(size, [25.0, 50.0, 75.0])
    return found is not None and found.factor == 1.0 and bool(high - low < STEADY * middle)


def _depth(table: AnyTable, names: list[str], first: int) -> str:
    """Names the only column beside the time, where the file's name says what it is."""
    stem = table.path.stem.lower()
    for word in ("depth", "pressure"):
        if word in stem and len(names) == first + 1 and first == 1:
            names[1] = word
            return f"no names: the file's name says {word}"
    return ""
