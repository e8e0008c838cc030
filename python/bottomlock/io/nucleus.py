"""Nortek Nucleus1000: bottom track of three beams (record id 0xB4); one lost beam already leaves a partial velocity.

The status word holds validity flags of velocity, distance and figure of merit for each beam and each axis. Layout as in
the manufacturer's driver.
"""

import struct

from bottomlock.io.beam_table import Account, Recording
from bottomlock.io.nortek_dvl import UNSURE, vertical_note
from bottomlock.io.nortek_frames import BOTTOM_NUCLEUS, Frame, frames, kinds, name_of
from bottomlock.io.rows import NAN, PLAIN, Options, Rows, raise_if_empty

NAME = "nucleus"
_BEAMS = 3
_FAMILY = 0x20
_NUCLEUS_RECORDS = {0x82, 0x87, 0xAA, 0xB4, 0xBE, 0xD2, 0xDC}
# version, offset, flags, -, seconds, microseconds, status, serial, -, sound, temperature, pressure, then 23 numbers
_DATA = struct.Struct("<4B3I2I3f23f")


def sniff(head: bytes) -> bool:
    """Whether the beginning of a file looks like this format."""
    return b"\xa5" in head and bool(kinds(head) & _NUCLEUS_RECORDS)


def read(data: bytes, place: str, options: Options = PLAIN) -> Recording:
    """The bottom-track records of a stream.

    Raises:
        DataError: where there is none.
    """
    account = Account(unit="byte")
    rows = Rows(_BEAMS, account)
    posix = 0
    for frame in frames(data, account):
        if frame.kind != BOTTOM_NUCLEUS or frame.family != _FAMILY:
            account.pass_by(name_of(frame.kind), frame.position)
        elif len(frame.data) < _DATA.size:
            account.skip("bottom track of another layout", frame.position, f"{len(frame.data)} bytes")
        else:
            posix += frame.data[2] & 1
            _add(rows, frame)
    table = rows.finish(negate=options.negate_beams)
    raise_if_empty(account, place, "bottom-track record of a Nucleus")
    return Recording(
        format=NAME,
        table=table,
        account=account,
        frame="instrument",
        clock="the instrument's, since 1970" if posix else "since the instrument's start",
        time_of="record",
        notes=[
            "time is that of the record; beam1_delay_s ... hold the offsets that it states",
            "distance is kept as recorded",
            UNSURE,
            *vertical_note(table),
        ],
    )


def _add(rows: Rows, frame: Frame) -> None:
    """A record to the table."""
    fields = _DATA.unpack_from(frame.data)
    seconds, micros, status = fields[4:7]
    sound, numbers = fields[9], fields[12:]
    velocity, distance, fom, delay = (numbers[3 * k : 3 * k + 3] for k in range(4))
    good = [bool(status >> k & 1) for k in range(15)]
    known = all(good[9:12])
    if micros > 999_999:
        rows.account.skip("clock out of range", frame.position)
        return
    rows.add(
        frame.position,
        (seconds * 1_000_000 + micros) * 1000,
        velocity,
        good[:3],
        range_m=[d if ok else NAN for d, ok in zip(distance, good[3:6], strict=True)],
        sd=[f if ok else NAN for f, ok in zip(fom, good[6:9], strict=True)],
        instrument=numbers[15:18],
        verdict=int(known),
        extra={
            "instrument_sd_mps": max(numbers[18:21]) if all(good[12:15]) else NAN,
            "sound_speed_mps": sound,
            **{f"beam{k + 1}_delay_s": d for k, d in enumerate(delay)},
        },
    )
