"""Messages of DVLs from ROS 1 and ROS 2 bags and MCAP files, through the library rosbags.

`marine_acoustic_msgs/Dvl`, and those of Water Linked's drivers (`ros_waterlinked`). By the first one's definition its
stamp is the time of validity and z points where the instrument looks. It has no validity per beam. Lost is a beam whose
velocity is not finite, whose variance is -1 where others have one, or whose velocity is exactly 0 with a range of 0 or
less, as Water Linked's own driver fills it. A message that counts fewer good beams than these marks leave is used only
where its velocities of 0, or its missing ranges, say which beams are lost.

Source: Robotic-Decision-Making-Lab/waterlinked_dvl (Water Linked's ROS 2 driver), waterlinked_dvl_driver.cpp.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bottomlock.errors import DataError
from bottomlock.io import ros_waterlinked
from bottomlock.io.beam_table import BeamTable, Recording
from bottomlock.io.decoder import Format, MessageDecoder, Row
from bottomlock.io.ros_messages import DEFINITIONS, stamp_ns
from bottomlock.io.rows import NAN, PLAIN, Options
from bottomlock.io.sentences import printable
from bottomlock.libraries import install

NAME = "ros"
TYPES = ("marine_acoustic_msgs/msg/Dvl", "acoustic_msgs/msg/Dvl")
_BEAMS = 4
_BOTTOM, _WATER = 1, 2
_DRIVER_UNIT = math.sin(math.radians(67.5)) * math.sqrt(0.5), math.cos(math.radians(67.5))
"""Horizontal and downward parts of the unit vectors in Water Linked's driver: its A50 measures at 22.5 degrees."""
_UNRESOLVED = "fewer good beams than velocities, and no mark of the lost ones"
_ROS1, _MCAP, _SQLITE = b"#ROSBAG V2.0", b"\x89MCAP0\r\n", b"SQLite format 3\x00"


def sniff_path(path: Path, head: bytes) -> bool:
    """Whether a file or folder looks like a bag."""
    return (path.is_dir() and (path / "metadata.yaml").is_file()) or head.startswith((_ROS1, _MCAP, _SQLITE))


def typestore(latest: bool = True) -> Any:  # noqa: ANN401, FBT001, FBT002 - the library's own object
    """The library's store of message types with ours in it.

    Raises:
        DataError: where the library is not installed.
    """
    try:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise DataError(f"bags and MCAP files need the library rosbags: {install('ros')}") from error
    store = get_typestore(Stores.LATEST if latest else Stores.ROS1_NOETIC)
    # ROS 2 bags in SQLite hold no definitions.
    for name in TYPES:
        store.register(get_types_from_msg(DEFINITIONS["marine_acoustic_msgs/Dvl"], name))
    return store


def _messages(path: Path, options: Options, place: str) -> Iterator[tuple[int, Any]]:
    """Arrival time and message of the bag's only topic of a DVL, or of the requested one."""
    store = typestore()
    from rosbags.highlevel import AnyReader  # noqa: PLC0415 - an extra; typestore raises without it

    with AnyReader([path], default_typestore=store) as reader:
        known = reader.typestore.fielddefs
        connections = [
            c for c in reader.connections if c.msgtype in TYPES or ros_waterlinked.fits(known, c.msgtype)
        ]
        topics = sorted({c.topic for c in connections})
        if options.topic is not None:
            connections = [c for c in connections if c.topic == options.topic]
        elif len(topics) > 1:
            raise DataError(
                f"topics {printable(', '.join(topics))} hold messages of a DVL",
                place=place,
                hint="choose one with --topic",
            )
        if not connections:
            wanted = f"topic '{options.topic}' with " if options.topic else "topic of "
            others = (
                ", ".join(sorted({f"{c.topic} ({c.msgtype})" for c in reader.connections})[:12]) or "none"
            )
            raise DataError(
                f"no {wanted}{TYPES[0]}{_undefined(reader)}", place=place, hint=f"topics: {printable(others)}"
            )
        for connection, arrival_ns, raw in reader.messages(connections=connections):
            yield arrival_ns, reader.deserialize(raw, connection.msgtype)


def _undefined(reader: Any) -> str:  # noqa: ANN401 - the library's own object
    """Words for topics that may be of a DVL, but whose definition the bag does not hold."""
    names = sorted(
        f"{c.topic} ({c.msgtype})"
        for c in reader.connections
        if "dvl" in c.msgtype.lower() and c.msgtype not in reader.typestore.fielddefs
    )
    if not names:
        return ""
    return (
        f", and no definition of {printable(', '.join(names))}, as SQLite bags of ROS 2 Humble and before have none: "
        "convert it to MCAP with `ros2 bag convert` where its package is installed"
    )


def read_path(path: Path, place: str, options: Options = PLAIN) -> Recording:
    """The pings of a bag.

    Raises:
        DataError: for a bag that the library cannot read, without or with several such topics, or without pings.
    """
    pings: MessageDecoder = _Decoder(place, options)
    account = pings.account
    try:
        for position, (arrival_ns, message) in enumerate(_messages(path, options, place), 1):
            account.read += 1
            if not hasattr(message, "beam_velocity") and isinstance(pings, _Decoder):
                pings = ros_waterlinked.WaterLinkedDecoder(place, options)
                pings.account = account
            pings.message(position, arrival_ns, message)
    except DataError:
        raise
    # A damaged bag raises whatever the library's parts raise; the user needs the file's name and the reason.
    except Exception as error:
        reason = printable(str(error).splitlines()[0])[:200] if str(error) else type(error).__name__
        if not pings.rows:
            raise DataError(f"cannot be read as a bag ({reason})", place=place) from error
        account.skip("the bag breaks off here", account.read + 1, reason)
    return pings.recording()


