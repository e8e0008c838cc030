"""Numbers as the fields of a record hold them: what does not fit is an error, never wrapped or clipped."""

import datetime as dt
import math

import numpy as np

from bottomlock.encoders.ping import Ping

MOST_TEXT = 1e9
"""Largest number in a field of text: no maker states one, and no measurement reaches it."""

NO_FOM_MPS = 10.0
"""Figure of merit of an invalid velocity: large, for receivers that do not test the flag (recorded A50: 0.8, 2.7)."""


def whole(value: float, step: float, least: int, most: int, ping: Ping, what: str) -> int:
    """A number as a whole multiple of the field's step.

    Args:
        value: the number.
        step: the field's step, in the number's unit.
        least: smallest multiple that the field holds and that is no mark for "none".
        most: largest one.
        ping: for the error.
        what: the number's name and unit, for the error.

    Raises:
        DataError: where it does not fit.
    """
    scaled = value / step
    steps = round(scaled) if math.isfinite(scaled) else None
    if steps is None or not least <= steps <= most:
        raise ping.fault(f"{what} is {value:g}, the record holds {least * step:g} to {most * step:g}")
    return steps


def decimal(value: float, digits: int, ping: Ping, what: str) -> str:
    """A number as decimal text.

    Raises:
        DataError: where it is not finite or longer than any measurement.
    """
    if not abs(value) < MOST_TEXT:
        raise ping.fault(f"{what} is {value:g}", expected=f"a finite number below {MOST_TEXT:g}")
    return f"{value:.{digits}f}"


def single(value: float, ping: Ping, what: str) -> float:
    """A number as a 32-bit float holds it.

    Raises:
        DataError: where it is not finite or too large for one.
    """
    if not abs(value) < 3.4e38:
        raise ping.fault(f"{what} is {value:g}", expected="a finite number below 3.4e38")
    return float(np.float32(value))


def steps_of(time_ns: int, step_ns: int, least: int, most: int, ping: Ping) -> int:
    """A time as the nearest whole number of steps, in integers, since a float holds no ns of today.

    Raises:
        DataError: where the record's clock does not hold it.
    """
    steps = (time_ns + step_ns // 2) // step_ns
    if not least <= steps <= most:
        most_ns = most * step_ns
        raise ping.fault(
            f"its time, {time_ns} ns, is outside the record's clock, {least * step_ns} to {most_ns} ns"
        )
    return steps


def calendar(steps: int, per_second: int) -> tuple[dt.datetime, int]:
    """A time since 1970 in steps, as a date to the second and the steps beyond it."""
    seconds, rest = divmod(steps, per_second)
    return dt.datetime(1970, 1, 1) + dt.timedelta(seconds=seconds), rest  # noqa: DTZ001 - the instrument has no zone
