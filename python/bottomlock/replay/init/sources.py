"""What the given files hold: the log of a DVL, and every other stream in tables, bags and logs of autopilots.

Frames in bags are those of REP 103, x east, y north, z up and, of the vehicle, x forward, y left, z up, except where
the name of the frame has "ned" or "frd" in it. A stamp of 0 is none: then the bag's time is used.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from bottomlock.errors import DataError
from bottomlock.files.table_file import content
from bottomlock.io import ardupilot, ros, table, tlog
from bottomlock.io.beam_table import Recording
from bottomlock.io.columns import column_names
from bottomlock.io.formats import format_of, read_recording
from bottomlock.io.ros import typestore
from bottomlock.io.ros_messages import stamp_ns
from bottomlock.io.rows import Options
from bottomlock.io.sentences import printable
from bottomlock.replay.init.any_table import NAMES, AnyTable, read_any_table
from bottomlock.replay.init.beam_columns import beam_columns, beam_role
from bottomlock.replay.init.found import Found, find_streams, in_order, numbers
from bottomlock.replay.init.names import named
from bottomlock.text import did_you_mean

_Row = dict[str, float]


def _vector(message: Any, names: tuple[str, ...]) -> _Row:  # noqa: ANN401 - a message of a bag
    return {f"{name}": float(getattr(message, name[-1])) for name in names}


def _imu(m: Any) -> _Row:  # noqa: ANN401
    rows = _vector(m.linear_acceleration, ("acc_x", "acc_y", "acc_z"))
    rows |= _vector(m.angular_velocity, ("gyro_x", "gyro_y", "gyro_z"))
    q = m.orientation
    known = float(m.orientation_covariance[0]) >= 0.0 and abs(q.w) + abs(q.x) + abs(q.y) + abs(q.z) > 0.0
    return rows | (_vector(q, ("q_w", "q_x", "q_y", "q_z")) if known else {})


def _position(m: Any, p: Any) -> _Row:  # noqa: ANN401
    x, y, z = float(p.x), float(p.y), float(p.z)
    if "ned" in m.header.frame_id.lower():
        return {"north": x, "east": y, "down": z}
    return {"east": x, "north": y, "down": -z}


def _posed(m: Any, pose: Any) -> _Row:  # noqa: ANN401
    """Position, and the attitude where it is one: a transponder has none, and its message the identity or zeros."""
    q = pose.orientation
    turned = abs(q.x) + abs(q.y) + abs(q.z) > 0.0
    return _position(m, pose.position) | (_vector(q, ("q_w", "q_x", "q_y", "q_z")) if turned else {})


def _velocity(m: Any, twist: Any) -> _Row:  # noqa: ANN401
    x, y, z = (float(getattr(twist.linear, axis)) for axis in "xyz")
    sign = 1.0 if any(word in m.header.frame_id.lower() for word in ("frd", "ned")) else -1.0
    return {"surge_mps": x, "sway_mps": sign * y, "heave_mps": sign * z}


def _fix(m: Any) -> _Row:  # noqa: ANN401
    if m.status.status < 0:
        return {}
    return {"latitude": float(m.latitude), "longitude": float(m.longitude), "height": float(m.altitude)}


READERS: dict[str, Callable[[Any], _Row]] = {
    "sensor_msgs/msg/Imu": _imu,
    "sensor_msgs/msg/NavSatFix": _fix,
    "sensor_msgs/msg/FluidPressure": lambda m: {"pressure_pa": float(m.fluid_pressure)},
    "nav_msgs/msg/Odometry": lambda m: _posed(m, m.pose.pose),
    "geometry_msgs/msg/PoseStamped": lambda m: _posed(m, m.pose),
    "geometry_msgs/msg/PoseWithCovarianceStamped": lambda m: _posed(m, m.pose.pose),
    "geometry_msgs/msg/PointStamped": lambda m: _position(m, m.point),
    "geometry_msgs/msg/QuaternionStamped": lambda m: _vector(m.quaternion, ("q_w", "q_x", "q_y", "q_z")),
    "geometry_msgs/msg/TwistStamped": lambda m: _velocity(m, m.twist),
    "geometry_msgs/msg/TwistWithCovarianceStamped": lambda m: _velocity(m, m.twist.twist),
}  # fmt: skip
DEPTHS = ("std_msgs/msg/Float64", "std_msgs/msg/Float32")
"""Numbers without a header: a depth where the topic's name says so, at the time of the bag."""
_REMARKS = {
    f"geometry_msgs/msg/{name}": "taken as forward, left, up (REP 103) unless its frame is named frd or ned"
    for name in ("TwistStamped", "TwistWithCovarianceStamped")
}
STAMPED = "stamped by the bag, since the message has no time"