class _Decoder(MessageDecoder):
    """The pings of `marine_acoustic_msgs/Dvl`."""

    type = "marine_acoustic_msgs/Dvl"

    def __post_init__(self) -> None:
        """Begins."""
        super().__post_init__()
        self._geometry: list[list[list[float]]] = []

    def message(self, position: int, arrival_ns: int, message: Any) -> None:  # noqa: ANN401 - the library's own object
        """Takes a message; beams that repeat the message before are no new measurement."""
        account = self.account
        if message.velocity_mode == _WATER:
            account.pass_by("velocity through the water", position)
            return
        if message.velocity_mode != _BOTTOM:
            account.flag("velocity mode is not stated", position, f"velocity_mode = {message.velocity_mode}")
        velocity = [float(v) for v in message.beam_velocity]
        ranges = [float(r) for r in message.range]
        unit = [[float(b.x), float(b.y), float(b.z)] for b in message.beam_unit_vec]
        good = _stated_good(message, velocity, ranges)
        if bool(message.beam_velocities_valid) and not any(map(any, unit)) and not any(velocity):
            account.flag("driver fills in no beams", position)
            good = [False] * _BEAMS
        elif sum(good) > message.num_good_beams:
            ranged = any(r > 0.0 for r in ranges)
            good = [
                g and v != 0.0 and (r > 0.0 or not ranged)
                for g, v, r in zip(good, velocity, ranges, strict=True)
            ]
            if sum(good) != message.num_good_beams:
                account.skip(_UNRESOLVED, position, f"num_good_beams = {message.num_good_beams}")
                return
        if any(map(any, unit)):
            self._geometry.append(unit)
        if sum(good) < message.num_good_beams:
            account.flag(
                "num_good_beams disagrees with the beams",
                position,
                f"{message.num_good_beams} and {sum(good)}",
            )
        quality = [float(q) for q in message.beam_quality]
        good, stale = self.fresh(position, (velocity, ranges, quality), good)
        spread = [float(message.velocity_covar[k]) for k in (0, 4, 8)]
        axes = [float(message.velocity.x), float(message.velocity.y), float(message.velocity.z)]
        altitude, sound = float(message.altitude), float(message.sound_speed)
        row = Row(
            position=position,
            time_ns=stamp_ns(message.header),
            velocity=velocity,
            valid=good,
            range_m=[r if message.beam_ranges_valid and r > 0.0 else NAN for r in ranges],
            quality=quality,
            sd=[math.sqrt(v) if v > 0.0 else NAN for v in map(float, message.beam_velocity_covar)],
            instrument=axes,
            verdict=int(all(math.isfinite(v) for v in axes) and message.num_good_beams >= 3),
            arrival_ns=int(arrival_ns),
            stale=stale,
            extra={
                "altitude_m": altitude if altitude > 0.0 else NAN,
                "instrument_sd_mps": math.sqrt(max(spread)) if min(spread) > 0.0 else NAN,
                "sound_speed_mps": sound if sound > 0.0 else NAN,
            },
        )
        self.rows.append(row)

    def recording(self) -> Recording:
        """The table, as `Decoder.recording`."""
        found, geometry = self.tables(TYPES[0], _BEAMS), self._geometry
        unit = np.array(geometry[0]) if geometry else np.zeros((_BEAMS, 3))
        across, down = _DRIVER_UNIT
        wrong = bool(np.allclose(np.abs(unit), [across, across, down], atol=1e-6))
        notes = _notes(found.table, unit, same=all(one == geometry[0] for one in geometry))
        if wrong:
            notes.append(
                "beam_unit_vec is 67.5 deg from down, a mistake of Water Linked's driver: it is not used"
            )
        return replace(
            found,
            format=NAME,
            clock="the message's header, nanoseconds since 1970",
            time_of="validity",
            quality="beam_quality as recorded; its meaning is the driver's",
            geometry="waterlinked_a50" if wrong else "",
            notes=notes,
            facts={} if wrong else {"beam_unit_vec": np.round(unit, 9).tolist()},
        )


def _stated_good(message: Any, velocity: list[float], ranges: list[float]) -> list[bool]:  # noqa: ANN401
    """Which beams no mark of the message says to be lost."""
    variance = [float(v) for v in message.beam_velocity_covar]
    some_known = any(v > 0.0 for v in variance)
    return [
        bool(message.beam_velocities_valid)
        and math.isfinite(v)
        and not (some_known and c < 0.0)
        and not (v == 0.0 and r <= 0.0)
        for v, c, r in zip(velocity, variance, ranges, strict=True)
    ]


def _notes(table: BeamTable, unit: np.ndarray[Any, Any], *, same: bool) -> list[str]:
    notes = ["the message has no flag for its velocity: it counts as valid with three good beams or more"]
    if not same:
        notes.append("beam_unit_vec changes within the recording: facts hold the first")
    whole = table.valid.all(axis=1) & np.isfinite(table.instrument_mps).all(axis=1)
    if whole.any() and unit.any():
        expected, found = table.instrument_mps[whole] @ unit.T, table.velocity_mps[whole]
        if float((expected * found).sum()) < -0.5 * float((expected * expected).sum()):
            notes.append(
                "beam velocities are opposite to beam_unit_vec . velocity: convert with --negate-beams"
            )
    return notes


FORMAT = Format("ros-dvl", "marine_acoustic_msgs/Dvl, a message", lambda _: False, _Decoder, figures=True)
