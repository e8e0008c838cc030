"""Nortek AD2CP files of current profilers (Signature): bottom track (DF20, id 0x17) and profiles (DF3, 0x15 and 0x16).

Velocities are integers scaled by a power of ten that the record states; a ping without bottom has a figure of merit of
65535 and a negative distance, and its velocity is a filler. A profile holds velocity and correlation by beam and cell;
its cells are vertical, the middle of the first one cell beyond the blanking distance.
"""

import math

import numpy as np
from numpy.typing import NDArray

from bottomlock.errors import DataError
from bottomlock.io.beam_table import Account, BeamTable, Recording, WaterTable
from bottomlock.io.binary_records import Found, bytes_of, fields_at, numbered
from bottomlock.io.decoder import binary
from bottomlock.io.nortek_frames import (
    AVERAGE_AD2CP,
    BOTTOM_AD2CP,
    BURST_AD2CP,
    RECORDS,
    Frames,
    frames,
    kinds,
    struct_tm_ns,
)
from bottomlock.io.rows import NAN, UNSURE, Options, make_table, make_water, raise_if_empty

_BEAMS = 4
_HEAD = np.dtype(
    [
        ("version", "u1"), ("offset", "u1"), ("configuration", "<u2"), ("serial", "<u4"), ("clock", "u1", 6),
        ("hundred_us", "<u2"), ("sound", "<u2"), ("temperature", "<i2"), ("pressure", "<u4"), ("heading", "<u2"),
        ("pitch", "<i2"), ("roll", "<i2"), ("beams", "<u2"), ("middle", "V28"), ("scale", "i1"), ("end", "V17"),
    ]
)  # fmt: skip
_NUMBERS = np.dtype([("velocity", "<i4", 4), ("distance", "<i4", 4), ("fom", "<u2", 4)])
_LEAST = _HEAD.itemsize
# Flags of the configuration: velocity, distance and figure of merit are there.
_PARTS = 1 << 5 | 1 << 8 | 1 << 9
# Powers of ten by the negated exponent that a record states.
_SCALES = np.array([10.0**-k for k in range(10)])
_NO_FOM = 0xFFFF
_COORDINATES = ("ENU", "XYZ", "BEAM", "unknown")
_BEAM = 2
_TILT_RAD = math.radians(25.0)
"""Of the slanted beams of a Signature."""
_PROFILE = np.dtype(
    {
        "names": ["setup", "cell_mm", "blanking", "scale", "status"],
        "formats": ["<u2", "<u2", "<u2", "i1", "<u4"],
        "offsets": [30, 32, 34, 58, 68],
    }
)
# Flags of a profile's configuration: velocity, amplitude and correlation are there, in this order.
_VELOCITY, _AMPLITUDE, _CORRELATION = 1 << 5, 1 << 6, 1 << 7
_BLANKING_IN_CM = 1 << 1
_NO_VELOCITY = -32768


def _sniff(head: bytes) -> bool:
    """Whether the beginning of a file looks like it: also one that begins with its text record."""
    return b"\xa5" in head and bool(kinds(head) & {BOTTOM_AD2CP, BURST_AD2CP, AVERAGE_AD2CP, 0x18, 0xA0})


def _read(records: Found, place: str, options: Options) -> Recording:
    """The bottom-track records of a file, and its profiles.

    Raises:
        DataError: where there is none, or none in beam coordinates.
    """
    data, account, found = records.data, records.account, frames(records)
    pings = found.pings(found.kind == BOTTOM_AD2CP, account)
    coordinates = _coordinates(data, pings)
    for kind, name in enumerate(_COORDINATES):
        if kind != _BEAM:
            account.skip_where(f"bottom track in {name} coordinates", coordinates == kind, pings.position)
    in_beams = coordinates == _BEAM
    table = _table(data, pings.where(in_beams), account, options)
    if not account.kept and not in_beams.all() and not options.water_alone:
        raise DataError(
            f"{np.count_nonzero(~in_beams)} bottom-track records hold no beam velocities",
            place=place,
            hint="set CY=BEAM for bottom track (SETBT) and record again",
        )
    water = _water(data, found, account, options)
    raise_if_empty(account, place, "bottom-track record (DF20)", water, options)
    return Recording(
        table=table,
        account=account,
        frame="none",
        clock="the instrument's",
        time_of="record",
        quality="figure of merit as recorded",
        notes=["a beam counts as valid where it has a distance and a figure of merit", UNSURE],
        water=water,
    )


def _coordinates(data: bytes, pings: Frames) -> NDArray[np.uint16]:
    """(n,) coordinate codes of bottom-track records; 3 where one is too short to say."""
    long = pings.size >= _LEAST
    codes = np.full(len(long), 3, dtype=np.uint16)
    codes[long] = fields_at(data, pings.start[long], _HEAD)["beams"] >> 10 & 3
    return codes


