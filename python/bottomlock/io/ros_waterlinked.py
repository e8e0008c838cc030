"""Messages of the ROS drivers of Water Linked DVLs: the fields of the instrument's JSON, under names of their own.

`dvl_msgs/msg/DVL`, `waterlinked_a50_ros_driver/DVL` and relatives are told by their fields, since each driver has a
package of its own. The stamp of their header is when the driver received the report; some keep its validity.

Source: waterlinked/dvl-a50-ros-driver and paagutie/dvl-a50, msg/DVL.msg, msg/DVLBeam.msg and the code that fills them.
"""

from dataclasses import replace
from typing import Any

from bottomlock.io.beam_table import Recording
from bottomlock.io.decoder import Format, MessageDecoder
from bottomlock.io.ros_messages import LATER_DVL, stamp_ns
from bottomlock.io.waterlinked_json import ReportDecoder

_BEAMS = 4
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


class WaterLinkedDecoder(MessageDecoder, ReportDecoder):
    """The pings of such messages, in either version of `dvl_msgs/DVL` where ROS 2 has serialised them."""

    type = "dvl_msgs/DVL"
    later = LATER_DVL

    def __post_init__(self) -> None:
        """Begins."""
        super().__post_init__()
        self._read = self._validity = 0

    def message(self, position: int, arrival_ns: int, message: Any) -> None:  # noqa: ANN401 - the library's own object
        """Takes a message; when it came says nothing that its header does not."""
        del arrival_ns
        time_ns, own_us = stamp_ns(message.header), int(getattr(message, "time_of_validity", 0))
        self._read += 1
        if own_us > 0:
            self._validity += 1
            time_ns = own_us * 1000
        self.report(position, time_ns, _report(message))

    def recording(self) -> Recording:
        """The table, as `Decoder.recording`."""
        found, validity = self.tables("message of a DVL", _BEAMS), self._validity
        measured = 0 < validity == self._read
        notes = []
        if not measured:
            notes.append(
                "the stamp is when the driver received a report, later than the ping; the instrument's own log has "
                "the time of validity"
            )
        if 0 < validity < self._read:
            notes.append(f"only {validity} of {self._read} messages have a time of validity: the clock jumps")
        return replace(
            found,
            format="ros",
            clock="the instrument's, microseconds since 1970"
            if measured
            else "the message's header, the driver's host",
            time_of="validity" if measured else "arrival",
            quality="signal strength rssi as recorded (dBm from json_v2 on)",
            geometry="waterlinked_a50",
            notes=notes,
            facts={"formats": dict(sorted(self.formats.items()))},
        )


FORMAT = Format("ros-dvl-msgs", "dvl_msgs/DVL, a message", lambda _: False, WaterLinkedDecoder)


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
