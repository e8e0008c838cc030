"""Nortek Nucleus1000: bottom track of three beams (record id 0xB4); one lost beam already leaves a partial velocity.

The status word holds validity flags of velocity, distance and figure of merit for each beam and each axis. Layout as in
the manufacturer's driver.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bottomlock.io.beam_table import Account, BeamTable, Integers, Recording
from bottomlock.io.binary_records import fields_at
from bottomlock.io.framing import Stream, nortek
from bottomlock.io.nortek_dvl import UNSURE, vertical_note
from bottomlock.io.nortek_frames import BOTTOM_NUCLEUS, frames, kinds
from bottomlock.io.rows import NAN, PLAIN, Options, make_table, raise_if_empty

NAME = "nucleus"
STREAM = Stream(lambda _: nortek(), kind=BOTTOM_NUCLEUS)
_BEAMS = 3
_FAMILY = 0x20
_NUCLEUS_RECORDS = {0x82, 0x87, 0xAA, 0xB4, 0xBE, 0xD2, 0xDC}
_DATA = np.dtype(
    [
        ("version", "u1"), ("offset", "u1"), ("flags", "u1"), ("reserved", "u1"), ("seconds", "<u4"), ("micros", "<u4"),
        ("status", "<u4"), ("serial", "<u4"), ("reserved_2", "<u4"), ("sound", "<f4"), ("temperature", "<f4"),
        ("pressure", "<f4"), ("velocity", "<f4", 3), ("distance", "<f4", 3), ("fom", "<f4", 3), ("delay", "<f4", 3),
        ("period", "<f4", 3), ("axes", "<f4", 3), ("axes_fom", "<f4", 3), ("rest", "<f4", 2),
    ]
)  # fmt: skip


def sniff(head: bytes) -> bool:
    """Whether the beginning of a file looks like this format."""
    return b"\xa5" in head and bool(kinds(head) & _NUCLEUS_RECORDS)


def read(data: bytes, place: str, options: Options = PLAIN) -> Recording:
    """The bottom-track records of a stream.

    Raises:
        DataError: where there is none.
    """
    account = Account(unit="byte")
    found = frames(data, account)
    bottom = (found.kind == BOTTOM_NUCLEUS) & (found.family == _FAMILY)
    found.where(~bottom).pass_by(account)
    pings = found.where(bottom)
    short = pings.size < _DATA.itemsize
    account.skip_where(
        "bottom track of another layout", short, pings.position, lambda k: f"{pings.size[k]} bytes"
    )
    pings = pings.where(~short)
    fields = fields_at(data, pings.start, _DATA)
    posix = bool((fields["flags"] & 1).any())
    table = _table(fields, pings.position, account, options)
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


def _table(fields: NDArray[Any], position: Integers, account: Account, options: Options) -> BeamTable:
    """The table of the records."""
    on_clock = fields["micros"] <= 999_999
    account.skip_where("clock out of range", ~on_clock, position)
    f = fields[on_clock]
    good = (f["status"][:, None] >> np.arange(15) & 1).astype(bool)
    known = good[:, 9:12].all(axis=1)
    return make_table(
        account,
        _BEAMS,
        position[on_clock],
        (f["seconds"].astype(np.int64) * 1_000_000 + f["micros"]) * 1000,
        f["velocity"],
        good[:, :3],
        range_m=np.where(good[:, 3:6], f["distance"], NAN),
        sd=np.where(good[:, 6:9], f["fom"], NAN),
        instrument=f["axes"],
        verdict=known,
        extra={
            "instrument_sd_mps": np.where(good[:, 12:15].all(axis=1), f["axes_fom"].max(axis=1), NAN),
            "sound_speed_mps": f["sound"],
            **{f"beam{k + 1}_delay_s": f["delay"][:, k] for k in range(_BEAMS)},
        },
        negate=options.negate_beams,
    )