def _is_depth(connection: Any) -> bool:  # noqa: ANN401 - the library's own object
    return connection.msgtype in DEPTHS and "depth" in connection.topic.lower()


def bag_tables(path: Path) -> list[AnyTable]:
    """A table for each topic of a known type, with the stamp of the header.

    Raises:
        DataError: where the library is not installed, or cannot read the bag.
    """
    store = typestore()
    from rosbags.highlevel import AnyReader  # noqa: PLC0415 - an extra; typestore raises without it

    rows: dict[str, list[dict[str, Any]]] = {}
    remarks: dict[str, str] = {}
    try:
        with AnyReader([path], default_typestore=store) as reader:
            chosen = [c for c in reader.connections if c.msgtype in READERS or _is_depth(c)]
            for connection, arrival_ns, raw in reader.messages(connections=chosen) if chosen else ():
                message: Any = reader.deserialize(raw, connection.msgtype)
                time_ns = 0
                if connection.msgtype in READERS:
                    time_ns = stamp_ns(message.header)
                    row = READERS[connection.msgtype](message)
                else:
                    row = {"depth_m": float(message.data)}
                if not row:
                    continue
                rows.setdefault(connection.topic, []).append({"time_ns": time_ns or int(arrival_ns)} | row)
                remarks[connection.topic] = _REMARKS.get(connection.msgtype, "") if time_ns else STAMPED
    # A damaged bag raises whatever the library's parts raise.
    except Exception as error:
        reason = printable(str(error).splitlines()[0])[:200] if str(error) else type(error).__name__
        if not rows:
            raise DataError(f"cannot be read as a bag ({reason})", place=path) from error
        remarks = {
            topic: "; ".join(filter(None, (of, f"the bag breaks off ({reason})")))
            for topic, of in remarks.items()
        }
    return [
        AnyTable(
            path, pl.DataFrame(of, infer_schema_length=None), plain=False, units={}, part=topic, remark=remarks[topic]
        )
        for topic, of in rows.items()
    ]  # fmt: skip


@dataclass(frozen=True, eq=False)
class Sources:
    """Streams of some files.

    Attributes:
        recording: of the DVL, with its path; None where the DVL is a velocity in a table.
        log: path of the DVL's log.
        streams: of all tables.
        parts: names of the topics and messages of all logs.
        words: a line for each file: what it holds.
    """

    recording: Recording | None = None
    log: Path | None = None
    streams: tuple[Found, ...] = ()
    parts: tuple[str, ...] = ()
    words: tuple[str, ...] = ()

    def of(self, *kinds: str) -> list[Found]:
        """The streams of some kinds, in the order of the files."""
        return [one for one in self.streams if one.kind in kinds]

    def timed(self, *kinds: str) -> list[Found]:
        """Those of them that have times."""
        return [one for one in self.of(*kinds) if one.times.time_ns is not None]


def read_sources(files: Sequence[Path], without: Sequence[str] = ()) -> Sources:
    """Reads every file, and finds its streams.

    Args:
        files: logs, tables and bags.
        without: topics of bags and messages of autopilots' logs that are left out.

    Raises:
        DataError: for no file, one that cannot be read, and one without anything that a case could use; for a name in
            `without` that no file holds.
    """
    if not files:
        raise DataError("no file is named: bottomlock replay --init FILE... looks at logs and tables")
    found = _joined([_file(path, without) for path in files])
    for one in without:
        if one not in found.parts:
            hint = did_you_mean(one, found.parts) or ","
            held = ", ".join(found.parts) or "none"
            raise DataError(
                f"is '{one}'{hint} expected a topic or message of the logs: {held}", key="--without"
            )
    return found


