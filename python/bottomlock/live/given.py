"""A reading as a caller made it, checked: whole nanoseconds, and numbers in the shapes of its class."""

import math
import operator
from dataclasses import replace
from typing import Any

import numpy as np

from bottomlock.errors import KernelError
from bottomlock.live.readings import ROUNDING
from bottomlock.recordings.readings import AttitudeReading, GpsReading, Ping, WaterReading
from bottomlock.recordings.sensors import INSTRUMENTS, is_on_earth

_BOUND_NS = 2**63
_NUMBERS = {one.reading: one.numbers for one in INSTRUMENTS if one.numbers}


def require_reading(given: object) -> None:
    """Checks the class.

    Raises:
        TypeError: for what is no reading.
    """
    if type(given) not in _NUMBERS and type(given) not in (Ping, WaterReading):
        shown = f"the class {given.__name__}" if isinstance(given, type) else f"a {type(given).__name__}"
        raise TypeError(f"push is given {shown}, expected a reading such as ImuReading or Ping")


def checked(reading: Any, beams: int) -> Any:  # noqa: ANN401 - of the same class
    """The same reading in the types that its class states; `beams` is the number of the DVL's.

    Raises:
        KernelError: for a time that is no whole number of nanoseconds, numbers that are none or not finite, other
            shapes than the class has, a quaternion that is not of unit length, and a place that is not on the Earth.
    """
    kind: Any = type(reading)
    if kind is Ping or kind is WaterReading:
        return _checked_beams(reading, beams)
    values: list[Any] = [
        None
        if field.optional and getattr(reading, field.name) is None
        else _numbers(kind, field.name, getattr(reading, field.name), field.count, field.unit)
        for field in _NUMBERS[kind]
    ]
    if kind is AttitudeReading and abs(math.hypot(*values[0]) - 1.0) > ROUNDING:
        raise KernelError(
            f"AttitudeReading.attitude_t_s is {values[0]}",
            expected="a quaternion of unit length, scalar first",
        )
    if kind is GpsReading and not is_on_earth(values[0], values[1]):
        raise KernelError(
            f"GpsReading is at latitude {values[0]}, longitude {values[1]}",
            expected="degrees, latitude first",
        )
    return kind(_time_ns(reading), *values)


def _checked_beams(reading: Ping | WaterReading, beams: int) -> Ping | WaterReading:
    for name in ("velocity_mps", "valid", "sd_mps"):
        shape = np.shape(getattr(reading, name))
        if shape != (beams,):
            raise KernelError(
                f"{type(reading).__name__}.{name} has shape {shape}",
                expected=f"({beams},): the DVL has {beams} beams",
            )
    return replace(reading, time_ns=_time_ns(reading))


def _time_ns(reading: Any) -> int:  # noqa: ANN401 - any reading
    given, name = reading.time_ns, type(reading).__name__
    try:
        time_ns = operator.index(given)
    except TypeError:
        hint = ": of seconds, round(seconds * 1e9)" if isinstance(given, float | np.floating) else ""
        raise KernelError(f"{name}.time_ns is {given!r}", expected=f"whole nanoseconds{hint}") from None
    if not -_BOUND_NS <= time_ns < _BOUND_NS:
        raise KernelError(f"{name}.time_ns is {time_ns}", expected="nanoseconds in 64 bits")
    return time_ns


def _numbers(kind: type, name: str, given: Any, count: int, of: str) -> Any:  # noqa: ANN401 - to be seen
    """A float, or a tuple of them."""
    if type(given) is tuple and len(given) == count and all(type(one) is float for one in given):
        values = list(given)  # most inertial readings: an array costs ten times as much
    else:
        try:
            array = np.asarray(given)
        except ValueError:  # lists of unequal lengths
            array = np.array(None)
        if array.dtype.kind not in "fiu" or array.shape != ((count,) if count else ()):
            wanted = f"{count} numbers" if count else "a number"
            raise KernelError(f"{kind.__name__}.{name} is {_short(given)}", expected=f"{wanted}, {of}")
        values = array.astype(np.float64).reshape(-1).tolist()
    if not all(map(math.isfinite, values)):
        raise KernelError(f"{kind.__name__}.{name} is {_short(given)}", expected=f"finite numbers, {of}")
    return tuple(values) if count else values[0]


def _short(given: object) -> str:
    """In one line."""
    return " ".join(repr(given).split())
