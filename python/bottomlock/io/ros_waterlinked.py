"""Messages of the ROS drivers of Water Linked DVLs: the fields of the instrument's JSON, under names of their own.

`dvl_msgs/msg/DVL`, `waterlinked_a50_ros_driver/DVL` and relatives are told by their fields, since each driver has a
package of its own. The stamp of their header is when the driver received the report; some keep its validity.

Source: waterlinked/dvl-a50-ros-driver and paagutie/dvl-a50, msg/DVL.msg, msg/DVLBeam.msg and the code that fills them.
"""

from collections.abc import Iterable
from typing import Any

from bottomlock.errors import DataError
from bottomlock.io.beam_table import Account, Recording
from bottomlock.io.framing import Framer, Stream
from bottomlock.io.ros_messages import LATER_DVL, decode, stamp_ns
from bottomlock.io.rows import PLAIN, Options, raise_if_empty
from bottomlock.io.waterlinked_json import Reports

NAME_MESSAGE = "ros-dvl-msgs"
STREAM = Stream(lambda _: Framer(), repeats=True)
_TYPE = "dvl_msgs/DVL"
_FIELDS = {"header", "velocity", "fom", "altitude", "beams", "velocity_valid"}
_OF_BEAM = {"id", "velocity", "distance", "rssi", "nsd", "valid"}


def fits(fielddefs: dict[str, Any], kind: str) -> bool:
    """Whether a type of message has the fields, by the library's definitions of a bag."""
    fields = dict(fielddefs[kind][1]) if kind in fielddefs else {}
    if not fields.keys() >= _FIELDS:
        return False
    # An array is (its kind, ((node, type of one), size)), of which the type is looked up.
    _, inner = fields["beams"]
    of = inner[0][1] if isinstance(inner, tuple) and isinstance(inner[0], tuple) else ""
    return of in fielddefs and {name for name, _ in fielddefs[of][1]} >= _OF_BEAM


def read_message(data: bytes, place: str, options: Options = PLAIN) -> Recording:
    """The ping of one `dvl_msgs/DVL`, of either version, as ROS 2 serialises it.

    Raises:
        DataError: for bytes that are no such message, and for one without a ping.
    """
    return recording(NAME_MESSAGE, [(1, _decoded(data))], Account(unit="message", read=1), place, options)


def _decoded(data: bytes) -> Any:  # noqa: ANN401 - as the definition says
    """The message in the version that the bytes hold from their first to their last."""
    try:
        return decode(data, _TYPE)
    except DataError as first:
        try:
            return decode(data, _TYPE, LATER_DVL)
        except DataError:
            raise first from None


def recording(
    name: str, messages: Iterable[tuple[int, Any]], account: Account, place: str, options: Options
) -> Recording:
    """The pings of such messages.

    Args:
        name: of the format.
        messages: number and message, in the order of the bag.
        account: takes what becomes of them.
        place: the file, for errors.
        options: settings of the reader.

    Raises:
        DataError: where no message is a ping.
    """
    reports, validity = Reports(account, keep_stale=options.keep_stale), 0
    for position, message in messages:
        time_ns = stamp_ns(message.header)
        own_us = int(getattr(message, "time_of_validity", 0))
        if own_us > 0:
            validity += 1
            time_ns = own_us * 1000
        reports.add(position, time_ns, _report(message))
    table = reports.table(negate=options.negate_beams)
    raise_if_empty(account, place, "message of a DVL")
    measured = 0 < validity == account.read
    notes = []
    if not measured:
        notes.append(
            "the stamp is when the driver received a report, later than the ping; the instrument's own log has "
            "the time of validity"
        )
    if 0 < validity < account.read:
        notes.append(f"only {validity} of {account.read} messages have a time of validity: the clock jumps")
    return Recording(
        format=name,
        table=table,
        account=account,
        frame="frd",
        clock="the instrument's, microseconds since 1970"
        if measured
        else "the message's header, the driver's host",
        time_of="validity" if measured else "arrival",
        quality="signal strength rssi as recorded (dBm from json_v2 on)",
        geometry="waterlinked_a50",
        notes=notes,
        facts={"formats": dict(sorted(reports.formats.items()))},
    )


def _report(message: Any) -> dict[str, Any]:  # noqa: ANN401 - the library's own objects
    """The message as the instrument's JSON. Its altitude is none without a valid velocity: drivers repeat the last."""
    valid = bool(message.velocity_valid)
    v = message.velocity
    return {
        "format": str(getattr(message, "form", "")) or "none",
        "vx": float(v.x),
        "vy": float(v.y),
        "vz": float(v.z),
        "fom": float(message.fom),
        "altitude": float(message.altitude) if valid else -1.0,
        "velocity_valid": valid,
        "transducers": [
            {
                "id": int(beam.id),
                "velocity": float(beam.velocity),
                "distance": float(beam.distance),
                "rssi": float(beam.rssi),
                "nsd": float(beam.nsd),
                "beam_valid": bool(beam.valid),
            }
            for beam in message.beams
        ],
    }
