"""Teledyne PD0: ensembles with bottom track (0x0600), its high-resolution velocity (0x5803), and the water.

An ensemble is 7F 7F, its length, a table of offsets to data types, and a 16-bit sum of all its bytes. The fixed leader
(command EX) gives the coordinates of the four bottom-track velocities: beams, or the instrument's, the ship's or the
earth's axes and an error velocity. Recorded velocities are those of the bottom relative to the instrument: a beam is
positive when the bottom comes nearer, which is our b . v; velocities in axes are negated to those of the vehicle. The
same holds of the water: of its profile (0x0100, correlation 0x0200, cells by the fixed leader) or, where an ensemble
has none, of the water-mass layer that its bottom track holds.

Source: Teledyne RD Instruments, Workhorse and Pathfinder guides, "PD0 output data format"; signs from recordings with
GPS (docs/formats.md).
"""

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bottomlock.errors import DataError
from bottomlock.io.beam_table import Floats, Recording
from bottomlock.io.binary_records import Framing, calendar_ns, sum_fits, word_at
from bottomlock.io.decoder import Cells, Format, RecordDecoder, Row
from bottomlock.io.pd0_axes import beams_of_axes
from bottomlock.io.rows import NAN, lost

_MARK, _BEAMS = b"\x7f\x7f", 4
FRAMES = ("beam", "instrument", "ship", "earth")
EMPTY = "without fixed or variable leader"
"""Reason for a whole ensemble without what a ping needs."""
_BAD = -32768
# Bad in 0.01 mm/s: the coarse mark scaled, or the type's own least value.
_BAD_FINE = (-(2**31), _BAD * 100)
_USES_TILTS = 1 << 2
# Bits of the configuration.
_CONVEX, _LOOKS_UP = 1 << 3, 1 << 7
_BOTTOM, _FINE, _PROFILE, _CORRELATION = 0x0600, 0x5803, 0x0100, 0x0200
_COARSE, _STATE = struct.Struct("<4H4h4B"), struct.Struct("<HHHhh")
ADVICE = {
    "instrument": "instrument coordinates (EX01xxx)",
    "ship": "ship coordinates (EX10xxx)",
    "earth": "earth coordinates (EX11xxx)",
}


def _size(data: bytes, at: int) -> int | None:
    """Of the ensemble that seems to begin at a place: two sync bytes, a table of offsets, and a leader behind it."""
    if at + 8 > len(data):
        return None
    first = 6 + 2 * data[at + 5]
    if first == 6 or word_at(data, at + 6) != first:
        return 0
    size = word_at(data, at + 2)
    if first + 2 > size:
        return 0
    leader = data[at + first : at + first + 2]
    if len(leader) < 2:
        return None
    return size + 2 if leader in {b"\x00\x00", b"\x01\x00"} else 0


_FRAMING = Framing(_MARK, "ensemble", _size, sum_fits)


def _sniff(head: bytes) -> bool:
    """Whether the beginning of a file looks like it: a header, perhaps after some text."""
    at = head.find(_MARK)
    while at >= 0:
        size = _size(head, at)
        if size and _types(head[at : at + size], size - 2) is not None:
            return True
        at = head.find(_MARK, at + 1)
    return False


def _types(data: bytes, size: int) -> dict[int, bytes] | None:
    """The data types of an ensemble of so many bytes by their ids; None where its table leads beyond it."""
    offsets = struct.unpack_from(f"<{data[5]}H", data, 6)
    if any(offset + 2 > size for offset in offsets):
        return None
    spans = zip(offsets, (*offsets[1:], size), strict=True)
    return {word_at(data, begin): data[begin:end] for begin, end in spans if end - begin >= 2}


