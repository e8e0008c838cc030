"""Nortek AD2CP files of current profilers (Signature): bottom track (DF20, id 0x17) and profiles (DF3, 0x15 and 0x16).

Velocities are integers scaled by a power of ten that the record states; a ping without bottom has a figure of merit of
65535 and a negative distance, and its velocity is a filler. A profile holds velocity and correlation by beam and cell;
its cells are vertical, the middle of the first one cell beyond the blanking distance.
"""

import math
from dataclasses import replace

import numpy as np

from bottomlock.errors import DataError
from bottomlock.io.beam_table import Recording
from bottomlock.io.decoder import Cells, Format, RecordDecoder, Row
from bottomlock.io.nortek_frames import (
    AVERAGE_AD2CP,
    BOTTOM_AD2CP,
    BURST_AD2CP,
    FRAMING,
    body,
    kinds,
    name_of,
    struct_tm_ns,
)
from bottomlock.io.rows import NAN, UNSURE

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
_PROFILE_LEAST = 76
"""Bytes before the velocities."""


def _sniff(head: bytes) -> bool:
    """Whether the beginning of a file looks like it: also one that begins with its text record."""
    return b"\xa5" in head and bool(kinds(head) & {BOTTOM_AD2CP, BURST_AD2CP, AVERAGE_AD2CP, 0x18, 0xA0})


class _Decoder(RecordDecoder):
    """Bottom track and profiles of four beams in beam coordinates; `group` of a profile is its id."""

    framing = FRAMING

    def record(self, position: int, data: bytes) -> None:
        """Takes a record."""
        kind, content = data[2], body(data)
        if kind == BOTTOM_AD2CP:
            self._bottom(position, content)
            return
        self.account.pass_by(name_of(kind), position)
        if kind in {BURST_AD2CP, AVERAGE_AD2CP} and len(content) >= _PROFILE_LEAST:
            self._profile(position, kind, content)

    def _bottom(self, position: int, data: bytes) -> None:
        account = self.account
        whole = np.frombuffer(data, _HEAD, 1)[0] if len(data) >= _LEAST else None
        coordinates = 3 if whole is None else int(whole["beams"]) >> 10 & 3
        if whole is None or coordinates != _BEAM:
            account.skip(f"bottom track in {_COORDINATES[coordinates]} coordinates", position)
            return
        beams, offset, scale = int(whole["beams"]) >> 12, int(whole["offset"]), int(whole["scale"])
        if (
            beams != _BEAMS
            or whole["configuration"] & _PARTS != _PARTS
            or not _LEAST <= offset <= len(data) - _NUMBERS.itemsize
            or not -9 <= scale <= 0
        ):
            account.skip("bottom track of another layout", position, f"{beams} beams, offset {offset}")
            return
        time_ns = _time_ns(whole)
        if time_ns is None:
            account.skip("clock out of range", position)
            return
        numbers = np.frombuffer(data, _NUMBERS, 1, offset)[0]
        distance, fom = numbers["distance"], numbers["fom"]
        good = (distance > 0) & (fom != _NO_FOM)
        row = Row(
            position=position,
            time_ns=time_ns,
            velocity=np.where(good, numbers["velocity"] * 10.0**scale, NAN).tolist(),
            valid=good.tolist(),
            range_m=np.where(distance > 0, distance * 1e-3, NAN).tolist(),
            quality=np.where(fom != _NO_FOM, fom, NAN).tolist(),
            extra={
                "heading_rad": math.radians(whole["heading"] * 0.01),
                "pitch_rad": math.radians(whole["pitch"] * 0.01),
                "roll_rad": math.radians(whole["roll"] * 0.01),
                "sound_speed_mps": float(whole["sound"] * 0.1),
            },
        )
        self.rows.append(row)

    def _profile(self, position: int, kind: int, data: bytes) -> None:
        """Takes the cells of a profile; one of another layout than the documented one has none."""
        head, setup = (np.frombuffer(data, layout, 1)[0] for layout in (_HEAD, _PROFILE))
        cells, coordinates, beams = (int(setup["setup"]) >> k for k in (0, 10, 12))
        if coordinates & 3 != _BEAM or beams != _BEAMS:
            return
        cells, offset, parts = cells & 0x3FF, int(head["offset"]), int(head["configuration"])
        # Velocities of two bytes, then amplitudes and correlations of one, each by beam and, within it, by cell.
        correlation_at = offset + _BEAMS * cells * (3 if parts & _AMPLITUDE else 2)
        scale, time_ns = int(setup["scale"]), _time_ns(head)
        if (
            time_ns is None
            or not parts & _VELOCITY
            or not parts & _CORRELATION
            or offset < _PROFILE_LEAST
            or correlation_at + _BEAMS * cells > len(data)
            or not -9 <= scale <= 0
        ):
            return
        raw = np.frombuffer(data, "<i2", _BEAMS * cells, offset).reshape(_BEAMS, cells).T
        percent = np.frombuffer(data, "u1", _BEAMS * cells, correlation_at).reshape(_BEAMS, cells).T
        known, number = raw != _NO_VELOCITY, np.arange(1, cells + 1)
        blanking_m = setup["blanking"] * (1e-2 if setup["status"] & _BLANKING_IN_CM else 1e-3)
        vertical_m = blanking_m + setup["cell_mm"] * 1e-3 * number
        found = Cells(
            number=number,
            range_m=vertical_m / math.cos(_TILT_RAD),
            velocity=np.where(known, raw * 10.0**scale, NAN),
            valid=known,
            quality=percent * 2.55,
        )
        row = Row(
            position=position, time_ns=time_ns, velocity=[], valid=[], cells=found, alone=True, group=kind
        )
        self.rows.append(row)

    def recording(self) -> Recording:
        """The tables, as `Decoder.recording`; of bursts and averages the bursts, where there are any."""
        bursts = any(row.group == BURST_AD2CP for row in self.rows)
        rows = [row for row in self.rows if not bursts or row.group != AVERAGE_AD2CP]
        others = sum(
            reason.count for why, reason in self.account.skipped.items() if why.endswith(" coordinates")
        )
        if others and all(row.alone for row in rows):
            raise DataError(
                f"{others} bottom-track records hold no beam velocities",
                place=self.place,
                hint="set CY=BEAM for bottom track (SETBT) and record again",
            )
        return replace(
            self.tables("bottom-track record (DF20)", _BEAMS, rows),
            quality="figure of merit as recorded",
            clock="the instrument's",
            notes=["a beam counts as valid where it has a distance and a figure of merit", UNSURE],
        )


def _time_ns(head: np.void) -> int | None:
    """Time of a record; None where its clock is out of range."""
    return struct_tm_ns(head["clock"].tobytes(), int(head["hundred_us"]))


FORMAT = Format("nortek-ad2cp", "Nortek AD2CP bottom track, DF20", _sniff, _Decoder)
