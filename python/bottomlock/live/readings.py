"""Readings of a live stream: lines of numbers, MAVLink, messages of ROS 2, and the pings of a DVL."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from bottomlock.errors import DataError
from bottomlock.io.beam_table import WaterTable, joined
from bottomlock.io.decoder import Taken
from bottomlock.io.formats import LIVE
from bottomlock.io.framing import Framer, Lines
from bottomlock.io.ros_messages import decode, stamp_ns
from bottomlock.io.rows import PLAIN, Options
from bottomlock.io.sentences import hexadecimal, number, whole, xor_of
from bottomlock.io.tlog import MESSAGES
from bottomlock.live.doubts import Reasons
from bottomlock.live.sections import ROS_TYPES, AttitudeMessage, DepthSection
from bottomlock.ports.mavlink import dialect
from bottomlock.recordings.readings import (
    AcousticPositionReading,
    AttitudeReading,
    DepthReading,
    GpsReading,
    ImuReading,
    Ping,
    Quaternion,
    Reading,
    Triple,
)
from bottomlock.recordings.rotation import quaternion
from bottomlock.recordings.sensors import FILLER, GPS, IMU, INSTRUMENTS, is_on_earth

_EARLIEST_NS, _LATEST_NS = -(2**62), 2**62
SLOW_HZ = 10.0
"""Greatest rate at which an autopilot is asked for what does not move the vehicle."""
ROUNDING = 1e-3
"""By how much the norm of a quaternion of single precision may be off."""

_LINES = {one.line: one for one in INSTRUMENTS if one.line}
Given = TypeVar("Given")
Record = Any
"""A line, or a message as its library has it."""


@dataclass
class Reader(Generic[Given]):
    """Bytes to readings or pings: a framer cuts them into records, and each holds a reading or the reason for none.

    Attributes:
        framer: cuts the bytes into records; made at the start.
        records: whole records so far.
        skipped: records without a reading, by what was wrong.
        flagged: records with a reading of which something was not used or is unusual, by what it is.
    """

    framer: Framer = field(init=False)
    records: int = field(default=0, init=False)
    skipped: Reasons = field(default_factory=Reasons, init=False)
    flagged: Reasons = field(default_factory=Reasons, init=False)

    def feed(self, data: bytes) -> list[Given]:
        """The readings that `data` completes."""
        found = []
        for record in self.framer.feed(data):
            self.records += 1
            reading = self._parse(record)
            if isinstance(reading, str):
                self.skipped.add(reading)
            elif reading is not None:
                found.append(reading)
        return found

    def _parse(self, record: Record) -> Given | str | None:
        """The reading of a record; why it has none, None for one of another kind."""
        raise NotImplementedError

    @property
    def waiting(self) -> bool:
        """Whether lines of a reading are held of which more may come."""
        return False

    def flush(self) -> list[Given]:
        """What the lines that are held give, where no more of them have come for a while."""
        return []

    def reset(self) -> None:
        """Forgets a reading that has begun: the connection was made anew."""
        self.framer.reset()


@dataclass
class LineReader(Reader[Reading]):
    """Readings from lines: a time in ns, and numbers in SI; with `*` and the exclusive or of what stands before it.

    The checksum is optional until the first line that has one: from then on every line must, since one that lost its
    end would be a reading of other numbers. The beginning of one line and the end of another can have the right
    number of columns, too; only a checksum tells them.

    Args:
        format: the line of one of `recordings.sensors.INSTRUMENTS`.
        checksum: whether every line must have one, the first too.
        within: whether the stream may begin in the middle of a line.
    """

    format: str
    checksum: bool = False
    within: bool = False

    def __post_init__(self) -> None:
        """Chooses the columns of the format."""
        self._made = _LINES[self.format]
        self.framer = Lines(within=self.within)

    def _parse(self, record: Record) -> Reading | str | None:
        text, star, digits = record.partition(b"*")
        if star and xor_of(text) != hexadecimal(digits):
            return "bad checksum"
        if self.checksum and not star:
            return "no checksum"
        self.checksum, made = bool(star), self._made
        first, *rest = text.split(b",")
        if len(rest) not in {len(made.columns), len(made.columns) + len(made.more)}:
            return f"not the columns {made.header}"
        time_ns, values = whole(first), [number(part) for part in rest]
        numbers = [value for value in values if value is not None and math.isfinite(value)]
        if time_ns is None or len(numbers) < len(rest) or not _EARLIEST_NS < time_ns < _LATEST_NS:
            return "not a time in ns and finite numbers"
        reading: Reading | None = made.of_line(time_ns, numbers)
        return f"numbers that are no {made.header}" if reading is None else reading


class _MavlinkFramer(Framer):
    """pymavlink's parser: its records are messages."""

    def __init__(self, make: Callable[[], Any]) -> None:
        super().__init__()
        self._make = make
        self.reset()

    def feed(self, data: bytes) -> list[Record]:
        """The messages that `data` completes."""
        messages = self._parser.parse_buffer(data) or []
        bad = [one for one in messages if one.get_type() == "BAD_DATA"]
        self.dropped += sum(len(one.data) for one in bad)
        return [one for one in messages if one not in bad] if bad else messages

    def reset(self) -> None:
        """A parser without a message that has begun."""
        self._parser = self._make()
        self._parser.robust_parsing = True


