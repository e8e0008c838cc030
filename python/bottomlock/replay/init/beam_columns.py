"""The columns of beams in a plain table, by their names: a column map for `bottomlock convert`."""

import re
from dataclasses import dataclass

import numpy as np
import polars as pl

from bottomlock.io.beam_table import MOST_BEAMS
from bottomlock.io.beams import Columns
from bottomlock.io.columns import FLAG_WORDS
from bottomlock.recordings.streams import Floats
from bottomlock.replay.init.any_table import AnyTable
from bottomlock.replay.init.found import numbers, table_times
from bottomlock.replay.init.names import split_unit, usual_unit
from bottomlock.replay.read_tables import SPEED_SI

TIME = "time_ns"
_VALID = ("valid", "good", "ok", "datagood", "flag", "lock", "status")
_RANGE = ("range", "distance", "altitude", "dist", "height")
_RANGES = ("range", "distance", "altitude", "dist", "rng", "bottomrange", "btrange", "btmrange")
_OTHER = ("sd", "std", "fom", "quality", "rssi", "nsd", "corr", "correlation", "amp", "amplitude", "noise",
          "confidence", "snr", "delay", "id", "water", "var", "covar", "pg", "percent",
          "time", "arrival", "echo")  # fmt: skip


@dataclass(frozen=True, eq=False)
class BeamColumns:
    """A map of the columns of beams, the table that it maps, and why."""

    columns: Columns
    frame: pl.DataFrame
    why: str
    scale_why: str = ""


def beam_role(name: str) -> tuple[str, int] | None:
    """Role ("velocity", "valid", "range") and number of a beam's column, as it is written; None for another.

    >>> [beam_role(n) for n in ("beam1_mps", "b0", "field.bottomVelocityBeam2", "dataGood3", "beam_2_valid", "depth")]
    [('velocity', 1), ('velocity', 0), ('velocity', 2), ('valid', 3), ('valid', 2), None]
    >>> beam_role("/waterlinked_dvl/velocity_report/beam_velocity[3]")
    ('velocity', 3)
    """
    # Of a topic the field.
    bare = re.sub(r"^(?:/[\w.-]+)+/", "", split_unit(name)[0])
    words = [w for w in re.split(r"[^a-z0-9]+", re.sub(r"([a-z0-9])([A-Z])", r"\1_\2", bare).lower()) if w]
    whole = "".join(words)
    digits = re.findall(r"\d+", whole)
    if len(digits) != 1:
        return None
    letters = re.sub(r"\d", "", whole)
    of_beam = any(part in letters for part in ("beam", "transducer", "datagood")) or letters in {
        "b", "vb", "velb", "bv", "bvel", "btvel", "ok", "radial", "vr",
    }  # fmt: skip
    if not of_beam:
        return None
    rest = letters.replace("beam", "").replace("transducers", "").replace("transducer", "")
    if any(word in rest for word in _VALID):
        return "valid", int(digits[0])
    if any(word in rest for word in _RANGE):
        return "range", int(digits[0])
    if any(word in rest for word in _OTHER):
        return None
    return "velocity", int(digits[0])


def range_columns(table: AnyTable) -> list[str]:
    """Columns of the ranges of numbered beams, in their order.

    >>> frame = pl.DataFrame({"range_2": [2.0, 2.1], "range_1": [1.0, 1.1], "vx": [0.0, 0.0]})
    >>> from pathlib import Path
    >>> range_columns(AnyTable(Path("dvl.csv"), frame, plain=True, units={}))
    ['range_1', 'range_2']
    """
    found: dict[int, str] = {}
    for name in table.frame.columns:
        bare = split_unit(name)[0].lower()
        numbered = re.fullmatch(r"[^\d]*?(\d)[^\d]*", bare)
        words = re.sub(r"[^a-z]", "", bare).replace("beam", "").replace("transducer", "").removesuffix("s")
        if numbered and words in _RANGES and np.isfinite(numbers(table.frame[name])).any():
            found.setdefault(int(numbered[1]), name)
    return [found[k] for k in sorted(found)]


MOST_BLANK = 0.3
"""Part of the rows with nothing of the DVL from which they are rows of other sensors, and not pings that it lost."""


FEWEST_ALIVE = 2
"""Columns with readings that make a table one of a DVL."""


