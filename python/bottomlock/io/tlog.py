"""Streams of a MAVLink telemetry log (.tlog) of a ground station, by pymavlink (extra `mavlink`).

Each record is the station's time, microseconds since 1970 as eight bytes, big end first, and a MAVLink packet, version
1 or 2. Messages of one autopilot are put on its own clock, which is laid on the station's by the message that came with
the least delay. Signatures are not checked.

Sources: QGroundControl and MAVProxy, which write them; common.xml and ardupilotmega.xml.
"""

import re
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bottomlock.errors import DataError
from bottomlock.io.account import Account, Integers
from bottomlock.io.log_stream import (
    ESTIMATE,
    LogStream,
    LogStreams,
    body_velocity,
    change_of_pressure,
    finish,
    velocity_of_displacements,
)
from bottomlock.io.progress import sparse_reporter
from bottomlock.libraries import mavlink
from bottomlock.units import STANDARD_GRAVITY_MPS2

NAME = "mavlink-tlog"
TIMES_ITS_SIZE = 14.0
"""Memory that reading a log takes, over its size (measured: 12.4)."""

_STAMP = 8
_V1, _V2, _SIGNED = 0xFE, 0xFD, 1
_EARLIEST_US, _LATEST_US = 946_684_800_000_000, 4_102_444_800_000_000
"""2000 and 2100: times of a log."""
_BOOT_BEFORE_US = 100_000_000_000_000
"""Three years: a smaller number counts from boot, a larger one from 1970."""
_RESTART_US = 1_000_000
_RECORD = re.compile(rb"\x00[\x03-\x0e].{6}[\xfd\xfe]", re.DOTALL)
LEAST_IMU_HZ = 20.0
"""Slower readings alias the motion that they are to be integrated over."""
_MILLIGEE = (740.0, 1350.0)
_FIX_3D, _NO_AUTOPILOT, _BODY_FRD = 3, 8, 12

_Values = tuple[float, ...]
_MG, _MRADPS = 1e-3 * STANDARD_GRAVITY_MPS2, 1e-3


@dataclass(frozen=True)
class Message:
    """A message as a stream: its time's field and factor to us, our columns, and their values; None leaves it out."""

    time: tuple[str, int]
    columns: tuple[str, ...]
    values: Callable[[Any], _Values | None]
    remark: str = ""

    def time_us(self, message: Any) -> int:  # noqa: ANN401 - the library's messages are not typed
        """The sender's time."""
        name, factor = self.time
        return int(getattr(message, name)) * factor


_IMU = tuple(f"gyro_{a}_radps" for a in "xyz") + tuple(f"acc_{a}_mps2" for a in "xyz")
_NED = ("velocity_north_mps", "velocity_east_mps", "velocity_down_mps")
_BOOT, _USEC = ("time_boot_ms", 1000), ("time_usec", 1)
_SENT = "positions that were sent to the autopilot: whose they are, the log does not say"


def _scaled_imu(m: Any) -> _Values:  # noqa: ANN401
    gyro, acc = (m.xgyro, m.ygyro, m.zgyro), (m.xacc, m.yacc, m.zacc)
    return (*(_MRADPS * w for w in gyro), *(_MG * f for f in acc))