@dataclass(frozen=True)
class _Instrument:
    """Configuration word and stated angle of the beams, deg, 0 for none, of an ensemble."""

    config: int
    own_deg: int

    @property
    def angle_deg(self) -> int | None:
        """Of the beams to the instrument's axis; None where it is not stated."""
        own = self.own_deg if 0 < self.own_deg < 60 else None
        return {0: 15, 1: 20, 2: 30}.get(self.config >> 8 & 3, own)

    @property
    def looks_up(self) -> bool:
        """Whether the transducer is that of an instrument on the bottom."""
        return bool(self.config & _LOOKS_UP)


class _Decoder(RecordDecoder):
    """The ensembles with both leaders; `group` is the index of their coordinates in `FRAMES`.

    The first of them says what the instrument is.
    """

    framing = _FRAMING
    _first: _Instrument | None = None
    _of_pings: tuple[_Instrument, int, float] | None = None
    """Of the first ensemble with bottom track: the instrument, recorded coordinates, step of the velocities, m/s."""
    _recovered = False

    def record(self, position: int, data: bytes) -> None:
        """Takes an ensemble."""
        types = _types(data, len(data) - 2) or {}
        fixed, leader = types.get(0x0000, types.get(0x0001, b"")), types.get(0x0080, types.get(0x0081, b""))
        if len(fixed) < 26 or len(leader) < 24:
            self.account.skip(EMPTY, position)
            return
        instrument = _Instrument(word_at(fixed, 4), fixed[58] if len(fixed) > 58 else 0)
        self._first = self._first or instrument
        sound, _, *angles = _STATE.unpack_from(leader, 14)
        heading, pitch, roll = (float(np.radians(angle * 0.01)) for angle in angles)
        frame = fixed[25] >> 3 & 3
        velocity, range_m, correlation = _bottom(types.get(_BOTTOM, b""), types.get(_FINE, b""))
        cells = _cells(types, fixed, self._first.angle_deg)
        if self.options.beams_from_axes and frame:
            tilt = self._tilt_rad(self._first)
            turned = fixed, tilt, [heading, pitch, roll]
            velocity = _beams([velocity], *turned)[0].tolist() if velocity else []
            if cells is not None:
                cells.velocity = _beams(cells.velocity, *turned)
                cells.valid = np.isfinite(cells.velocity)
            self._recovered |= bool(velocity)
        if velocity and self._of_pings is None:
            self._of_pings = instrument, frame, 1e-5 if len(types.get(_FINE, b"")) >= 18 else 1e-3
        row = Row(
            position=position,
            time_ns=_time_ns(leader),
            velocity=velocity,
            valid=[bool(np.isfinite(one)) for one in velocity],
            range_m=range_m,
            quality=correlation,
            extra={
                "heading_rad": heading,
                "pitch_rad": pitch,
                "roll_rad": roll,
                "sound_speed_mps": float(sound) if sound > 0 else NAN,
            },
            cells=cells,
            alone=not velocity,
            group=0 if self.options.beams_from_axes else frame,
        )
        self.rows.append(row)

    def _tilt_rad(self, instrument: _Instrument) -> float:
        """Of the beams whose velocities are recovered.

        Raises:
            DataError: where the beams' angle is not stated, or the instrument looks up.
        """
        angle = instrument.angle_deg
        if angle is None or instrument.looks_up:
            why = (
                "do not state the angle of their beams"
                if angle is None
                else "are of an instrument that looks up"
            )
            raise DataError(
                "needs a known transducer that looks down",
                place=self.place,
                key="--beams-from-axes",
                hint=f"its ensembles {why}",
            )
        return float(np.radians(angle))

    def ready(self) -> list[Row]:
        """As `Decoder.ready`: of a stream those in beam coordinates."""
        rows = super().ready()
        for row in rows:
            if row.group and not row.alone:
                self.account.skip(f"{ADVICE[FRAMES[row.group]]} hold no beam velocities", row.position)
        return self._usable([row for row in rows if not row.group], 0)

    def _usable(self, rows: Sequence[Row], use: int) -> list[Row]:
        """Pings in the coordinates `use`, with water where these are beams; what is left out is counted."""
        account, found = self.account, []
        for row in rows:
            if row.alone:
                account.pass_by("ensemble without bottom track", row.position)
            elif row.time_ns is None:
                account.skip("clock out of range", row.position)
            elif row.group != use:
                why = f"{FRAMES[row.group]} coordinates among {FRAMES[use]} coordinates"
                account.skip(why, row.position)
            if row.time_ns is not None and row.group == use and not (use and row.alone):
                found.append(_own(row) if use else row)
        return found

    def recording(self) -> Recording:
        """The table, as `Decoder.recording`.

        Beam velocities where ensembles are in beam coordinates. Of other coordinates `instrument_only` makes a table of
        the instrument's velocity, and `beams_from_axes` one of the beams that went into it, where these were four.

        Raises:
            DataError: also where the velocities are not in beam coordinates and neither option is set.
        """
        own = self.options.instrument_only
        pings = [row.group for row in self.rows if not row.alone]
        counts = [pings.count(frame) for frame in range(len(FRAMES))]
        if self.rows and not pings:
            raise DataError(
                f"none of {len(self.rows)} ensembles has bottom track (data type 0600h)",
                place=self.place,
                expected="it in some",
                hint=f"switch it on (BP1) and record it (PD0){lost(self.account)}",
            )
        most = counts.index(max(counts))
        if pings and not counts[0] and not own:
            raise DataError(
                f"{len(pings)} pings in {ADVICE[FRAMES[most]]} hold no beam velocities",
                place=self.place,
                hint=(
                    "set the instrument to beam coordinates (EX00000) and record again, recover the "
                    "beams from solutions of four with --beams-from-axes, or convert its own velocity "
                    "with --instrument-only"
                ),
            )
        use = 0 if counts[0] and not own else most
        rows = self._usable(self.rows, use)
        found = self.tables("ensemble with bottom track", 0 if use else _BEAMS, rows)
        assert self._of_pings is not None  # of a table with a row
        return self._described(found, use, *self._of_pings)

    def _described(
        self, found: Recording, use: int, instrument: _Instrument, recorded: int, resolution_mps: float
    ) -> Recording:
        angle, up = instrument.angle_deg, instrument.looks_up
        notes = ["time is the ensemble's own clock, to a hundredth of a second"]
        if up:
            notes.append("the instrument is configured to look up, but the packaged geometry looks down")
        if use == 1:
            notes.append(
                "instrument axes (y towards beam 3, x towards beam 2) are taken as forward and starboard"
            )
        if use:
            notes.append("no beam velocities: the table holds the instrument's velocity alone")
            notes.append(
                f"{FRAMES[use]} axes (starboard or east, forward or north, up) of the bottom to those of the vehicle"
            )
        elif self._recovered:
            notes.append("beams recovered from axes and error velocity, of solutions of four beams")
        return replace(
            found,
            frame=("none", "frd", "frd", "ned")[use],
            clock="the instrument's real-time clock",
            quality="" if use else "correlation, counts 0 to 255",
            geometry=f"teledyne_{angle}" if not use and angle in {20, 30} and not up else "",
            resolution_mps=resolution_mps,
            notes=notes,
            facts={"coordinates": FRAMES[recorded], "beam_angle_deg": angle, "looks_up": up},
        )


