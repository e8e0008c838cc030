"""Nortek Nucleus1000: bottom track (record id 0xB4) and water track (0xBE) of three beams.

One lost beam already leaves a partial velocity.

The status word holds validity flags of velocity, distance and figure of merit for each beam and each axis. Layout as in
the manufacturer's driver, which reads both records alike.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bottomlock.io.beam_table import Account, BeamTable, Integers, Recording, WaterTable
from bottomlock.io.binary_records import Found, fields_at
from bottomlock.io.decoder import binary
from bottomlock.io.nortek_dvl import UNSURE, layer_range_m, no_layer_note, vertical_note
from bottomlock.io.nortek_frames import BOTTOM_NUCLEUS, RECORDS, WATER_NUCLEUS, flags_of, frames, kinds
from bottomlock.io.rows import NAN, Options, make_table, make_water, raise_if_empty

_BEAMS = 3
_FAMILY = 0x20
_NUCLEUS_RECORDS = {0x82, 0x87, 0xAA, 0xB4, 0xBE, 0xD2, 0xDC}
DATA = np.dtype(
    [
        ("version", "u1"), ("offset", "u1"), ("flags", "u1"), ("reserved", "u1"), ("seconds", "<u4"), ("micros", "<u4"),
        ("status", "<u4"), ("serial", "<u4"), ("reserved_2", "<u4"), ("sound", "<f4"), ("temperature", "<f4"),
        ("pressure", "<f4"), ("velocity", "<f4", 3), ("distance", "<f4", 3), ("fom", "<f4", 3), ("delay", "<f4", 3),
        ("period", "<f4", 3), ("axes", "<f4", 3), ("axes_fom", "<f4", 3), ("rest", "<f4", 2),
    ]
)  # fmt: skip
"""Of a record's data, which bottom and water share."""


def _sniff(head: bytes) -> bool:
    return b"\xa5" in head and bool(kinds(head) & _NUCLEUS_RECORDS)


def _read(records: Found, place: str, options: Options) -> Recording:
    """The bottom-track records of a stream, and its water track.

    Raises:
        DataError: where there is none.
    """
    data, account, found = records.data, records.account, frames(records)
    is_bottom = (found.kind == BOTTOM_NUCLEUS) & (found.family == _FAMILY)
    pings = found.pings(is_bottom, account).of_layout(DATA, account)
    water = found.where((found.kind == WATER_NUCLEUS) & (found.family == _FAMILY))
    water = water.where(water.size >= DATA.itemsize)
    bottom, water_track = ((fields_at(data, one.start, DATA), one.position) for one in (pings, water))
    return replace(recording_of(bottom, water_track, account, place, options), format=FORMAT.name)


Records = tuple[NDArray[Any], Integers]
"""Fields, as `DATA`, and positions (n,)."""


def recording_of(
    bottom: Records, of_water: Records, account: Account, place: str, options: Options
) -> Recording:
    """What records of bottom and of water track hold; the format's name is left to the caller.

    Raises:
        DataError: where there is none.
    """
    posix = bool((bottom[0]["flags"] & 1).any())
    table, water = _table(*bottom, account, options), _water(*of_water, account, options)
    raise_if_empty(account, place, "bottom-track record of a Nucleus", water, options)
    return Recording(
        format="",
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
            *no_layer_note(water),
        ],
        water=water,
    )


def _table(fields: NDArray[Any], position: Integers, account: Account, options: Options) -> BeamTable:
    """The table of the records."""
    on_clock = fields["micros"] <= 999_999
    account.skip_where("clock out of range", ~on_clock, position)
    f = fields[on_clock]
    good = flags_of(f["status"], 15)
    known = good[:, 9:12].all(axis=1)
    return make_table(
        account,
        _BEAMS,
        position[on_clock],
        _time_ns(f),
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


def _water(fields: NDArray[Any], position: Integers, account: Account, options: Options) -> WaterTable | None:
    """The layer of the water of the records, as cell 1."""
    if not len(fields):
        return None
    on_clock = fields["micros"] <= 999_999
    f = fields[on_clock]
    good = flags_of(f["status"], 15)
    return make_water(
        account,
        position[on_clock],
        _time_ns(f),
        np.ones(len(f)),
        layer_range_m(np.where(good[:, 3:6], f["distance"], NAN)),
        f["velocity"],
        good[:, :3],
        sd=np.where(good[:, 6:9], f["fom"], NAN),
        negate=options.negate_beams,
    )


def _time_ns(fields: NDArray[Any]) -> Integers:
    """(n,) the clock."""
    return np.asarray((fields["seconds"].astype(np.int64) * 1_000_000 + fields["micros"]) * 1000)


FORMAT = binary(
    "nucleus",
    "Nortek Nucleus1000, binary",
    _sniff,
    RECORDS,
    _read,
    (BOTTOM_NUCLEUS, WATER_NUCLEUS),
    figures=True,
)