def _unit(parts: Sequence[float]) -> Quaternion | None:
    """A quaternion of unit length; None for one that has another, and for numbers that are none."""
    norm = math.hypot(*parts)
    if not abs(norm - 1.0) < ROUNDING:
        return None
    w, x, y, z = (part / norm for part in parts)
    return w, x, y, z


@dataclass
class MavlinkReader(Reader[Reading]):
    """Readings from MAVLink: HIGHRES_IMU (forward, starboard, down), an attitude, the water's pressure, and GPS.

    Args:
        depth: the section that names the message of the pressure and turns it into a depth; None without.
        gravity_mps2: for that.
        attitude: the message of the attitude, forward-starboard-down to north-east-down; None without.
        inertial: whether HIGHRES_IMU is read.
        gps: whether GPS_RAW_INT is read.
        system, component: of the sender; None for those of the first reading: two vehicles are never mixed.
    """

    depth: DepthSection | None
    gravity_mps2: float
    attitude: AttitudeMessage | None = None
    inertial: bool = True
    gps: bool = False
    system: int | None = None
    component: int | None = None

    def __post_init__(self) -> None:
        """Makes the parser.

        Raises:
            ScenarioError: where pymavlink is not installed.
        """
        library = dialect()
        self.framer = _MavlinkFramer(lambda: library.MAVLink(None))
        self._made: dict[str, tuple[Callable[[int, list[float]], Reading | None], str]] = {}
        if self.inertial:
            self._made["HIGHRES_IMU"] = IMU.of_line, "finite numbers"
        if self.attitude is not None:
            self._made[self.attitude] = self._turned, "a unit quaternion"
        if self.depth is not None:
            self._made[self.depth.message] = self._under_water, "a finite pressure"
        if self.gps:
            self._made["GPS_RAW_INT"] = GPS.of_line, "a fix in 3D"

    def wanted(self, rate_hz: float) -> dict[str, float]:
        """The messages that are read, with the rates to ask for: `rate_hz`, of what does not move the vehicle 10 Hz."""
        moving = "HIGHRES_IMU" if self.inertial else self.attitude
        return {kind: rate_hz if kind == moving else min(rate_hz, SLOW_HZ) for kind in self._made}

    def _parse(self, record: Record) -> Reading | str | None:
        kind = record.get_type()
        if kind not in self._made:
            return None
        sender = record.get_srcSystem(), record.get_srcComponent()
        known = self.system, self.component
        if any(own not in {None, other} for own, other in zip(known, sender, strict=True)):
            system, component = ("any" if own is None else own for own in known)
            return (
                f"{kind} of system {sender[0]}, component {sender[1]}, and this source reads system {system}, "
                f"component {component}"
            )
        self.system, self.component = sender
        (make, needed), message = self._made[kind], MESSAGES[kind]
        values, reading = message.values(record), None
        if values is not None and all(map(math.isfinite, values)):
            reading = make(message.time_us(record) * 1000, list(values))
        return f"{kind} without {needed}" if reading is None else reading

    def _turned(self, time_ns: int, values: list[float]) -> Reading | None:
        """Of angles or a quaternion."""
        turned = _unit(quaternion(*values) if self.attitude == "ATTITUDE" else values)
        return None if turned is None else AttitudeReading(time_ns, turned)

    def _under_water(self, time_ns: int, values: list[float]) -> Reading:
        assert self.depth is not None
        return DepthReading(time_ns, self.depth.depth_m(values[0], self.gravity_mps2))