def _own(row: Row) -> Row:
    """A ping in axes, without beams.

    Recorded is starboard, forward, up or east, north, up; the bottom's velocity is the vehicle's with the opposite
    sign.
    """
    across, ahead, up, error = row.velocity
    return row.of_axes([-ahead, -across, up], error_velocity_mps=error)


def _beams(velocity: object, fixed: bytes, tilt_rad: float, hpr_rad: list[float]) -> Floats:
    """(m, 4) beams of velocities (m, 4) in the axes of a fixed leader."""
    values = np.asarray(velocity, dtype=np.float64)
    every = np.ones(len(values), dtype=np.int64)
    axes, convex = fixed[25] * every, (word_at(fixed, 4) & _CONVEX) * every > 0
    tilted = axes & _USES_TILTS > 0
    return beams_of_axes(values, axes >> 3 & 3, tilted, convex, tilt_rad, np.outer(every, hpr_rad))


def _time_ns(leader: bytes) -> int | None:
    """Clock of a variable leader, ns since 1970; the one with a century where it is set."""
    year, *rest = leader[4:11]
    year += 1900 + 100 * (year < 80)
    if len(leader) >= 65 and leader[57] in {19, 20}:
        year, *rest = leader[58:65]
        year += 100 * leader[57]
    *fields, hundredth = rest
    return calendar_ns([year, *fields], hundredth * 10_000_000)


