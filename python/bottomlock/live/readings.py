"""Inertial, attitude and depth readings of a live stream: lines of numbers, or MAVLink messages."""

import math
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from bottomlock.io.framing import Framer, Lines
from bottomlock.io.sentences import hexadecimal, number, whole, xor_of
from bottomlock.live.sections import AttitudeMessage, DepthSection
from bottomlock.live.states import Reasons
from bottomlock.ports.mavlink import dialect
from bottomlock.recordings.readings import (
    AttitudeReading,
    DepthReading,
    GpsReading,
    ImuReading,
    Quaternion,
    Reading,
)
from bottomlock.recordings.rotation import quaternion
from bottomlock.recordings.sensors import INSTRUMENTS, is_on_earth

_EARLIEST_NS, _LATEST_NS = -(2**62), 2**62
PASCAL_PER_HECTOPASCAL = 100.0
SLOW_HZ = 10.0
"""Greatest rate at which an autopilot is asked for what does not move the vehicle."""
_FIX_3D = 3
"""Of GPS_RAW_INT: from here on the position has a height."""
ROUNDING = 1e-3
"""By how much the norm of a quaternion of single precision may be off."""


_LINES = {one.line: one for one in INSTRUMENTS if one.line}
Given = TypeVar("Given")


@dataclass
class Reader(Generic[Given]):
    """Bytes to readings or pings.

    Attributes:
        framer: cuts the bytes into records; made at the start.
        records: whole records so far.
        skipped: records without a reading, by what was wrong.
    """

    framer: "Framer | MavlinkFramer" = field(init=False)
    records: int = field(default=0, init=False)
    skipped: Reasons = field(default_factory=Reasons, init=False)

    def feed(self, data: bytes) -> list[Given]:
        """The readings that `data` completes."""
        raise NotImplementedError

    def flush(self) -> list[Given]:
        """What the lines that are held give, where no more of them have come for a while."""
        return []


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
        made = _LINES[self.format]
        self._counts = {len(made.columns), len(made.columns) + len(made.more)}
        self._columns, self._make = made.header, made.of_line
        self.framer = self._lines = Lines(within=self.within)

    def feed(self, data: bytes) -> list[Reading]:
        """The readings that `data` completes."""
        return [reading for line in self._lines.feed(data) if (reading := self._reading(line)) is not None]

    def _reading(self, line: bytes) -> Reading | None:
        self.records += 1
        text, star, digits = line.partition(b"*")
        if star and xor_of(text) != hexadecimal(digits):
            self.skipped.add("bad checksum")
            return None
        if self.checksum and not star:
            self.skipped.add("no checksum")
            return None
        self.checksum = bool(star)
        first, *rest = text.split(b",")
        if len(rest) not in self._counts:
            self.skipped.add(f"not the columns {self._columns}")
            return None
        time_ns, values = whole(first), [number(part) for part in rest]
        numbers = [value for value in values if value is not None and math.isfinite(value)]
        if time_ns is None or len(numbers) < len(rest) or not _EARLIEST_NS < time_ns < _LATEST_NS:
            self.skipped.add("not a time in ns and finite numbers")
            return None
        reading: Reading | None = self._make(time_ns, numbers)
        if reading is None:
            self.skipped.add(f"numbers that are no {self._columns}")
        return reading


class MavlinkFramer:
    """What a reader of MAVLink shows of its framing: pymavlink does it."""

    waiting = False

    def __init__(self, reader: "MavlinkReader") -> None:
        self._reader = reader

    @property
    def dropped(self) -> int:
        """Bytes that belonged to no message."""
        return self._reader.bad_bytes

    def reset(self) -> None:
        """Forgets a message that has begun."""
        self._reader.restart()


