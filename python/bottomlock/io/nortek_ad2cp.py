"""Nortek AD2CP files of current profilers (Signature): bottom track as data format 20 (record id 0x17).

Velocities are integers scaled by a power of ten that the record states; a ping without bottom has a figure of merit of
65535 and a negative distance, and its velocity is a filler.
"""

import numpy as np
from numpy.typing import NDArray

from bottomlock.errors import DataError
from bottomlock.io.beam_table import Account, BeamTable, Recording
from bottomlock.io.binary_records import fields_at
from bottomlock.io.framing import Stream, nortek
from bottomlock.io.nortek_dvl import UNSURE
from bottomlock.io.nortek_frames import BOTTOM_AD2CP, Frames, frames, kinds, struct_tm_ns
from bottomlock.io.rows import NAN, PLAIN, Options, make_table, raise_if_empty

NAME = "nortek-ad2cp"
STREAM = Stream(lambda _: nortek(), kind=BOTTOM_AD2CP)
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


def sniff(head: bytes) -> bool:
    """Whether the beginning of a file looks like this format: also one that begins with its text record."""
    return b"\xa5" in head and bool(kinds(head) & {BOTTOM_AD2CP, 0x15, 0x16, 0x18, 0xA0})


def read(data: bytes, place: str, options: Options = PLAIN) -> Recording:
    """The bottom-track records of a file.

    Raises:
        DataError: where there is none, or none in beam coordinates.
    """
    account = Account(unit="byte")
    found = frames(data, account)
    bottom = found.kind == BOTTOM_AD2CP
    found.where(~bottom).pass_by(account)
    pings = found.where(bottom)
    coordinates = _coordinates(data, pings)
    for kind, name in enumerate(_COORDINATES):
        if kind != _BEAM:
            account.skip_where(f"bottom track in {name} coordinates", coordinates == kind, pings.position)
    in_beams = coordinates == _BEAM
    table = _table(data, pings.where(in_beams), account, options)
    if not account.kept and not in_beams.all():
        raise DataError(
            f"{place}: {np.count_nonzero(~in_beams)} bottom-track records hold no beam velocities; set CY=BEAM for "
            "bottom track (SETBT) and record again"
        )
    raise_if_empty(account, place, "bottom-track record (DF20)")
    return Recording(
        format=NAME,
        table=table,
        account=account,
        frame="none",
        clock="the instrument's",
        time_of="record",
        quality="figure of merit as recorded",
        notes=["a beam counts as valid where it has a distance and a figure of merit", UNSURE],
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
