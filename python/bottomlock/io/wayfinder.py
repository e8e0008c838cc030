"""Teledyne Wayfinder: the data packets of its binary protocol, which its driver logs as they come.

A packet is AA 10 01, its length, a header of four bytes whose second one tells the kind, the content, and a 16-bit
sum of all bytes before. The content ends with such a sum of its own. Velocities are floats along the beams or along
axes, as the content says; one that is none is not a number.

Source: Teledyne Marine's Python driver (MIT), dvl/packets.py and dvl/system.py, `OutputData`.
"""

from dataclasses import replace

import numpy as np

from bottomlock.errors import DataError
from bottomlock.io.beam_table import Recording
from bottomlock.io.binary_records import Framing, calendar_ns, sum_fits, word_at
from bottomlock.io.decoder import Format, RecordDecoder, Row
from bottomlock.io.rows import NAN, UNSURE

_MARK = bytes([0xAA, 0x10, 0x01])
_HEAD, _APPLICATION, _DATA, _LONGEST = 5, 4, 5, 33_000
_LEAST = 87
"""Bytes of a content."""
_FRAMES = ("beam", "instrument", "ship", "earth")
_BEAMS = 4
_CENTURY = 2000
_CONTENT = np.dtype(
    {
        "names": ["size", "clock", "millis", "frame", "velocity", "range", "mean", "sound"],
        "formats": ["<u4", ("u1", 6), "<u2", "u1", ("<f4", 4), ("<f4", 4), "<f4", "<f4"],
        "offsets": [2, 12, 18, 20, 21, 37, 53, 57],
        "itemsize": _LEAST,
    }
)


def _size(data: bytes, at: int) -> int | None:
    """Of the packet at a mark, if a packet can have it."""
    if at + _HEAD > len(data):
        return None
    size = word_at(data, at + 3)
    return size if _HEAD + _APPLICATION + 2 < size <= _LONGEST else 0


_FRAMING = Framing(_MARK, "packet", _size, sum_fits)


class _Decoder(RecordDecoder):
    """A data packet a ping; `group` is its coordinates."""

    framing = _FRAMING

    @np.errstate(invalid="ignore")
    def record(self, position: int, data: bytes) -> None:
        """Takes a packet."""
        if data[_HEAD + 1] != _DATA:
            self.account.pass_by("packet without data", position)
            return
        content = data[_HEAD + _APPLICATION : -2]
        if len(content) < _LEAST or not sum_fits(content)(0, len(content)):
            self.account.skip("data of another layout", position, f"{len(content)} bytes")
            return
        f = np.frombuffer(content, _CONTENT, 1)[0]
        year, *rest = f["clock"].tolist()
        time_ns = calendar_ns([year + _CENTURY, *rest], int(f["millis"]) * 1_000_000)
        if time_ns is None:
            self.account.skip("clock out of range", position)
            return
        velocity, range_m = (f[name].astype(np.float64) for name in ("velocity", "range"))
        row = Row(
            position=position,
            time_ns=time_ns,
            velocity=velocity.tolist(),
            valid=np.isfinite(velocity).tolist(),
            range_m=np.where(range_m > 0.0, range_m, NAN).tolist(),
            extra={
                "altitude_m": float(f["mean"]) if f["mean"] > 0.0 else NAN,
                "sound_speed_mps": float(f["sound"]),
            },
            group=int(f["frame"]),
        )
        self.rows.append(row)

    def ready(self) -> list[Row]:
        """As `Decoder.ready`: of a stream those in beam coordinates."""
        return self._of(super().ready(), 0)

    def _of(self, rows: list[Row], use: int) -> list[Row]:
        """The rows in some coordinates; others are counted."""
        for row in rows:
            if row.group != use:
                why = f"other coordinates among {_FRAMES[use & 3]} coordinates"
                self.account.skip(why, row.position)
        return [row for row in rows if row.group == use]

    def recording(self) -> Recording:
        """The table, as `Decoder.recording`.

        Raises:
            DataError: also where none is in beam coordinates and the velocity alone is not asked for.
        """
        use, own = 0, self.options.instrument_only
        if self.rows and (own or all(row.group for row in self.rows)):
            use = self.rows[0].group
        if use and not own:
            raise DataError(
                f"{len(self.rows)} pings in {_FRAMES[use & 3]} coordinates hold no beam velocities",
                place=self.place,
                hint="set the coordinates to Beam and record again, or convert its own velocity with --instrument-only",
            )
        rows = self._of(self.rows, use)
        if use:
            rows = [row.of_axes(row.velocity[:3]) for row in rows]
        return replace(
            self.tables("data packet of a Wayfinder", 0 if use else _BEAMS, rows),
            frame=_FRAMES[use & 3] if use else "none",
            clock="the instrument's, as it was set",
            notes=[
                "time is that before the ping, to 10 ms",
                "no beam velocities: the table holds the instrument's velocity, in its own signs"
                if use
                else UNSURE,
            ],
            facts={"coordinates": _FRAMES[use & 3], "beam_angle_deg": 30},
        )


FORMAT = Format(
    "wayfinder",
    "Teledyne Wayfinder, binary",
    lambda head: _MARK in head and bool(_FRAMING.of(head)),
    _Decoder,
)
