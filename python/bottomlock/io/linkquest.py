"""LinkQuest NavQuest as a ROS 1 log in CSV holds it (`rostopic echo -p`): the "Underwater caves" recording.

As recorded z points up and a beam's velocity is positive when the vehicle moves up along it: b0 = s vx + c vz with
s = sin 22°, c = cos 22°, likewise b1 with vy, b2 with -vx, b3 with -vy. Here beams are negated and the instrument's
velocity becomes (x, -y, -z), forward-right-down if x is forward and the recorded frame is right-handed.
"""

from dataclasses import dataclass

import numpy as np

from bottomlock.errors import DataError
from bottomlock.io.beam_table import Account, BeamTable, Floats, Integers, Recording
from bottomlock.io.lines import Lines, batches, fields_between, numbers, wholes
from bottomlock.io.rows import NAN, PLAIN, Options, make_table, raise_if_empty

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
_GOOD, _NUMBERS = _NEEDED[1 : 1 + _BEAMS], [n for n in _NEEDED[1 + _BEAMS :] if n != "velocityInstFlag"]


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
    at: dict[str, int] | None = None
    parts = []
    for lines in batches(data):
        if at is None and len(lines.start):
            header = lines.text[lines.start[0] : lines.end[0]]
            at, lines = _columns(header, place), lines.where(np.arange(len(lines.start)) > 0)  # noqa: PLW2901
            width = header.count(b",") + 1
        if at is not None:
            parts.append(_rows(lines, at, width, account))
    if at is None:
        at = _columns(b"", place)
    table = _table(parts, account, options)
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


@dataclass(frozen=True, eq=False)
class _Rows:
    """Lines of numbers, (n,) each, `flags` (n, 5) of the beams and the instrument, `values` (n, 13)."""

    position: Integers
    time_ns: list[int | None]
    arrival_ns: list[int | None]
    flags: Integers
    values: Floats


def _rows(lines: Lines, at: dict[str, int], width: int, account: Account) -> _Rows:
    """The lines of a batch."""
    raw, commas = lines.raw, lines.places(b",")
    fields, bounds = fields_between(commas, lines.start, lines.end, width)
    whole_line = lines.piece(lines.start, lines.end)
    fits = fields == width
    account.read += len(fits)
    account.skip_where("truncated", fields < width, lines.number, whole_line)
    account.skip_where("merged line", fields > width, lines.number, whole_line)
    good = lines.where(fits)
    begin, end = bounds[:, :-1] + 1, bounds[:, 1:]

    def texts(name: str) -> list[int | None]:
        return wholes(lines, begin[:, at[name]], end[:, at[name]])

    chosen = [at[name] for name in _NUMBERS]
    values, known = numbers(raw, begin[:, chosen], end[:, chosen])
    marked = [at[name] for name in (*_GOOD, "velocityInstFlag")]
    flags = raw.take(begin[:, marked], mode="clip").astype(np.int64) - ord("0")
    sound = (end[:, marked] - begin[:, marked] == 1) & (flags >= 0) & (flags <= 1)
    time_ns = texts("header.stamp")
    use = known.all(axis=1) & sound.all(axis=1) & np.array([t is not None for t in time_ns], dtype=bool)
    account.skip_where("a field that is no number", ~use, good.number, good.piece(good.start, good.end))
    # Two lines that lost an end and a beginning may look like one: there is no checksum, and a time is no range.
    far = use & (values[:, :_BEAMS] > _MOST_RANGE_M).any(axis=1)
    account.skip_where("range beyond 20 km", far, good.number, good.piece(good.start, good.end))
    use &= ~far
    arrival = texts("%time") if "%time" in at else [None] * len(use)
    index = np.flatnonzero(use).tolist()
    return _Rows(
        good.number[use], [time_ns[k] for k in index], [arrival[k] for k in index], flags[use], values[use]
    )


def _table(parts: list[_Rows], account: Account, options: Options) -> BeamTable:
    """The table, its signs turned to ours."""
    nothing = _Rows(np.zeros(0, dtype=np.int64), [], [], np.zeros((0, 5), dtype=np.int64), np.zeros((0, 13)))
    position, flags, values = (
        np.concatenate([getattr(part, name) for part in (nothing, *parts)])
        for name in ("position", "flags", "values")
    )
    ranges, velocity, instrument, altitude = values[:, :4], values[:, 4:8], values[:, 8:11], values[:, 11]
    return make_table(
        account,
        _BEAMS,
        position,
        [t for part in parts for t in part.time_ns],
        -velocity,
        flags[:, :_BEAMS] == 1,
        range_m=np.where(ranges > 0.0, ranges, NAN),
        instrument=instrument * np.array([1.0, -1.0, -1.0]),
        verdict=flags[:, _BEAMS],
        arrival_ns=[t for part in parts for t in part.arrival_ns],
        extra={"altitude_m": np.where(altitude > 0.0, altitude, NAN), "sound_speed_mps": values[:, 12]},
        negate=options.negate_beams,
    )