def _bottom(track: bytes, fine: bytes) -> tuple[list[float], list[float], list[float]]:
    """Velocities (m/s), ranges (m) and correlations of a bottom track; nothing without one."""
    velocity, range_m, correlation = ([NAN] * _BEAMS for _ in range(3))
    if len(track) >= 44:
        found = _COARSE.unpack_from(track, 16)
        # The ranges' third bytes came with longer ranges than 655 m; older firmware ends before them.
        high = track[77:81] if len(track) >= 81 else bytes(_BEAMS)
        cm = [low + (more << 16) for low, more in zip(found[:4], high, strict=True)]
        range_m = [one * 0.01 if one > 0 else NAN for one in cm]
        velocity = [NAN if one == _BAD else one * 1e-3 for one in found[4:8]]
        correlation = [float(one) for one in found[8:]]
    if len(fine) >= 18:
        values = struct.unpack_from("<4i", fine, 2)
        bad = [one in _BAD_FINE for one in values]
        if len(track) >= 44:
            bad = [one or math.isnan(coarse) for one, coarse in zip(bad, velocity, strict=True)]
        velocity = [NAN if none else one * 1e-5 for none, one in zip(bad, values, strict=True)]
    elif len(track) < 44:
        return [], [], []
    return velocity, range_m, correlation


def _cells(types: dict[int, bytes], fixed: bytes, angle_deg: int | None) -> Cells | None:
    """The cells of the water profile, as many as velocities and fixed leader have, or the water-mass layer as cell 1.

    None where there are none, and where the angle of the beams is not stated.
    """
    if angle_deg is None:
        return None
    profile, of_correlation = types.get(_PROFILE, b""), types.get(_CORRELATION, b"")
    cells = min(fixed[9], (len(profile) - 2) // 8) if len(fixed) >= 34 and len(profile) > 2 else 0
    correlation = np.full((cells, _BEAMS), np.nan)
    if cells:
        velocity = np.frombuffer(profile, "<i2", _BEAMS * cells, 2).reshape(cells, _BEAMS)
        has = min(cells, max(len(of_correlation) - 2, 0) // _BEAMS)
        correlation[:has] = np.frombuffer(of_correlation[2:], "u1", _BEAMS * has).reshape(has, _BEAMS)
        number = np.arange(cells)
        distance_m = word_at(fixed, 32) * 0.01 + word_at(fixed, 12) * 0.01 * number
    elif len(track := types.get(_BOTTOM, b"")) >= 62:
        near, far, *layer = struct.unpack_from("<HH4h4B", track, 46)
        velocity = np.array([layer[:4]], dtype=np.int16)
        if far <= near or (velocity == _BAD).all():
            return None
        correlation, number = np.array([layer[4:]], dtype=np.float64), np.zeros(1, dtype=np.int64)
        distance_m = np.array([(float(near) + far) * 0.05])
    else:
        return None
    speed = np.where(velocity == _BAD, NAN, velocity * 1e-3)
    return Cells(
        number=number + 1,
        range_m=distance_m / np.cos(np.radians(angle_deg)),
        velocity=speed,
        valid=np.isfinite(speed),
        quality=correlation,
    )


FORMAT = Format("pd0", "Teledyne PD0, bottom track", _sniff, _Decoder)
