"""LinkQuest NavQuest as a ROS 1 log in CSV holds it (`rostopic echo -p`): the "Underwater caves" recording.

As recorded z points up and a beam's velocity is positive when the vehicle moves up along it: b0 = s vx + c vz with
s = sin 22°, c = cos 22°, likewise b1 with vy, b2 with -vx, b3 with -vy. Here beams are negated and the instrument's
velocity becomes (x, -y, -z), forward-right-down if x is forward and the recorded frame is right-handed.
"""

from dataclasses import replace

from bottomlock.io.beam_table import Recording
from bottomlock.io.decoder import Format, Row, TableDecoder
from bottomlock.io.rows import NAN
from bottomlock.io.sentences import number, whole

_BEAMS = 4
_MOST_RANGE_M = 20_000.0
_PER_BEAM = ("dataGood", "altitudeBeam", "bottomVelocityBeam")


class _Decoder(TableDecoder):
    """A line a ping, its signs turned to ours."""

    frame = "frd"
    prefix = "field."
    needed = (
        "header.stamp",
        *(f"{what}{k}" for what in _PER_BEAM for k in range(_BEAMS)),
        *(f"velocityInst{k}" for k in range(3)),
        "velocityInstFlag",
        "altitude",
        "soundSpeed",
    )
    also = ("%time",)
    what = "a log of a LinkQuest NavQuest"

    def record(self, position: int, fields: list[bytes], line: bytes) -> bool:
        """Takes a ping."""
        stamp, *others, known, altitude_m, sound_mps, arrival = fields
        others += [altitude_m, sound_mps]
        flags, time_ns = [*others[:_BEAMS], known], whole(stamp)
        values = [v for one in others[_BEAMS:] if (v := number(one)) is not None]
        if time_ns is None or len(values) < len(others) - _BEAMS or not set(flags) <= {b"0", b"1"}:
            return False
        # Two lines that lost an end and a beginning may look like one: there is no checksum, and a time is no range.
        if max(values[:_BEAMS]) > _MOST_RANGE_M:
            self.account.skip("range beyond 20 km", position, line)
            return True
        x, y, z, altitude, sound = values[2 * _BEAMS :]
        row = Row(
            position=position,
            time_ns=time_ns,
            velocity=[-one for one in values[_BEAMS : 2 * _BEAMS]],
            valid=[flag == b"1" for flag in flags[:_BEAMS]],
            range_m=[one if one > 0.0 else NAN for one in values[:_BEAMS]],
            instrument=[x, -y, -z],
            verdict=int(known == b"1"),
            arrival_ns=whole(arrival),
            extra={"altitude_m": altitude if altitude > 0.0 else NAN, "sound_speed_mps": sound},
        )
        self.rows.append(row)
        return True

    def recording(self) -> Recording:
        """The table, as `Decoder.recording`."""
        return replace(
            self.tables("ping of a LinkQuest NavQuest", _BEAMS),
            clock="the logging host's, nanoseconds since 1970 (header.stamp)",
            geometry="linkquest_navquest",
            notes=[
                "beam velocities negated: recorded positive upwards",
                "instrument velocity (x, y, z up) to (x, -y, -z)",
                "a lost beam reads 0 m/s and is kept so, with its flag; its altitude is often 0 too, and then none",
                "range is the record's altitude of the beam, as it stands",
            ],
        )


def _sniff(head: bytes) -> bool:
    return b"bottomVelocityBeam0" in head.split(b"\n", 1)[0]


FORMAT = Format("linkquest-csv", "LinkQuest NavQuest, CSV of a ROS log", _sniff, _Decoder, live=False)