def beam_columns(table: AnyTable) -> BeamColumns | None:
    """The columns of three or more beams; None for a table without.

    A table without flags gets them: a beam is lost where its cell is empty, or reads exactly 0 in part of the rows.
    """
    found: dict[str, dict[int, str]] = {"velocity": {}, "valid": {}, "range": {}}
    for name in table.frame.columns:
        role = beam_role(name)
        # The column of a beam that is dead all along is still that of a beam.
        if role is not None and (role[0] != "range" or np.isfinite(numbers(table.frame[name])).any()):
            found[role[0]].setdefault(role[1], name)
    order = sorted(found["velocity"])
    if not 3 <= len(order) <= MOST_BEAMS or order != list(range(order[0], order[0] + len(order))):
        return None
    velocity = [found["velocity"][k] for k in order]
    values = np.stack([numbers(table.frame[name]) for name in velocity], axis=1)
    if np.isfinite(values).any(axis=0).sum() < FEWEST_ALIVE:
        return None
    scale, why = _scale(velocity, values, table)
    stamped, times = table.frame, table_times(table, "dvl").time_ns
    if times is None:
        return None
    stamped = stamped.with_columns(pl.Series(TIME, times))
    valid = [found["valid"].get(k) for k in order]
    codes = [name for name in valid if name is not None and not _is_flag(table, name)]
    notes = [f"beams are the columns {', '.join(velocity)}"]
    if codes:
        notes.append(
            f"{', '.join(codes)} no flags, since they hold more than {', '.join(('0', '1', *FLAG_WORDS))}"
        )
    if all(valid) and not codes:
        names = [str(name) for name in valid]
        flags = np.stack([numbers(stamped[name]) for name in names], axis=1) == 1.0
        flags &= np.isfinite(values)
        notes.append(f"their flags {', '.join(names)}")
    else:
        names = [f"beam{k + 1}_valid" for k in range(len(order))]
        zero = values == 0.0
        lost = zero & (zero.mean(axis=0) > 0.002)
        flags = np.isfinite(values) & ~lost
        notes.append(
            "no column of flags says which beams are valid: lost where empty"
            + (" or exactly 0" if lost.any() else "")
        )
    stamped = stamped.with_columns(
        [pl.Series(name, flags[:, k]) for k, name in enumerate(names)]
        + [pl.Series(name, values[:, k]).fill_nan(None) for k, name in enumerate(velocity)]
    )
    named = [*velocity, *(name for name in valid if name is not None and name not in codes)]
    blank = ~np.isfinite(np.stack([numbers(table.frame[name]) for name in named], axis=1)).any(axis=1)
    kept = np.concatenate([[True], np.diff(times) > 0])
    if blank.mean() > MOST_BLANK:
        # Rows of the other sensors of the same table.
        kept &= ~blank
        notes.append(f"{int(blank.sum())} rows without any of these columns are of other sensors")
    stamped = stamped.filter(kept)
    ranges = [found["range"].get(k) for k in order]
    columns = Columns(
        time=TIME, velocity=tuple(velocity), valid=tuple(names), velocity_scale=scale,
        range=tuple(str(name) for name in ranges) if all(ranges) else None,
    )  # fmt: skip
    return BeamColumns(columns, stamped, "; ".join(notes), why)


def _is_flag(table: AnyTable, name: str) -> bool:
    """Whether a column holds 0 and 1 or their words alone; empty cells are lost beams."""
    column = table.frame[name]
    values = numbers(column)
    filled = column.is_not_null().to_numpy() & (column.cast(pl.String).fill_null("") != "").to_numpy()
    return bool(np.isin(values[filled], [0.0, 1.0]).all())


def _scale(velocity: list[str], values: Floats, table: AnyTable) -> tuple[float, str]:
    unit = usual_unit(split_unit(velocity[0])[1] or table.units.get(velocity[0], ""))
    if unit in SPEED_SI:
        return SPEED_SI[unit], f"the column's name says {unit}"
    largest = float(np.nanpercentile(np.abs(values), 95))
    if largest > 50.0:
        return 1e-3, f"95 % are below {largest:.4g}: mm/s, as no vehicle moves that many m/s"
    return 1.0, f"95 % are below {largest:.3g}"