@dataclass
class MavlinkReader(Reader[Reading]):
    """Readings from MAVLink: HIGHRES_IMU (forward, starboard, down), an attitude, the water's pressure, and GPS.

    Args:
        depth: the section that names the message of the pressure and turns it into a depth; None without.
        gravity_mps2: for that.
        attitude: the message of the attitude; None without.
        inertial: whether HIGHRES_IMU is read.
        gps: whether GPS_RAW_INT is read.
        system, component: of the sender; None for those of the first reading: two vehicles are never mixed.

    Attributes:
        bad_bytes: bytes that belonged to no message.
    """

    depth: DepthSection | None
    gravity_mps2: float
    attitude: AttitudeMessage | None = None
    inertial: bool = True
    gps: bool = False
    system: int | None = None
    component: int | None = None
    bad_bytes: int = 0

    def __post_init__(self) -> None:
        """Makes the parser.

        Raises:
            ScenarioError: where pymavlink is not installed.
        """
        self._dialect = dialect()
        self.framer = MavlinkFramer(self)
        self._kinds = set(self.wanted(SLOW_HZ))
        self.restart()

    def wanted(self, rate_hz: float) -> dict[str, float]:
        """The messages that are read, with the rates to ask for: `rate_hz`, of what does not move the vehicle 10 Hz."""
        slow_hz = min(rate_hz, SLOW_HZ)
        rates_hz = {"HIGHRES_IMU": rate_hz} if self.inertial else {}
        if self.attitude is not None:
            rates_hz[self.attitude] = slow_hz if self.inertial else rate_hz
        if self.depth is not None:
            rates_hz[self.depth.message] = slow_hz
        if self.gps:
            rates_hz["GPS_RAW_INT"] = slow_hz
        return rates_hz

    def restart(self) -> None:
        """A parser without a message that has begun."""
        self._parser: Any = self._dialect.MAVLink(None)
        self._parser.robust_parsing = True

    def feed(self, data: bytes) -> list[Reading]:
        """The readings that `data` completes."""
        found = []
        for message in self._parser.parse_buffer(data) or []:
            kind = message.get_type()
            if kind == "BAD_DATA":
                self.bad_bytes += len(message.data)
                continue
            self.records += 1
            reading = self._reading(kind, message)
            if reading is not None:
                found.append(reading)
        return found

    def _reading(self, kind: str, message: Any) -> Reading | None:  # noqa: ANN401 - untyped library
        if kind not in self._kinds:
            return None
        sender = message.get_srcSystem(), message.get_srcComponent()
        if sender[0] != (self.system or sender[0]) or sender[1] != (self.component or sender[1]):
            self.skipped.add(
                f"{kind} of system {sender[0]}, component {sender[1]}, and this source reads system "
                f"{self.system or 'any'}, component {self.component or 'any'}"
            )
            return None
        self.system, self.component = sender
        if kind == self.attitude:
            return self._turned(kind, message)
        if kind == "HIGHRES_IMU" and self.inertial:
            omega = (message.xgyro, message.ygyro, message.zgyro)
            force = (message.xacc, message.yacc, message.zacc)
            if all(map(math.isfinite, (*omega, *force))):
                return ImuReading(message.time_usec * 1000, omega, force)
            self.skipped.add("HIGHRES_IMU without finite numbers")
        elif kind == "GPS_RAW_INT" and self.gps:
            return self._fixed(message)
        elif self.depth is not None and kind == self.depth.message:
            pressure_pa = message.press_abs * PASCAL_PER_HECTOPASCAL
            if math.isfinite(pressure_pa):
                return DepthReading(
                    message.time_boot_ms * 1_000_000, self.depth.depth_m(pressure_pa, self.gravity_mps2)
                )
            self.skipped.add(f"{kind} without a finite pressure")
        return None

    def _fixed(self, message: Any) -> Reading | None:  # noqa: ANN401 - untyped library
        """GPS_RAW_INT: 1e-7 degrees, and mm above the sea."""
        latitude, longitude = message.lat * 1e-7, message.lon * 1e-7
        if message.fix_type < _FIX_3D or not is_on_earth(latitude, longitude):
            self.skipped.add("GPS_RAW_INT without a fix in 3D")
            return None
        return GpsReading(message.time_usec * 1000, latitude, longitude, message.alt * 1e-3)

    def _turned(self, kind: str, message: Any) -> Reading | None:  # noqa: ANN401 - untyped library
        """ATTITUDE in Euler angles, ATTITUDE_QUATERNION scalar first, both of forward-starboard-down to NED."""
        if kind == "ATTITUDE":
            parts: Quaternion = quaternion(message.roll, message.pitch, message.yaw)
        else:
            parts = (message.q1, message.q2, message.q3, message.q4)
        norm = math.hypot(*parts)
        # Also not for numbers that are none.
        if abs(norm - 1.0) < ROUNDING:
            w, x, y, z = (part / norm for part in parts)
            return AttitudeReading(message.time_boot_ms * 1_000_000, (w, x, y, z))
        self.skipped.add(f"{kind} without a unit quaternion")
        return None
