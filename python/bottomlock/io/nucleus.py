"""Nortek Nucleus1000: bottom track (record id 0xB4) and water track (0xBE) of three beams.

One lost beam already leaves a partial velocity.

The status word holds validity flags of velocity, distance and figure of merit for each beam and each axis. Layout as in
the manufacturer's driver, which reads both records alike.
"""

from dataclasses import replace

import numpy as np

from bottomlock.io.beam_table import Recording
from bottomlock.io.decoder import Format
from bottomlock.io.nortek_dvl import Layout, RecordTracks, TrackDecoder
from bottomlock.io.nortek_frames import BOTTOM_NUCLEUS, WATER_NUCLEUS, kinds


def _clock(fields: np.void) -> int | None:
    """Time, ns; None where it is out of range."""
    micros = int(fields["micros"])
    return (int(fields["seconds"]) * 1_000_000 + micros) * 1000 if micros <= 999_999 else None


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


class NucleusDecoder(TrackDecoder):
    """Of a Nucleus, whatever holds its records."""

    layout = LAYOUT
    _posix = False

    def track(self, position: int, kind: int, fields: np.void) -> None:
        """Takes a record, whose flags say what its clock counts from."""
        self._posix |= bool(kind == BOTTOM_NUCLEUS and fields["flags"] & 1)
        super().track(position, kind, fields)

    def recording(self) -> Recording:
        """The tables, as `Decoder.recording`."""
        found = self.finished()
        return replace(
            found,
            clock="the instrument's, since 1970" if self._posix else "since the instrument's start",
            notes=[
                "time is that of the record; beam1_delay_s ... hold the offsets that it states",
                "distance is kept as recorded",
                *found.notes,
            ],
        )


class _Decoder(NucleusDecoder, RecordTracks):
    """Of binary records."""


FORMAT = Format(
    "nucleus",
    "Nortek Nucleus1000, binary",
    lambda head: b"\xa5" in head and bool(kinds(head) & {0x82, 0x87, 0xAA, 0xB4, 0xBE, 0xD2, 0xDC}),
    _Decoder,
    figures=True,
)