MESSAGES: dict[str, Message] = {
    "HIGHRES_IMU": Message(_USEC, _IMU, lambda m: (m.xgyro, m.ygyro, m.zgyro, m.xacc, m.yacc, m.zacc)),
    "RAW_IMU": Message(_USEC, _IMU, _scaled_imu),
    **{f"SCALED_IMU{k}": Message(_BOOT, _IMU, _scaled_imu) for k in ("", "2", "3")},
    "ATTITUDE": Message(_BOOT, ("roll_rad", "pitch_rad", "yaw_rad"), lambda m: (m.roll, m.pitch, m.yaw), ESTIMATE),
    "ATTITUDE_QUATERNION": Message(_BOOT, ("q_w", "q_x", "q_y", "q_z"), lambda m: (m.q1, m.q2, m.q3, m.q4), ESTIMATE),
    **{
        f"SCALED_PRESSURE{k}": Message(_BOOT, ("pressure_pa",), lambda m: (100.0 * m.press_abs,))
        for k in ("", "2", "3")
    },
    **{
        name: Message(
            _USEC, ("latitude_deg", "longitude_deg", "height_m"),
            lambda m: (m.lat / 1e7, m.lon / 1e7, m.alt / 1e3) if m.fix_type >= _FIX_3D else None,
        )
        for name in ("GPS_RAW_INT", "GPS2_RAW")
    },
    "GLOBAL_POSITION_INT": Message(
        _BOOT, ("latitude_deg", "longitude_deg", "height_m", *_NED),
        lambda m: (m.lat / 1e7, m.lon / 1e7, m.alt / 1e3, m.vx / 1e2, m.vy / 1e2, m.vz / 1e2)
        if m.lat or m.lon else None,
        ESTIMATE,
    ),
    "LOCAL_POSITION_NED": Message(
        _BOOT, ("north_m", "east_m", "down_m", *_NED), lambda m: (m.x, m.y, m.z, m.vx, m.vy, m.vz), ESTIMATE
    ),
    "VISION_POSITION_ESTIMATE": Message(
        ("usec", 1), ("north_m", "east_m", "down_m"), lambda m: (m.x, m.y, m.z), _SENT
    ),
    "GLOBAL_VISION_POSITION_ESTIMATE": Message(
        ("usec", 1), ("north_m", "east_m", "down_m"), lambda m: (m.x, m.y, m.z), _SENT
    ),
    "VISION_POSITION_DELTA": Message(
        _USEC, ("interval_s", "x_m", "y_m", "z_m", "confidence"),
        lambda m: (m.time_delta_usec * 1e-6, *m.position_delta, m.confidence),
    ),
    "VISION_SPEED_ESTIMATE": Message(("usec", 1), ("x_mps", "y_mps", "z_mps"), lambda m: (m.x, m.y, m.z)),
    "ODOMETRY": Message(
        _USEC, ("surge_mps", "sway_mps", "heave_mps"),
        lambda m: (m.vx, m.vy, m.vz) if m.child_frame_id == _BODY_FRD else None,
    ),
}  # fmt: skip
"""What is read, of a log and of a stream, by name."""


@dataclass(eq=False)
class _Read:
    """What one system and component sent of one message: the station's and the sender's time, us, and the values."""

    order: list[int] = field(default_factory=list)
    stamp_us: list[int] = field(default_factory=list)
    own_us: list[int] = field(default_factory=list)
    values: list[_Values] = field(default_factory=list)


_Source = tuple[int, int]


def sniff(head: bytes) -> bool:
    """Whether the beginning of a file looks like this format: two records, or one that is whole."""
    end = _end(head, 0)
    return end is not None and (end >= len(head) or _end(head, end) is not None)


def _end(data: bytes, at: int) -> int | None:
    """Where a record that begins at a byte ends; None for none. It may be beyond the data."""
    if (
        at + _STAMP + 3 > len(data)
        or not _EARLIEST_US < int.from_bytes(data[at : at + _STAMP], "big") < _LATEST_US
    ):
        return None
    magic, length, flags = data[at + _STAMP : at + _STAMP + 3]
    if magic == _V1:
        return at + _STAMP + 8 + length
    if magic == _V2 and flags in {0, _SIGNED}:
        return at + _STAMP + 12 + length + 13 * flags
    return None


