"""Nortek Nucleus1000: bottom track (record id 0xB4) and water track (0xBE) of three beams.

One lost beam already leaves a partial velocity.

The status word holds validity flags of velocity, distance and figure of merit for each beam and each axis. Layout as in
the manufacturer's driver, which reads both records alike.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bottomlock.io.beam_table import Account, Flags, Integers, Recording
from bottomlock.io.binary_records import Found
from bottomlock.io.decoder import binary
from bottomlock.io.nortek_dvl import Layout, Records
from bottomlock.io.nortek_frames import BOTTOM_NUCLEUS, RECORDS, WATER_NUCLEUS, kinds
from bottomlock.io.rows import Options


def _clock(fields: NDArray[Any]) -> tuple[Integers, Flags]:
    """Times, and which are in range."""
    time_us = fields["seconds"].astype(np.int64) * 1_000_000 + fields["micros"]
    return time_us * 1000, np.asarray(fields["micros"] <= 999_999)


LAYOUT = Layout(
    np.dtype(
        [
            ("version", "u1"), ("offset", "u1"), ("flags", "u1"), ("reserved", "u1"), ("seconds", "<u4"),
            ("micros", "<u4"), ("status", "<u4"), ("serial", "<u4"), ("reserved_2", "<u4"), ("sound", "<f4"),
            ("temperature", "<f4"), ("pressure", "<f4"), ("velocity", "<f4", 3), ("distance", "<f4", 3),
            ("fom", "<f4", 3), ("delay", "<f4", 3), ("period", "<f4", 3), ("axes", "<f4", 3), ("axes_fom", "<f4", 3),
            ("rest", "<f4", 2),
        ]
    ),
    BOTTOM_NUCLEUS,
    WATER_NUCLEUS,
    _clock,
    family=0x20,
    tilt_rad=None,
    what="bottom-track record of a Nucleus",
)  # fmt: skip


def _read(records: Found, place: str, options: Options) -> Recording:
    """The bottom-track records of a stream, and its water track; DataError where there is none."""
    return recording_of(*LAYOUT.of(records), records.account, place, options)


def recording_of(
    bottom: Records, of_water: Records, account: Account, place: str, options: Options
) -> Recording:
    """What records of bottom and of water track hold.

    Raises:
        DataError: where there is none.
    """
    posix = bool((bottom[0]["flags"] & 1).any())
    table, water, notes = LAYOUT.tables(bottom, of_water, account, place, options)
    return Recording(
        table=table,
        account=account,
        frame="instrument",
        clock="the instrument's, since 1970" if posix else "since the instrument's start",
        time_of="record",
        notes=[
            "time is that of the record; beam1_delay_s ... hold the offsets that it states",
            "distance is kept as recorded",
            *notes,
        ],
        water=water,
    )


FORMAT = binary(
    "nucleus",
    "Nortek Nucleus1000, binary",
    lambda head: b"\xa5" in head and bool(kinds(head) & {0x82, 0x87, 0xAA, 0xB4, 0xBE, 0xD2, 0xDC}),
    RECORDS,
    _read,
    (BOTTOM_NUCLEUS, WATER_NUCLEUS),
    figures=True,
)
