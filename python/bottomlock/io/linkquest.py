"""LinkQuest NavQuest as a ROS 1 log in CSV holds it (`rostopic echo -p`): the "Underwater caves" recording.

As recorded z points up and a beam's velocity is positive when the vehicle moves up along it: b0 = s vx + c vz with
s = sin 22°, c = cos 22°, likewise b1 with vy, b2 with -vx, b3 with -vy. Here beams are negated and the instrument's
velocity becomes (x, -y, -z), forward-right-down if x is forward and the recorded frame is right-handed.
"""

from dataclasses import replace

from bottomlock.errors import DataError
from bottomlock.io.beam_table import Recording
from bottomlock.io.decoder import Format, LineDecoder, Row
from bottomlock.io.rows import NAN
from bottomlock.io.sentences import number, whole

_BEAMS = 4
_MOST_RANGE_M = 20_000.0
_NEEDED = (
    "header.stamp",
    *(f"dataGood{k}" for k in range(_BEAMS)),
    *(f"altitudeBeam{k}" for k in range(_BEAMS)),
    *(f"bottomVelocityBeam{k}" for k in range(_BEAMS)),
    "velocityInst0",
    "velocityInst1",
    "velocityInst2",
    "velocityInstFlag",
    "altitude",
    "soundSpeed",
)
_FLAGS = tuple(name for name in _NEEDED if name.startswith("dataGood") or name.endswith("Flag"))
_NUMBERS = tuple(name for name in _NEEDED[1:] if name not in _FLAGS)


def _columns(header: bytes, place: str) -> dict[str, int]:
    """Index of each needed column, by its name without `field.`."""
    names = [name.strip().decode("utf-8", "replace").removeprefix("field.") for name in header.split(b",")]
    at = {name: k for k, name in enumerate(names)}
    for name in _NEEDED:
        if name not in at:
            raise DataError(
                "is missing",
                place=place,
                key=f"column 'field.{name}'",
                expected="a log of a LinkQuest NavQuest",
            )
    return at


class _Decoder(LineDecoder):
    """A header, and a line a ping, their signs turned to ours."""

    frame = "frd"
    longest = 1 << 24
    _header: dict[str, int] | None = None
    _width = 0

    def line(self, position: int, line: bytes) -> None:
        """Takes the header or a ping.

        Raises:
            DataError: where the header lacks a column.
        """
        if self._header is None:
            self._header, self._width = _columns(line, self.place), line.count(b",") + 1
            return
        at, account = self._header, self.account
        account.read += 1
        fields = line.split(b",")
        if len(fields) != self._width:
            account.skip("truncated" if len(fields) < self._width else "merged line", position, line)
            return
        time_ns = whole(fields[at["header.stamp"]])
        flags = [fields[at[name]] for name in _FLAGS]
        values = [v for name in _NUMBERS if (v := number(fields[at[name]])) is not None]
        if time_ns is None or len(values) < len(_NUMBERS) or not set(flags) <= {b"0", b"1"}:
            account.skip("a field that is no number", position, line)
            return
        # Two lines that lost an end and a beginning may look like one: there is no checksum, and a time is no range.
        if max(values[:_BEAMS]) > _MOST_RANGE_M:
            account.skip("range beyond 20 km", position, line)
            return
        x, y, z, altitude, sound = values[2 * _BEAMS :]
        row = Row(
            position=position,
            time_ns=time_ns,
            velocity=[-one for one in values[_BEAMS : 2 * _BEAMS]],
            valid=[flag == b"1" for flag in flags[:_BEAMS]],
            range_m=[one if one > 0.0 else NAN for one in values[:_BEAMS]],
            instrument=[x, -y, -z],
            verdict=int(flags[_BEAMS] == b"1"),
            arrival_ns=whole(fields[at["%time"]]) if "%time" in at else None,
            extra={"altitude_m": altitude if altitude > 0.0 else NAN, "sound_speed_mps": sound},
        )
        self.rows.append(row)

    def recording(self) -> Recording:
        """The table, as `Decoder.recording`; DataError also for a file without a header."""
        if self._header is None:
            _columns(b"", self.place)
        return replace(
            self.tables("ping of a LinkQuest NavQuest", _BEAMS),
            clock="the logging host's, nanoseconds since 1970 (header.stamp)",
            corrected=[
                "beam velocities negated: recorded positive upwards",
                "instrument velocity (x, y, z up) to (x, -y, -z)",
            ],
            geometry="linkquest_navquest",
            notes=[
                "a lost beam reads 0 m/s and is kept so, with its flag; its altitude is often 0 too, and then none",
                "range is the record's altitude of the beam, as it stands",
            ],
        )


def _sniff(head: bytes) -> bool:
    return b"bottomVelocityBeam0" in head.split(b"\n", 1)[0]


FORMAT = Format("linkquest-csv", "LinkQuest NavQuest, CSV of a ROS log", _sniff, _Decoder, live=False)