def streams(data: bytes, place: str) -> LogStreams:
    """Every stream of a log that a replay can use.

    Raises:
        DataError: where pymavlink is not installed, for a log without a message that is used, or with two vehicles.
    """
    account = Account(unit="byte")
    found, vehicles = _messages(data, account)
    if not found:
        lost = f", {account.lost} damaged parts" if account.lost else ""
        raise DataError(f"holds no message of a sensor ({account.read} messages{lost})", place=place)
    if len(vehicles) > 1:
        systems = ", ".join(map(str, sorted(vehicles)))
        raise DataError(
            f"holds autopilots of the systems {systems}",
            place=place,
            hint=(
                "expected one vehicle: write a log of one with `mavlogdump.py --source-system` of "
                "pymavlink, or record each on its own"
            ),
        )
    log = LogStreams(
        [], account, "the autopilot's, laid on the ground station's UTC by the least delayed message"
    )
    clocks = _clocks(found)
    for (source, name), read_ in found.items():
        message = MESSAGES[name]
        several = sum(other == name for _, other in found) > 1
        label = f"{name} of {source[0]}/{source[1]}" if several else name
        columns = dict(zip(message.columns, np.array(read_.values, dtype=np.float64).T, strict=True))
        log.streams.append(
            LogStream(label, clocks(source, read_), columns, message.remark, independent=not message.remark)
        )
    log.streams = [one for stream in log.streams if (one := _checked(stream, log.notes)) is not None]
    log.streams.sort(key=_order)
    log.streams = [one for stream in log.streams if (one := _of_dvl(stream, log)) is not None]
    return finish(log, place)


def _messages(data: bytes, account: Account) -> tuple[dict[tuple[_Source, str], _Read], set[int]]:
    """What each source sent of each message that is used, and the systems that have an autopilot."""
    library = mavlink(DataError)
    parser = library.MAVLink(None)
    wanted = {getattr(library, f"MAVLINK_MSG_ID_{name}"): name for name in MESSAGES}
    heartbeat = library.MAVLINK_MSG_ID_HEARTBEAT
    found: dict[tuple[_Source, str], _Read] = {}
    vehicles: set[int] = set()
    at, size, reached = 0, len(data), sparse_reporter()
    while at < size:
        end = _end(data, at)
        if end is None or end > size:
            again = _RECORD.search(data, at + 1)
            if end is not None and again is None:
                account.skip("breaks off within a message", at)
            else:
                account.skip("bytes of no message", at, data[at : at + 16])
            at = size if again is None else again.start()
            continue
        packet = data[at + _STAMP : end]
        account.read += 1
        kind, source = _kind(packet)
        if kind == heartbeat or kind in wanted:
            try:
                message = parser.decode(bytearray(packet))
            except (library.MAVError, struct.error) as error:
                account.skip("wrong checksum or length", at, str(error)[:60])
                # Lost bytes move the end: the next record may have begun before it.
                again = _RECORD.search(data, at + 1)
                at = end if _end(data, end) is not None or again is None else again.start()
                continue
            if kind == heartbeat:
                if message.autopilot != _NO_AUTOPILOT:
                    vehicles.add(source[0])
            else:
                _take(
                    found.setdefault((source, wanted[kind]), _Read()),
                    account.read,
                    data[at : at + _STAMP],
                    message,
                )
        else:
            account.pass_by("messages of other kinds", at)
        at = end
        reached(at)
    return {key: one for key, one in found.items() if one.values}, vehicles


def _kind(packet: bytes) -> tuple[int, _Source]:
    """Number of the message, and system and component that sent it; their bytes stand before the checksum is known."""
    if packet[0] == _V1:
        return packet[5], (packet[3], packet[4])
    return int.from_bytes(packet[7:10], "little"), (packet[5], packet[6])


def _take(read_: _Read, order: int, stamp: bytes, message: Any) -> None:  # noqa: ANN401 - the library is not typed
    spec = MESSAGES[message.get_type()]
    values = spec.values(message)
    if values is None:
        return
    read_.order.append(order)
    read_.stamp_us.append(int.from_bytes(stamp, "big"))
    read_.own_us.append(min(spec.time_us(message), _LATEST_US))
    read_.values.append(values)