_MOST_HELD = 16
"""Records of the water that are held for the next ping of the bottom; of more the last."""


@dataclass
class PingReader(Reader[Ping]):
    """The pings of a byte stream in one format.

    Args:
        format: a key of `io.formats.LIVE`.
        beams: number of beams of the geometry.
        options: of the reader.
    """

    format: str
    beams: int
    options: Options = PLAIN

    def __post_init__(self) -> None:
        """Chooses framer and reader.

        Raises:
            DataError: for a format that is no stream of beams.
        """
        if self.format not in LIVE:
            raise DataError(
                f"format '{self.format}' is no stream of beams", expected=f"one of {', '.join(LIVE)}"
            )
        self._decoder = LIVE[self.format].decoder("record", self.options, self.beams)
        self.framer = self._decoder.framer
        self._water: list[WaterTable] = []

    @property
    def waiting(self) -> bool:
        """Whether lines of a ping are held of which more may come."""
        return self._decoder.waiting

    def feed(self, data: bytes) -> list[Ping]:
        """The pings that `data` completes."""
        self._decoder.feed(data)
        return self._taken()

    def flush(self) -> list[Ping]:
        """The ping whose lines are held, where no more of them have come for a while."""
        self._decoder.flush()
        return self._taken()

    def reset(self) -> None:
        """Forgets a ping that has begun."""
        self._decoder.reset()

    def _taken(self) -> list[Ping]:
        pings = [ping for one in self._decoder.take() if (ping := self._ping(one)) is not None]
        account = self._decoder.account
        self.records, account.read = self.records + account.read, 0
        for reasons, counted in (
            (account.skipped, self.skipped), (account.other, self.skipped), (account.flagged, self.flagged),
        ):  # fmt: skip
            for name, reason in reasons.items():
                counted.add(name, reason.count)
            reasons.clear()
        return pings

    def _ping(self, taken: Taken) -> Ping | None:
        table = taken.table
        if taken.water is not None:
            self._water = [*self._water[1 - _MOST_HELD :], taken.water]
        if not table.rows:
            return None
        if table.beams > self.beams:
            self.skipped.add(f"{table.beams} beams, the geometry has {self.beams}")
            return None
        water, self._water = self._water, []
        time_ns, flag = int(table.time_ns[0]), int(table.instrument_valid[0])
        return Ping(
            time_ns=time_ns,
            transmission_ns=time_ns if taken.sent_ns is None else taken.sent_ns,
            velocity_mps=_padded(table.velocity_mps[0], self.beams, fill=np.nan),
            valid=_padded(table.valid[0], self.beams, fill=False),
            sd_mps=_padded(table.sd_mps[0], self.beams, fill=np.nan),
            range_m=_padded(table.range_m[0], self.beams, fill=np.nan),
            instrument_mps=table.instrument_mps[0],
            instrument_valid=None if flag < 0 else bool(flag),
            stale=table.stale is not None and bool(table.stale[0]),
            water=joined(water) if water else None,
            instrument_frame=taken.frame,
        )


