"""Readings of a case's sensors in SI, out of the columns of their tables."""

from functools import singledispatch
from pathlib import Path
from typing import Any

import numpy as np

from bottomlock.errors import DataError
from bottomlock.recordings.axes import from_angles, platform_attitude
from bottomlock.recordings.drives import FASTEST_MPS, drag_beyond
from bottomlock.recordings.sensors import SENSORS
from bottomlock.recordings.stream_sections import (
    AttitudeStream,
    DepthStream,
    EffortStream,
    SensorStream,
    ThrustStream,
)
from bottomlock.recordings.streams import Attitudes, Depths, Flags, Floats, Forces, Revolutions, Times
from bottomlock.units import STANDARD_GRAVITY_MPS2

ANGLE_SI = {"rad": 1.0, "deg": np.pi / 180.0}
LENGTH_SI = {"m": 1.0, "cm": 1e-2}
REVOLUTIONS_SI = {"Hz": 1.0, "rpm": 1.0 / 60.0, "rad/s": 0.5 / np.pi}
PRESSURE_SI = {"Pa": 1.0, "kPa": 1e3, "mbar": 1e2, "bar": 1e5, "dbar": 1e4}

_REFUSED_MPS = 1e3
"""Speed through the water that the kernel refuses."""


@singledispatch
def stream_of(section: SensorStream, time_ns: Times, values: Floats) -> Any:  # noqa: ANN401 - a stream of the sensor's
    """The readings of a sensor in SI, of the columns (n, k) of its table.

    Without a function for its section the columns are the numbers of its reading, and stand in its fields.

    Raises:
        DataError: for values that cannot be.
    """
    sensor = next(one for one in SENSORS if isinstance(section, one.settings))
    ends = np.cumsum([of.count or 1 for of in sensor.numbers])
    parts = zip(sensor.numbers, np.split(values, ends[:-1], axis=1), strict=True)
    return sensor.reading(time_ns, *(part if of.count else part[:, 0] for of, part in parts))


@stream_of.register
def _(section: DepthStream, time_ns: Times, values: Floats) -> Depths:
    if section.unit in LENGTH_SI:
        metres = values[:, 0] * LENGTH_SI[section.unit]
    else:
        metres = (
            values[:, 0]
            * PRESSURE_SI[section.unit]
            / (section.water_density_kg_per_m3 * STANDARD_GRAVITY_MPS2)
        )
    return Depths(time_ns, (-metres if section.up else metres) + section.offset_m)


@stream_of.register
def _(section: ThrustStream, time_ns: Times, values: Floats) -> Revolutions:
    revolutions_hz = values[:, 0] * REVOLUTIONS_SI[section.unit]
    if not revolutions_hz.any():
        raise DataError(
            "is 0 in every row",
            place=section.file,
            key=f"column '{section.column}'",
            expected="revolutions",
            hint="leave [thrust] out",
        )
    speed_mps = section.advance_m * float(np.median(np.abs(revolutions_hz[revolutions_hz != 0.0])))
    if speed_mps > FASTEST_MPS:
        raise DataError(
            (
                f"column '{section.column}' in {section.unit} and thrust.advance_m = "
                f"{section.advance_m:g} m are {speed_mps:.3g} m/s in the median"
            ),
            place=section.file,
            expected=f"at most {FASTEST_MPS:g} m/s: check thrust.unit and thrust.advance_m",
        )
    beyond = np.abs(revolutions_hz) * section.advance_m >= _REFUSED_MPS
    if beyond.any():
        what = f"{section.unit}, {_REFUSED_MPS:g} m/s or more"
        raise _spike(section.file, section.column, what, values[:, 0], time_ns, beyond)
    return Revolutions(time_ns, revolutions_hz)


def _spike(place: Path, column: str, what: str, values: Floats, time_ns: Times, beyond: Flags) -> DataError:
    """The error of single readings that are none: a replay would stop at them, or be spoilt."""
    k = int(np.flatnonzero(beyond)[0])
    found = f"is {values[k]:.3g} {what}, at {time_ns[k] * 1e-9:.6f} s, the first of {int(beyond.sum())} such readings"
    hint = "empty the cell of a reading that is none: its row is then left out and counted"
    return DataError(found, place=place, key=f"column '{column}'", hint=hint)


@stream_of.register
def _(section: EffortStream, time_ns: Times, values: Floats) -> Forces:
    if not values.any():
        raise DataError(
            f"columns {', '.join(section.force)} are 0 in every row",
            place=section.file,
            expected="forces",
            hint="leave [effort] out",
        )
    force_n = np.median(np.abs(values), axis=0)
    for axis, (name, drag) in enumerate(zip(section.force, drag_beyond(section), strict=True)):
        if force_n[axis] > drag:
            raise DataError(
                f"is {force_n[axis]:.3g} N in the median, and at {FASTEST_MPS:g} m/s the drag is {drag:.3g} N",
                place=section.file,
                key=f"column '{name}'",
                hint="check the unit of the forces, and linear and quadratic drag",
            )
        beyond = np.abs(values[:, axis]) > drag
        if beyond.any():
            what = f"N, more than the drag at {FASTEST_MPS:g} m/s, {drag:.3g} N"
            raise _spike(section.file, name, what, values[:, axis], time_ns, beyond)
    return Forces(time_ns, values)


@stream_of.register
def _(section: AttitudeStream, time_ns: Times, values: Floats) -> Attitudes:
    sensor = from_angles(*(values * ANGLE_SI[section.unit]).T)
    offset = float(np.deg2rad(section.yaw_offset_deg))
    return Attitudes(time_ns, platform_attitude(sensor, section.frame, section.mounting_rpy_rad, offset))