def _clocks(found: dict[tuple[_Source, str], _Read]) -> Callable[[_Source, _Read], Integers]:
    """Makes the times of a source's messages: its own clock on that of the station, anew after each restart."""
    offsets: dict[_Source, tuple[Integers, Integers]] = {}
    for source in {source for source, _ in found}:
        mine = [read_ for (of, _), read_ in found.items() if of == source and _since_boot(read_)]
        if not mine:
            continue
        order, stamp, own = (
            np.concatenate([np.array(getattr(one, name), dtype=np.int64) for one in mine])
            for name in ("order", "stamp_us", "own_us")
        )
        chosen = np.argsort(order, kind="stable")
        order, stamp, own = order[chosen], stamp[chosen], own[chosen]
        starts = np.concatenate([[0], np.flatnonzero(np.diff(own) < -_RESTART_US) + 1])
        offsets[source] = order[starts], np.minimum.reduceat(stamp - own, starts)

    def times(source: _Source, read_: _Read) -> Integers:
        stamp, own = np.array(read_.stamp_us, dtype=np.int64), np.array(read_.own_us, dtype=np.int64)
        if not _since_boot(read_):
            # Since 1970, or none that runs: then the station's.
            dated = (own > _EARLIEST_US).all() and (own < _LATEST_US).all() and len(np.unique(own)) > 1
            return (own if dated else stamp) * 1000
        first, offset = offsets[source]
        part = np.searchsorted(first, np.array(read_.order), side="right") - 1
        return np.asarray((own + offset[part]) * 1000)

    return times


def _since_boot(read_: _Read) -> bool:
    """Whether the sender's time counts from its start, and runs."""
    own = np.array(read_.own_us, dtype=np.int64)
    return bool((own < _BOOT_BEFORE_US).all() and len(np.unique(own)) > max(1, len(own) // 2))


def _order(stream: LogStream) -> tuple[bool, float]:
    """Those of a DVL last, which need the others; of several pressures the depth's first."""
    dvl = {"interval_s", "x_mps"} & stream.columns.keys()
    return bool(dvl), -change_of_pressure(stream)


def _checked(stream: LogStream, notes: list[str]) -> LogStream | None:
    """The stream; None for inertial readings that are too slow or in counts."""
    if "acc_x_mps2" in stream.columns:
        step_s = float(np.median(np.diff(stream.time_ns))) * 1e-9 if len(stream.time_ns) > 1 else np.inf
        if step_s * LEAST_IMU_HZ > 1.0:
            notes.append(
                f"{stream.name} comes at {1.0 / step_s:.3g} Hz, too slow to be integrated (expected {LEAST_IMU_HZ:g} "
                "Hz or more), and is left out: the autopilot's own log (.BIN) has every reading"
            )
            return None
        size = (
            float(np.median(np.linalg.norm([stream.columns[f"acc_{a}_mps2"] for a in "xyz"], axis=0))) / _MG
        )
        if not _MILLIGEE[0] < size < _MILLIGEE[1]:
            notes.append(
                f"{stream.name} is left out: its acceleration has a median of {size:.4g} mg, expected gravity, 1000 "
                "mg; are these raw counts?"
            )
            return None
    return stream


def _of_dvl(stream: LogStream, log: LogStreams) -> LogStream | None:
    """Velocities of a DVL from a displacement, or from a velocity of unknown axes; other streams as they are."""
    columns = stream.columns
    if "interval_s" in columns:
        moved = np.stack([columns[f"{axis}_m"] for axis in "xyz"], axis=1)
        return velocity_of_displacements(
            stream.name, stream.time_ns, columns["interval_s"], moved, np.asarray(columns["confidence"] > 0.0)
        )
    if "x_mps" not in columns:
        return stream
    velocity = np.stack([columns[f"{axis}_mps"] for axis in "xyz"], axis=1)
    return body_velocity(stream.name, stream.time_ns, velocity, log)