def _joined(parts: Sequence[Sources]) -> Sources:
    """All of them as one; one at most may have a log of a DVL."""
    logs = [one for one in parts if one.log is not None]
    for second in logs[1:]:
        raise DataError(
            f"is the second log of a DVL, after {logs[0].log}", place=second.log, hint="name one of them"
        )
    return Sources(
        logs[0].recording if logs else None, logs[0].log if logs else None,
        *(tuple(one for part in parts for one in getattr(part, key)) for key in ("streams", "parts", "words")),
    )  # fmt: skip


def _file(path: Path, without: Sequence[str]) -> Sources:
    name = format_of(path)
    if name == ros.NAME:
        return _bag(path, without)
    if name in {ardupilot.NAME, tlog.NAME}:
        reader = ardupilot if name == ardupilot.NAME else tlog
        log = reader.streams(content(path, reader.TIMES_ITS_SIZE), str(path))
        tables = [
            AnyTable(
                path, one.to_frame(), plain=False, units={}, part=one.name, remark=one.remark,
                independent=one.independent,
            )
            for one in log.streams
        ]  # fmt: skip
        words = tuple(f"{path.name}: {one}" for one in (f"clock: {log.clock}", *log.notes))
        return _joined([*_parts(tables, without), Sources(words=words)])
    if name is not None and name != table.NAME:
        return _recorded(path, _log(path, name))
    return _table(in_order(read_any_table(path)))


def _recorded(path: Path, recording: Recording) -> Sources:
    beams = recording.table.beams
    what = f"{recording.table.rows} pings of {beams} beams" if beams else f"{recording.table.rows} velocities"
    return Sources(recording, path, words=(f"{path.name}: {what} ({recording.format})",))


def _log(path: Path, name: str) -> Recording:
    try:
        return read_recording(path, format=name)
    except DataError as first:
        try:
            return read_recording(path, format=name, options=Options(instrument_only=True))
        except DataError:
            raise first from None


def _bag(path: Path, without: Sequence[str]) -> Sources:
    tables = bag_tables(path)
    try:
        dvl = _recorded(path, read_recording(path, format=ros.NAME))
    except DataError as error:
        if not tables:
            raise
        dvl = Sources(words=(str(error),))
    return _joined([dvl, *_parts(tables, without)])


def _parts(tables: Sequence[AnyTable], without: Sequence[str]) -> list[Sources]:
    """The tables of a log of several, but those that are left out."""
    names = Sources(parts=tuple(one.part for one in tables))
    return [names, *(_table(one) for one in tables if one.part not in without)]


def _table(one: AnyTable) -> Sources:
    columns, path = beam_columns(one), one.path
    words, beams = [], Sources()
    if columns is not None:
        recording = table.read_frame(columns.frame, columns.columns, str(path))
        beams = _recorded(path, replace(recording, notes=[*recording.notes, columns.why]))
        words = [*beams.words, "; ".join(filter(None, (f"{path.name}: {columns.why}", one.remark)))]
    streams = [
        stream for stream in find_streams(one) if not (columns is not None and stream.kind == "velocity")
    ]
    if not streams and columns is None:
        known = [name for name in one.frame.columns if named(name) is not None or beam_role(name) is not None]
        none = [name for name in known if not np.isfinite(numbers(one.frame[name])).any()]
        first = "".join(
            printable(str(cell)) for name in none[:1] for cell in one.frame[name].drop_nulls()[:1]
        )
        which = (
            f"{', '.join(none)} hold no numbers ('{first}')" if none else
            f"{', '.join(known)} alone make no stream" if known else "none of its columns has a known name"
        )  # fmt: skip
        raise DataError(f"{which} ({column_names(one.frame)})", place=path, hint=NAMES)
    if streams:
        rows = one.frame.height
        rate = ""
        if streams[0].times.time_ns is not None and rows > 2:
            step_s = float(np.median(np.diff(streams[0].times.time_ns))) * 1e-9
            rate = f", {1.0 / step_s:.4g} Hz" if step_s > 0.0 else ""
        kinds = ", ".join(stream.kind for stream in streams)
        where = f" {one.part}" if one.part else ""
        said = f"; {one.remark}" if one.remark else ""
        words.append(f"{path.name}{where}: {kinds} ({rows} rows{rate}){said}")
    return Sources(beams.recording, beams.log, tuple(streams), words=tuple(words))
