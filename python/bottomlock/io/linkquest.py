"""LinkQuest NavQuest as a ROS 1 log in CSV holds it (`rostopic echo -p`): the "Underwater caves" recording.

As recorded z points up and a beam's velocity is positive when the vehicle moves up along it: b0 = s vx + c vz with
s = sin 22°, c = cos 22°, likewise b1 with vy, b2 with -vx, b3 with -vy. Here beams are negated and the instrument's
velocity becomes (x, -y, -z), forward-right-down if x is forward and the recorded frame is right-handed.
"""

from bottomlock.errors import DataError
from bottomlock.io.beam_table import Account, Recording
from bottomlock.io.rows import NAN, PLAIN, Options, Rows, raise_if_empty
from bottomlock.io.sentences import lines_of, number, whole

NAME = "linkquest-csv"
_BEAMS = 4
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
_FLAGS = {b"0": False, b"1": True}


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
                f"{place}: column 'field.{name}' is missing, expected a log of a LinkQuest NavQuest"
            )
    return at


def read(data: bytes, place: str, options: Options = PLAIN) -> Recording:
    """Reads the pings of a log.

    Raises:
        DataError: where the header lacks a column, or no line can be read.
    """
    account = Account(unit="line")
    lines = lines_of(data)
    _, header = next(lines, (0, b""))
    at = _columns(header, place)
    width = header.count(b",") + 1
    rows = Rows(_BEAMS, account)
    for position, line in lines:
        account.read += 1
        fields = line.split(b",")
        if len(fields) == width:
            _add(rows, position, line, fields, at)
        else:
            account.skip("truncated" if len(fields) < width else "merged line", position, line)
    table = rows.finish(negate=options.negate_beams)
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


def _add(rows: Rows, position: int, line: bytes, fields: list[bytes], at: dict[str, int]) -> None:
    """Adds a line to the table, its signs turned to ours."""
    valid = [_FLAGS.get(fields[at[f"dataGood{k}"]]) for k in range(_BEAMS)]
    instrument_valid = _FLAGS.get(fields[at["velocityInstFlag"]])
    time_ns = whole(fields[at["header.stamp"]])
    found = [number(fields[at[name]]) for name in _NEEDED if name != "header.stamp" and "Good" not in name]
    if time_ns is None or instrument_valid is None or None in valid or None in found:
        rows.account.skip("a field that is no number", position, line)
        return
    values = [NAN if v is None else v for v in found]
    altitude, sound = values[12], values[13]
    vx, vy, vz = values[8:11]
    arrival = at.get("%time")
    rows.add(
        position,
        time_ns,
        [-v for v in values[4:8]],
        [bool(flag) for flag in valid],
        range_m=[a if a > 0.0 else NAN for a in values[:4]],
        instrument=(vx, -vy, -vz),
        verdict=int(instrument_valid),
        arrival_ns=None if arrival is None else whole(fields[arrival]),
        extra={"altitude_m": altitude if altitude > 0.0 else NAN, "sound_speed_mps": sound},
    )
