"""LinkQuest NavQuest as a ROS 1 log in CSV holds it (`rostopic echo -p`): the "Underwater caves" recording.

As recorded z points up and a beam's velocity is positive when the vehicle moves up along it: b0 = s vx + c vz with
s = sin 22°, c = cos 22°, likewise b1 with vy, b2 with -vx, b3 with -vy. Here beams are negated and the instrument's
velocity becomes (x, -y, -z), forward-right-down if x is forward and the recorded frame is right-handed.
"""

import numpy as np

from bottomlock.errors import DataError
from bottomlock.io.beam_table import Account, BeamTable, Recording
from bottomlock.io.rows import NAN, PLAIN, Options, make_table, raise_if_empty
from bottomlock.io.sentences import lines_of, number, whole

NAME = "linkquest-csv"
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

Row = tuple[int, int, int | None, list[bool], list[float]]
"""Line, time, arrival (ns), flags of the beams and the instrument (5), numbers (13)."""


def sniff(head: bytes) -> bool:
    """Whether the beginning of a file looks like this format."""
    return b"bottomVelocityBeam0" in head.split(b"\n", 1)[0]


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


def read(data: bytes, place: str, options: Options = PLAIN) -> Recording:
    """Reads the pings of a log.

    Raises:
        DataError: where the header lacks a column, or no line can be read.
    """
    account = Account(unit="line")
    lines = lines_of(data)
    header = next(lines, (0, b""))[1]
    at = _columns(header, place)
    width = header.count(b",") + 1
    rows = [row for position, line in lines if (row := _row(position, line, at, width, account)) is not None]
    table = _table(rows, account, options)
    raise_if_empty(account, place, "ping of a LinkQuest NavQuest")
    return Recording(
        format=NAME,
        table=table,
        account=account,
        frame="frd",
        clock="the logging host's, nanoseconds since 1970 (header.stamp)",
        time_of="record",
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


def _row(position: int, line: bytes, at: dict[str, int], width: int, account: Account) -> Row | None:
    """A line; None where it cannot be read, which is counted."""
    account.read += 1
    fields = line.split(b",")
    if len(fields) != width:
        account.skip("truncated" if len(fields) < width else "merged line", position, line)
        return None
    time_ns = whole(fields[at["header.stamp"]])
    flags = [fields[at[name]] for name in _FLAGS]
    values = [v for name in _NUMBERS if (v := number(fields[at[name]])) is not None]
    if time_ns is None or len(values) < len(_NUMBERS) or not set(flags) <= {b"0", b"1"}:
        account.skip("a field that is no number", position, line)
        return None
    # Two lines that lost an end and a beginning may look like one: there is no checksum, and a time is no range.
    if max(values[:_BEAMS]) > _MOST_RANGE_M:
        account.skip("range beyond 20 km", position, line)
        return None
    arrival_ns = whole(fields[at["%time"]]) if "%time" in at else None
    return position, time_ns, arrival_ns, [flag == b"1" for flag in flags], values


def _table(rows: list[Row], account: Account, options: Options) -> BeamTable:
    """The table, its signs turned to ours."""
    flags = np.array([row[3] for row in rows], dtype=bool).reshape(-1, len(_FLAGS))
    values = np.array([row[4] for row in rows]).reshape(-1, len(_NUMBERS))
    ranges, velocity, instrument, altitude = values[:, :4], values[:, 4:8], values[:, 8:11], values[:, 11]
    return make_table(
        account,
        _BEAMS,
        [row[0] for row in rows],
        [row[1] for row in rows],
        -velocity,
        flags[:, :_BEAMS],
        range_m=np.where(ranges > 0.0, ranges, NAN),
        instrument=instrument * np.array([1.0, -1.0, -1.0]),
        verdict=flags[:, _BEAMS],
        arrival_ns=[row[2] for row in rows],
        extra={"altitude_m": np.where(altitude > 0.0, altitude, NAN), "sound_speed_mps": values[:, 12]},
        negate=options.negate_beams,
    )