def _table(data: bytes, pings: Frames, account: Account, options: Options) -> BeamTable:
    """The table of the records in beam coordinates."""
    head = fields_at(data, pings.start, _HEAD)
    beams, offset, scale = head["beams"] >> 12, head["offset"], head["scale"]
    whole = (beams == _BEAMS) & (head["configuration"] & _PARTS == _PARTS)
    whole &= (offset >= _LEAST) & (offset + _NUMBERS.itemsize <= pings.size) & (scale >= -9) & (scale <= 0)
    account.skip_where(
        "bottom track of another layout",
        ~whole,
        pings.position,
        lambda k: f"{beams[k]} beams, offset {offset[k]}",
    )
    time_ns, on_clock = struct_tm_ns(head["clock"], head["hundred_us"])
    account.skip_where("clock out of range", whole & ~on_clock, pings.position)
    use = whole & on_clock
    head, pings, time_ns = head[use], pings.where(use), time_ns[use]
    numbers = fields_at(data, pings.start + head["offset"], _NUMBERS)
    distance, fom = numbers["distance"], numbers["fom"]
    good = (distance > 0) & (fom != _NO_FOM)
    return make_table(
        account,
        _BEAMS,
        pings.position,
        time_ns,
        np.where(good, numbers["velocity"] * _SCALES[-head["scale"].astype(np.int64)][:, None], NAN),
        good,
        range_m=np.where(distance > 0, distance * 1e-3, NAN),
        quality=np.where(fom != _NO_FOM, fom, NAN),
        extra={
            "heading_rad": np.radians(head["heading"] * 0.01),
            "pitch_rad": np.radians(head["pitch"] * 0.01),
            "roll_rad": np.radians(head["roll"] * 0.01),
            "sound_speed_mps": head["sound"] * 0.1,
        },
        negate=options.negate_beams,
    )


def _water(data: bytes, found: Frames, account: Account, options: Options) -> WaterTable | None:
    """The cells of the profiles of four beams in beam coordinates: of bursts or, where there are none, of averages."""
    for kind in (BURST_AD2CP, AVERAGE_AD2CP):
        profiles = found.where((found.kind == kind) & (found.size >= _PROFILE_LEAST))
        setup = fields_at(data, profiles.start, _PROFILE)["setup"]
        profiles = profiles.where((setup >> 10 & 3 == _BEAM) & (setup >> 12 == _BEAMS))
        if len(profiles.start):
            return _cells(data, profiles, account, options)
    return None


_PROFILE_LEAST = 76
"""Bytes before the velocities."""


def _cells(data: bytes, profiles: Frames, account: Account, options: Options) -> WaterTable | None:
    """The cells of profiles; those of another layout than the documented one have none."""
    head, setup = (fields_at(data, profiles.start, layout) for layout in (_HEAD, _PROFILE))
    time_ns, on_clock = struct_tm_ns(head["clock"], head["hundred_us"])
    cells, offset = setup["setup"].astype(np.int64) & 0x3FF, head["offset"].astype(np.int64)
    parts = head["configuration"]
    # Velocities of two bytes, then amplitudes and correlations of one, each by beam and, within it, by cell.
    correlation_at = offset + _BEAMS * cells * np.where(parts & _AMPLITUDE, 3, 2)
    end = correlation_at + _BEAMS * cells
    whole = on_clock & (parts & _VELOCITY > 0) & (parts & _CORRELATION > 0) & (offset >= _PROFILE_LEAST)
    whole &= (end <= profiles.size) & (setup["scale"] >= -9) & (setup["scale"] <= 0)
    use = np.flatnonzero(whole)
    mine, number = numbered(cells[use])
    owner = use[mine]
    of_beam = np.arange(_BEAMS) * cells[owner][:, None] + number[:, None]
    start = profiles.start[owner][:, None]
    raw = fields_at(data, (start + offset[owner][:, None] + 2 * of_beam).ravel(), np.dtype([("v", "<i2")]))
    percent = bytes_of(data)[start + correlation_at[owner][:, None] + of_beam]
    velocity = raw["v"].reshape(-1, _BEAMS)
    known = velocity != _NO_VELOCITY
    blanking_m = setup["blanking"] * np.where(setup["status"] & _BLANKING_IN_CM, 1e-2, 1e-3)
    vertical_m = blanking_m[owner] + setup["cell_mm"][owner] * 1e-3 * (number + 1)
    scale = _SCALES[-setup["scale"].astype(np.int64)[owner]][:, None]
    return make_water(
        account,
        profiles.position[owner],
        time_ns[owner],
        number + 1,
        vertical_m / math.cos(_TILT_RAD),
        np.where(known, velocity * scale, NAN),
        known,
        quality=percent * 2.55,
        negate=options.negate_beams,
    )


FORMAT = binary(
    "nortek-ad2cp",
    "Nortek AD2CP bottom track, DF20",
    _sniff,
    RECORDS,
    _read,
    (BOTTOM_AD2CP, BURST_AD2CP, AVERAGE_AD2CP),
)
