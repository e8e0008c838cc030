"""Streams of an ArduPilot DataFlash log (.BIN): IMU, attitude, pressure, GPS, the velocities of a DVL, the estimate.

Units and factors are those that the log states; where it states none (logs before 2018) they are those of ArduPilot's
definitions. VISO.dt is the exception: its factor says microseconds, and the code writes seconds; the steps between the
records tell.

Source: ArduPilot, LogStructure.h of AP_InertialSensor, AP_AHRS, AP_Baro, AP_GPS, AP_NavEKF3 and AP_VisualOdom.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bottomlock.errors import DataError
from bottomlock.io.account import Account, Flags, Floats
from bottomlock.io.dataflash import Records, parse
from bottomlock.io.log_stream import (
    ESTIMATE,
    LogStream,
    LogStreams,
    body_velocity,
    change_of_pressure,
    finish,
    velocity_of_displacements,
)
from bottomlock.io.rows import longest_rising

NAME = "ardupilot-bin"
TIMES_ITS_SIZE = 4.0
"""Memory that reading a log takes, over its size (measured: 2.7)."""

GPS_EPOCH_S, WEEK_S = 315_964_800, 604_800
_LEAPS_S = (1_341_100_800, 1_435_708_800, 1_483_228_800)
"""Unix times (July 2012, July 2015, 2017) from which GPS is 16, 17 and 18 s ahead of UTC; 15 s before."""
_FIX_3D = 3
_RESTART_NS = 1_000_000_000
_AROUND = 10
"""Records before and after a step back that tell a restart from a damaged time."""
_DIFFERENT = 10.0
"""Milliseconds to seconds: intervals this many times off the steps between records are in another unit."""


@dataclass(frozen=True)
class _Message:
    """A message as a stream: our column, theirs and its unit; which rows are used; what is said of it."""

    names: tuple[str, ...]
    columns: dict[str, tuple[str, str]]
    used: Callable[[Records], Flags] | None = None
    remark: str = ""


def _fixed(records: Records) -> Flags:
    """Rows with a position in three dimensions."""
    return np.asarray(records.values["Status"] >= _FIX_3D)


_POSITION = {"north_m": ("PN", "m"), "east_m": ("PE", "m"), "down_m": ("PD", "m")}
_VELOCITY = {f"velocity_{axis}_mps": (f"V{axis[0].upper()}", "m/s") for axis in ("north", "east", "down")}
_MESSAGES = (
    _Message(
        ("IMU", "IMU2", "IMU3"),
        {f"gyro_{a}_radps": (f"Gyr{a.upper()}", "rad/s") for a in "xyz"}
        | {f"acc_{a}_mps2": (f"Acc{a.upper()}", "m/s/s") for a in "xyz"},
    ),
    _Message(
        ("ATT",), {f"{part.lower()}_deg": (part, "deg") for part in ("Roll", "Pitch", "Yaw")}, remark=ESTIMATE
    ),
    _Message(("BARO", "BAR2", "BAR3"), {"pressure_pa": ("Press", "Pa")}),
    _Message(
        ("GPS", "GPS2"),
        {"latitude_deg": ("Lat", "deg"), "longitude_deg": ("Lng", "deg"), "height_m": ("Alt", "m")},
        used=_fixed,
    ),
    _Message(("XKF1", "NKF1"), _POSITION | _VELOCITY, remark=ESTIMATE),
    _Message(
        ("VISP",), {"north_m": ("PX", "m"), "east_m": ("PY", "m"), "down_m": ("PZ", "m")},
        remark="positions that were sent to the autopilot: whose they are, the log does not say",
    ),
)  # fmt: skip


def streams(data: bytes, place: str) -> LogStreams:
    """Every stream of a log that a replay can use.

    Raises:
        DataError: for a log without readable records, or a column in another unit than its name has.
    """
    account = Account(unit="byte")
    found = parse(data, place, account)
    if set(found) <= {"FMT"}:
        raise DataError(
            f"holds no record of a sensor ({account.read} records, {account.lost} damaged parts)", place=place
        )
    _check_one_boot(found, place)
    offset_ns, clock = _utc(found)
    log = LogStreams([], account, clock)
    for message in _MESSAGES:
        for name in message.names:
            for label, records in found[name].instances() if name in found else ():
                stream = _stream(label, records, message, log.notes)
                if stream is not None:
                    log.streams.append(stream)
    log.streams.sort(key=lambda one: -change_of_pressure(one))
    log.streams += _of_dvl(found, log)
    log.streams = [replace(one, time_ns=one.time_ns + offset_ns) for one in log.streams]
    return finish(log, place)


def _check_one_boot(found: dict[str, Records], place: str) -> None:
    """Checks that the log is of one boot; a wrong time here and there is none of another.

    Raises:
        DataError: where the time since boot goes back and stays so.
    """
    for name in (name for message in _MESSAGES for name in message.names):
        times = (
            found[name].time_ns()
            if name in found and found[name].has("TimeUS")
            else np.empty(0, dtype=np.int64)
        )
        for k in np.flatnonzero(np.diff(times) < -_RESTART_NS) + 1:
            before, after = times[max(k - _AROUND, 0) : k], times[k : k + _AROUND]
            if min(len(before), len(after)) == _AROUND and np.median(after) < np.median(before) - _RESTART_NS:
                raise DataError(
                    f"TimeUS of {name} goes back at its record {k + 1} of {len(times)}",
                    place=place,
                    expected="a log of one boot: are two joined?",
                )


def _in_order(label: str, records: Records, notes: list[str]) -> Records:
    """The records whose times rise, as many as possible: without checksums a damaged time looks like a good one."""
    times = records.time_ns()
    if len(times) < 2 or (np.diff(times) > 0).all():
        return records
    kept = np.zeros(len(times), dtype=bool)
    kept[longest_rising(times.tolist())] = True
    left = int((~kept).sum())
    notes.append(
        f"{label}: {left} of {len(times)} records repeat a time or are out of order, the first of them number "
        f"{int(np.argmin(kept)) + 1}, and are left out"
    )
    return records.where(kept)


def _stream(label: str, records: Records, message: _Message, notes: list[str]) -> LogStream | None:
    """A message as a stream; None for one without its columns or without a row that is used."""
    also = () if message.used is None else ("Status",)
    if not records.has("TimeUS", *also, *(theirs for theirs, _ in message.columns.values())):
        notes.append(f"{label} has not the columns that ArduPilot gives it, and is left out")
        return None
    records = _in_order(label, records, notes)
    if message.used is not None:
        records = records.where(message.used(records))
    columns = {ours: records.numbers(theirs, unit) for ours, (theirs, unit) in message.columns.items()}
    if not len(records.values):
        return None
    return LogStream(label, records.time_ns(), columns, message.remark, independent=not message.remark)


def leap_s(gps_s: NDArray[np.int64]) -> NDArray[np.int64]:
    """Seconds by which GPS was ahead of UTC, at seconds of GPS since 1970.

    >>> leap_s(np.array([1_340_000_000, 1_341_100_815, 1_341_100_816, 1_440_000_000, 1_700_000_000])).tolist()
    [15, 15, 16, 17, 18]
    """
    ahead = np.arange(16, 16 + len(_LEAPS_S))
    return 15 + np.searchsorted(np.array(_LEAPS_S) + ahead, gps_s, side="right")


def _utc(found: dict[str, Records]) -> tuple[int, str]:
    """What makes UTC of the time since boot, ns, and the words for it; 0 where no GPS tells it."""
    for name in ("GPS", "GPS2"):
        records = found.get(name)
        if records is None or not records.has("TimeUS", "Status", "GMS", "GWk"):
            continue
        records = records.where(_fixed(records) & (records.values["GWk"] > 0))
        if len(records.values):
            week, ms = (records.values[column].astype(np.int64) for column in ("GWk", "GMS"))
            gps_s = GPS_EPOCH_S + week * WEEK_S
            utc_ns = (gps_s - leap_s(gps_s + ms // 1000)) * 1_000_000_000 + ms * 1_000_000
            offset_ns = int(np.median(utc_ns - records.time_ns()))
            return (
                offset_ns,
                f"the autopilot's, since 1970 by its {name} (late by the receiver's delay, 0.1 to 0.2 s)",
            )
    return 0, "the autopilot's, since it was switched on: no GPS fix tells the date"


def _of_dvl(found: dict[str, Records], log: LogStreams) -> Iterator[LogStream]:
    """The velocities of a DVL, or of a camera, that were sent to the autopilot."""
    viso = found.get("VISO")
    moved = ("PosDX", "PosDY", "PosDZ")
    if viso is not None and viso.has("TimeUS", "dt", "conf", *moved):
        viso = _in_order("VISO", viso, log.notes)
        interval_s, why = _intervals(viso)
        yield velocity_of_displacements(
            "VISO", viso.time_ns(), interval_s, np.stack([viso.numbers(column, "m") for column in moved], axis=1),
            np.asarray(viso.values["conf"] > 0.0), why,
        )  # fmt: skip
    visv = found.get("VISV")
    if visv is not None and visv.has("TimeUS", "VX", "VY", "VZ"):
        visv = _in_order("VISV", visv, log.notes)
        if visv.has("Ign"):
            visv = visv.where(np.asarray(visv.values["Ign"] == 0))
        # Corrected to when it was measured; milliseconds, and absent in early logs.
        own = "CTimeMS" if visv.has("CTimeMS") else "TimeUS"
        time_ns = visv.time_ns(own) * (1000 if own == "CTimeMS" else 1)
        velocity = np.stack([visv.numbers(column, "m/s") for column in ("VX", "VY", "VZ")], axis=1)
        stream = body_velocity("VISV", time_ns, velocity, log) if len(time_ns) else None
        if stream is not None:
            yield stream


def _intervals(viso: Records) -> tuple[Floats, str]:
    """(n,) intervals of VISO, s, and what was wrong with their unit."""
    stated, raw = viso.numbers("dt", "s"), np.asarray(viso.values["dt"], dtype=np.float64)
    steps_s = np.diff(viso.time_ns()) * 1e-9
    if len(steps_s) and (steps_s > 0.0).any():
        step = float(np.median(steps_s[steps_s > 0.0]))
        middle = float(np.median(np.abs(stated)))
        if (
            not step / _DIFFERENT < middle < step * _DIFFERENT
            and step / _DIFFERENT < float(np.median(np.abs(raw))) < step * _DIFFERENT
        ):
            return raw, f"dt is taken in seconds, as the steps of {step:.3g} s between the records have it"
    return stated, ""
