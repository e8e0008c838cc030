"""Teledyne Wayfinder: the data packets of its binary protocol, which its driver logs as they come.

A packet is AA 10 01, its length, a header of four bytes whose second one tells the kind, the content, and a 16-bit
sum of all bytes before. The content ends with such a sum of its own. Velocities are floats along the beams or along
axes, as the content says; one that is none is not a number.

Source: Teledyne Marine's Python driver (MIT), dvl/packets.py and dvl/system.py, `OutputData`.
"""

import numpy as np

from bottomlock.errors import DataError
from bottomlock.io.beam_table import Flags, Recording
from bottomlock.io.binary_records import (
    Found,
    Headers,
    Places,
    Records,
    bytes_of,
    calendar_ns,
    fields_at,
    search,
    sums_fit,
    words_at,
)  # fmt: skip
from bottomlock.io.decoder import binary
from bottomlock.io.rows import NAN, UNSURE, Options, make_table, raise_if_empty

_MARK = bytes([0xAA, 0x10, 0x01])
_HEAD, _APPLICATION, _DATA, _LONGEST = 5, 4, 5, 33_000
_LEAST = 87
"""Bytes of a content."""
_FRAMES = ("beam", "instrument", "ship", "earth")
_BEAMS = 4
_CENTURY = np.array([2000, 0, 0, 0, 0, 0])
_CONTENT = np.dtype(
    {
        "names": ["size", "clock", "millis", "frame", "velocity", "range", "mean", "sound"],
        "formats": ["<u4", ("u1", 6), "<u2", "u1", ("<f4", 4), ("<f4", 4), "<f4", "<f4"],
        "offsets": [2, 12, 18, 20, 21, 37, 53, 57],
        "itemsize": _LEAST,
    }
)


def _headers(data: bytes) -> Headers:
    """Every mark with a length that a packet can have, and its sum tested."""

    def sound(at: Places) -> Flags:
        size = words_at(data, at + 3)
        return (size > _HEAD + _APPLICATION + 2) & (size <= _LONGEST)

    start = search(data, _MARK, _HEAD, {}, sound)
    end = start + words_at(data, start + 3)
    return Headers(start, end, sums_fit(data, start, end - 2), np.zeros(len(start), dtype=bool))


def _sniff(head: bytes) -> bool:
    return _MARK in head and bool(_headers(head).fits.any())


def _read(found: Found, place: str, options: Options) -> Recording:
    """The data packets of a stream.

    Raises:
        DataError: where there is none, or none in beam coordinates and the velocity alone is not asked for.
    """
    data, start, end, account = found
    is_data = bytes_of(data)[start + _HEAD + 1] == _DATA
    account.pass_by_where("packet without data", ~is_data, start)
    start, end = start[is_data], end[is_data]
    content, size = start + _HEAD + _APPLICATION, end - start - _HEAD - _APPLICATION - 2
    long = (size >= _LEAST) & sums_fit(data, content, content + size - 2)
    account.skip_where("data of another layout", ~long, start, lambda k: f"{size[k]} bytes")
    position, f = start[long], fields_at(data, content[long], _CONTENT)
    time_ns, on_clock = calendar_ns(f["clock"] + _CENTURY, f["millis"].astype(np.int64) * 1_000_000)
    account.skip_where("clock out of range", ~on_clock, position)
    use = 0
    if on_clock.any() and (options.instrument_only or f["frame"].all()):
        use = int(f["frame"][on_clock][0])
    if use and not options.instrument_only:
        raise DataError(
            f"{len(f)} pings in {_FRAMES[use & 3]} coordinates hold no beam velocities",
            place=place,
            hint="set the coordinates to Beam and record again, or convert its own velocity with --instrument-only",
        )
    others = on_clock & (f["frame"] != use)
    account.skip_where(f"other coordinates among {_FRAMES[use & 3]} coordinates", others, position)
    kept = on_clock & (f["frame"] == use)
    f, position, time_ns = f[kept], position[kept], time_ns[kept]
    velocity, range_m = f["velocity"].astype(np.float64), f["range"].astype(np.float64)
    beams = 0 if use else _BEAMS
    with np.errstate(invalid="ignore"):
        table = make_table(
            account,
            beams,
            position,
            time_ns,
            velocity[:, :beams],
            np.isfinite(velocity[:, :beams]),
            range_m=None if use else np.where(range_m > 0.0, range_m, NAN),
            instrument=velocity[:, :3] if use else None,
            verdict=np.isfinite(velocity[:, :3]).all(axis=1) if use else -1,
            extra={"altitude_m": np.where(f["mean"] > 0.0, f["mean"], NAN), "sound_speed_mps": f["sound"]},
            negate=options.negate_beams,
        )
    raise_if_empty(account, place, "data packet of a Wayfinder")
    return Recording(
        table=table,
        account=account,
        frame=_FRAMES[use & 3] if use else "none",
        clock="the instrument's, as it was set",
        time_of="record",
        notes=[
            "time is that before the ping, to 10 ms",
            "no beam velocities: the table holds the instrument's velocity, in its own signs"
            if use
            else UNSURE,
        ],
        facts={"coordinates": _FRAMES[use & 3], "beam_angle_deg": 30},
    )


FORMAT = binary(
    "wayfinder", "Teledyne Wayfinder, binary", _sniff, Records(_MARK, _headers, _HEAD, "packet"), _read
)
