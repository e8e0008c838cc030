"""Nortek AD2CP files of current profilers (Signature): bottom track as data format 20 (record id 0x17).

Velocities are integers scaled by a power of ten that the record states; a ping without bottom has a figure of merit of
65535 and a negative distance, and its velocity is a filler.
"""

import math
import struct

from bottomlock.errors import DataError
from bottomlock.io.beam_table import Account, Recording
from bottomlock.io.nortek_dvl import UNSURE
from bottomlock.io.nortek_frames import BOTTOM_AD2CP, Frame, frames, kinds, name_of, struct_tm_ns
from bottomlock.io.rows import NAN, PLAIN, Options, Rows, raise_if_empty

NAME = "nortek-ad2cp"
_BEAMS = 4
# version, offset, configuration, serial, clock, 100 us, sound, temperature, pressure, heading, pitch, roll, beams
_HEAD = struct.Struct("<BBHI6sHHhIHhhH")
_SCALE_AT, _LEAST = 60, 78
_VELOCITY, _DISTANCE, _FOM = 1 << 5, 1 << 8, 1 << 9
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
    rows = Rows(_BEAMS, account)
    other = 0
    for frame in frames(data, account):
        if frame.kind != BOTTOM_AD2CP:
            account.pass_by(name_of(frame.kind), frame.position)
        elif (kind := _coordinates(frame)) != _BEAM:
            other += 1
            account.skip(f"bottom track in {_COORDINATES[kind]} coordinates", frame.position)
        else:
            _add(rows, frame)
    if other and not rows.time_ns:
        raise DataError(
            f"{place}: {other} bottom-track records hold no beam velocities; set CY=BEAM for bottom track (SETBT) "
            "and record again"
        )
    table = rows.finish(negate=options.negate_beams)
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


def _coordinates(frame: Frame) -> int:
    """Coordinate code of a bottom-track record; 3 where it is too short to say."""
    return _HEAD.unpack_from(frame.data)[-1] >> 10 & 3 if len(frame.data) >= _LEAST else 3


def _add(rows: Rows, frame: Frame) -> None:
    """A record to the table."""
    data = frame.data
    _, offset, config, _, clock, hundred_us, sound, _, _, heading, pitch, roll, beams = _HEAD.unpack_from(
        data
    )
    scale = struct.unpack_from("<b", data, _SCALE_AT)[0]
    count = beams >> 12
    parts = [bool(config & bit) for bit in (_VELOCITY, _DISTANCE, _FOM)]
    size = count * (4 * parts[0] + 4 * parts[1] + 2 * parts[2])
    if (
        count != _BEAMS
        or not all(parts)
        or offset < _LEAST
        or offset + size > len(data)
        or not -9 <= scale <= 0
    ):
        rows.account.skip("bottom track of another layout", frame.position, f"{count} beams, offset {offset}")
        return
    time_ns = struct_tm_ns(clock, hundred_us)
    if time_ns is None:
        rows.account.skip("clock out of range", frame.position)
        return
    numbers = struct.unpack_from("<4i4i4H", data, offset)
    velocity, distance, fom = numbers[:4], numbers[4:8], numbers[8:]
    good = [d > 0 and f != _NO_FOM for d, f in zip(distance, fom, strict=True)]
    rows.add(
        frame.position,
        time_ns,
        [v * 10.0**scale if ok else NAN for v, ok in zip(velocity, good, strict=True)],
        good,
        range_m=[d * 1e-3 if d > 0 else NAN for d in distance],
        quality=[float(f) if f != _NO_FOM else NAN for f in fom],
        extra={
            "heading_rad": math.radians(heading * 0.01),
            "pitch_rad": math.radians(pitch * 0.01),
            "roll_rad": math.radians(roll * 0.01),
            "sound_speed_mps": sound * 0.1,
        },
    )