def _padded(values: NDArray, beams: int, *, fill: float | bool) -> NDArray:  # type: ignore[type-arg]
    """A row with as many beams as the geometry: what a record does not have is lost."""
    if len(values) == beams:
        return values
    return np.concatenate([values, np.full(beams - len(values), fill, dtype=values.dtype)])


_MISSING = -1.0
Message = Any


def _finite(*values: float) -> None:
    if not all(abs(value) < FILLER for value in values):
        raise DataError("numbers that are not finite")


# By REP 103 a body's axes are forward, left, up, and the world's east, north, up. A number that its message marks as
# missing (a covariance that begins with -1, no fix) is no reading.
def _frd(vector: Message) -> Triple:
    """A vector in forward-left-up axes, in forward-right-down ones."""
    _finite(vector.x, vector.y, vector.z)
    return vector.x, -vector.y, -vector.z


def _ned(point: Message) -> Triple:
    """A position east, north, up, as north, east, down."""
    _finite(point.x, point.y, point.z)
    return point.y, point.x, -point.z


def _imu(message: Message) -> Reading:
    if _MISSING in (message.angular_velocity_covariance[0], message.linear_acceleration_covariance[0]):
        raise DataError("no rates or no accelerations, by their covariance")
    return ImuReading(
        stamp_ns(message.header), _frd(message.angular_velocity), _frd(message.linear_acceleration)
    )


def _attitude(message: Message) -> Reading:
    """In the frames of the driver, which `attitude.frame` states."""
    if message.orientation_covariance[0] == _MISSING:
        raise DataError("no orientation, by its covariance")
    q = message.orientation
    turned = _unit((q.w, q.x, q.y, q.z))
    if turned is None:
        raise DataError("no unit quaternion")
    return AttitudeReading(stamp_ns(message.header), turned)


def _depth(message: Message) -> Reading:
    _finite(message.data)
    # The message has no stamp: a source of it has `clock` = "arrival".
    return DepthReading(0, message.data)


def _fix(message: Message) -> Reading:
    if message.status.status < 0:
        raise DataError("no fix, by its status")
    _finite(message.altitude)
    if not is_on_earth(message.latitude, message.longitude):
        raise DataError("numbers that are no latitude and longitude")
    return GpsReading(stamp_ns(message.header), message.latitude, message.longitude, message.altitude)


def _position(message: Message) -> Reading:
    east, north, up = (message.pose.covariance[k] for k in (0, 7, 14))
    stated = min(east, north, up) > 0.0 and math.isfinite(east + north + up)
    sd_m = (math.sqrt(north), math.sqrt(east), math.sqrt(up)) if stated else None
    return AcousticPositionReading(stamp_ns(message.header), _ned(message.pose.pose.position), sd_m)


_MAKERS: dict[str, Callable[[Message], Reading]] = {
    "ros-imu": _imu,
    "ros-attitude": _attitude,
    "ros-depth": _depth,
    "ros-navsat": _fix,
    "ros-pose": _position,
}


@dataclass
class RosReader(Reader[Reading]):
    """Readings from the messages of a topic.

    Args:
        format: "ros-pressure" or a key of `_MAKERS`.
        depth: turns a pressure into a depth; needed for "ros-pressure" alone.
        gravity_mps2: for that.
    """

    format: str
    depth: DepthSection | None = None
    gravity_mps2: float = math.nan

    def __post_init__(self) -> None:
        """Chooses the message."""
        self._type = ROS_TYPES[self.format].replace("/msg/", "/")
        self._make = (_MAKERS | {"ros-pressure": self._under_water})[self.format]
        self.framer = Framer()

    def _parse(self, record: Record) -> Reading | str:
        try:
            return self._make(decode(record, self._type))
        except DataError as error:
            return str(error)

    def _under_water(self, message: Message) -> Reading:
        assert self.depth is not None
        _finite(message.fluid_pressure)
        depth_m = self.depth.depth_m(message.fluid_pressure, self.gravity_mps2)
        return DepthReading(stamp_ns(message.header), depth_m)
