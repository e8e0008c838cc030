"""Teledyne PD0: ensembles with bottom track (0x0600) and its high-resolution velocity (0x5803).

An ensemble is 7F 7F, its length, a table of offsets to data types, and a 16-bit sum of all its bytes. The fixed leader
(command EX) gives the coordinates of the four bottom-track velocities: beams, or the instrument's, the ship's or the
earth's axes and an error velocity. Recorded velocities are those of the bottom relative to the instrument: a beam is
positive when the bottom comes nearer, which is our b . v; velocities in axes are negated to those of the vehicle.

Source: Teledyne RD Instruments, Workhorse and Pathfinder guides, "PD0 output data format"; signs from recordings with
GPS (docs/formats.md).
"""

import datetime as dt
import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bottomlock.errors import DataError
from bottomlock.io.beam_table import Account, BeamTable, Recording
from bottomlock.io.binary_records import BLOCK, EMPTY, Headers, Places, bytes_of, words_at
from bottomlock.io.rows import NAN, PLAIN, Options, Rows, lost, raise_if_empty, running_sums

NAME = "pd0"
_BEAMS = 4
FRAMES = ("beam", "instrument", "ship", "earth")
_FIXED, _VARIABLE, _BOTTOM, _BOTTOM_FINE = 0x0000, 0x0080, 0x0600, 0x5803
_BAD = -32768
# Bad in 0.01 mm/s: the coarse mark scaled, or the type's own least value.
_BAD_FINE = (-(2**31), _BAD * 100)
# Header, two offsets, and the parts of both leaders that are read.
_LEAST = 6 + 2 * 2 + 26 + 24
_LEADERS = {b"\x00\x00", b"\x01\x00"}
_EPOCH = dt.date(1970, 1, 1).toordinal()
_WORD = struct.Struct("<H")
_BOTTOM_STRUCT = struct.Struct("<4H4h4B")
ADVICE = {
    "instrument": "instrument coordinates (EX01xxx)",
    "ship": "ship coordinates (EX10xxx)",
    "earth": "earth coordinates (EX11xxx)",
}


def sniff(head: bytes) -> bool:
    """Whether the beginning of a file looks like this format: a header, perhaps after some text."""
    return any(_offsets(head, at) is not None for at in _header_places(head).tolist())


def _header_places(data: bytes) -> Places:
    """Places where an ensemble seems to begin: two sync bytes, a table of offsets, and a leader behind it."""
    raw = bytes_of(data)
    found = [np.empty(0, dtype=np.int64)]
    for block in range(0, max(len(raw) - 7, 0), BLOCK):
        part = raw[block : block + BLOCK + 7]
        n = len(part) - 7
        # The least that a header has, on whole vectors: the first offset is at most 6 + 2 x 255.
        mark = (part[:n] == 0x7F) & (part[1 : n + 1] == 0x7F) & (part[7:] <= 2) & (part[5 : n + 5] > 0)
        at = np.flatnonzero(mark) + block
        first = 6 + 2 * raw[at + 5].astype(np.int64)
        good = (words_at(raw, at + 6) == first) & (first + 2 <= words_at(raw, at + 2))
        good &= at + first + 2 <= len(raw)
        at, first = at[good], first[good]
        leader = at + first
        found.append(at[(raw[leader] <= 1) & (raw[leader + 1] == 0)])
    return np.concatenate(found)


def _headers(data: bytes) -> Headers:
    """The headers of a file, with the 16-bit sum of all bytes of each ensemble tested."""
    raw, sums = bytes_of(data), running_sums(data)
    start = _header_places(data)
    last = start + words_at(raw, start + 2)
    fits = last + 2 <= len(raw)
    a, b = start[fits], last[fits]
    fits[fits] = (sums[b] - sums[a]) == words_at(raw, b).astype(np.uint16)
    return Headers(start, last + 2, fits, last - start < _LEAST)


def _offsets(data: bytes, at: int) -> Sequence[int] | None:
    """Offsets of the data types of an ensemble that begins here, or None where no header stands."""
    if at + 8 > len(data):
        return None
    size, types = _WORD.unpack_from(data, at + 2)[0], data[at + 5]
    first = 6 + 2 * types
    if not types or first + 2 > size or at + first + 2 > len(data):
        return None
    offsets: tuple[int, ...] = struct.unpack_from(f"<{types}H", data, at + 6)
    if offsets[0] != first or max(offsets) + 2 > size or data[at + first : at + first + 2] not in _LEADERS:
        return None
    return offsets


@dataclass(frozen=True)
class Ensemble:
    """The fields of an ensemble that a beam table needs; None and NaN where missing."""

    position: int
    time_ns: int | None
    frame: int
    velocity_mps: tuple[float, ...] | None
    range_m: tuple[float, ...]
    correlation: tuple[float, ...]
    heading_rad: float
    pitch_rad: float
    roll_rad: float
    sound_speed_mps: float
    config: int
    angle_deg: int
    fine: bool


def _time_ns(leader: bytes) -> int | None:
    """Clock of a variable leader, ns since 1970; the one with a century where it is set."""
    year, month, day, hour, minute, second, hundredth = leader[4:11]
    year += 2000 if year < 80 else 1900
    if len(leader) >= 65 and leader[57] in {19, 20}:
        century, short, month, day, hour, minute, second, hundredth = leader[57:65]
        year = century * 100 + short
    if hour > 23 or minute > 59 or second > 60 or hundredth > 99:
        return None
    try:
        days = dt.date(year, month, day).toordinal() - _EPOCH
    except ValueError:
        return None
    return (days * 86_400 + hour * 3600 + minute * 60 + second) * 1_000_000_000 + hundredth * 10_000_000


def _bottom(types: dict[int, bytes]) -> tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]] | None:
    """Velocities (m/s), ranges (m) and correlations of the bottom track; NaN what is marked bad."""
    none = (NAN,) * _BEAMS
    coarse, fine = types.get(_BOTTOM, b""), types.get(_BOTTOM_FINE, b"")
    velocity, ranges, correlation = none, none, none
    if len(coarse) >= 44:
        numbers = _BOTTOM_STRUCT.unpack_from(coarse, 16)
        # The ranges' third bytes came with longer ranges than 655 m; older firmware ends before them.
        high = coarse[77:81] if len(coarse) >= 81 else bytes(_BEAMS)
        cm = [low + (h << 16) for low, h in zip(numbers[:4], high, strict=True)]
        ranges = tuple(c * 0.01 if c else NAN for c in cm)
        velocity = tuple(NAN if v == _BAD else v * 1e-3 for v in numbers[4:8])
        correlation = tuple(float(c) for c in numbers[8:12])
    elif len(fine) < 18:
        return None
    if len(fine) >= 18:
        exact = tuple(NAN if v in _BAD_FINE else v * 1e-5 for v in struct.unpack_from("<4i", fine, 2))
        bad = [len(coarse) >= 44 and math.isnan(v) for v in velocity]
        velocity = tuple(NAN if b else v for v, b in zip(exact, bad, strict=True))
    return velocity, ranges, correlation


def _ensemble(data: bytes, at: int, size: int, offsets: Sequence[int]) -> Ensemble | None:
    """The ensemble's fields, or None without leaders."""
    types: dict[int, bytes] = {}
    for start, end in zip(offsets, [*offsets[1:], size], strict=True):
        if end - start >= 2:
            types[_WORD.unpack_from(data, at + start)[0]] = data[at + start : at + end]
    fixed = types.get(_FIXED, types.get(0x0001, b""))
    leader = types.get(_VARIABLE, types.get(0x0081, b""))
    if len(fixed) < 26 or len(leader) < 24:
        return None
    sound, _, heading, pitch, roll = struct.unpack_from("<HHHhh", leader, 14)
    found = _bottom(types)
    velocity, ranges, correlation = found or (None, (), ())
    return Ensemble(
        position=at,
        time_ns=_time_ns(leader),
        frame=fixed[25] >> 3 & 3,
        velocity_mps=velocity,
        range_m=ranges,
        correlation=correlation,
        heading_rad=math.radians(heading * 0.01),
        pitch_rad=math.radians(pitch * 0.01),
        roll_rad=math.radians(roll * 0.01),
        sound_speed_mps=float(sound) if sound else NAN,
        config=_WORD.unpack_from(fixed, 4)[0],
        angle_deg=fixed[58] if len(fixed) > 58 else 0,
        fine=len(types.get(_BOTTOM_FINE, b"")) >= 18,
    )


def ensembles(data: bytes, account: Account) -> list[Ensemble]:
    """Every whole ensemble of a file; the account lists the others and the bytes between."""
    headers = _headers(data)
    found = []
    for k, at in headers.whole(len(data), account, "ensemble"):
        size = int(headers.end[k]) - at - 2
        offsets = _offsets(data, at)
        ensemble = None if offsets is None else _ensemble(data, at, size, offsets)
        if ensemble is None:
            account.skip(EMPTY, at)
        else:
            found.append(ensemble)
    return found


def read(data: bytes, place: str, options: Options = PLAIN) -> Recording:
    """The bottom-track pings of a file.

    Beam velocities where ensembles are in beam coordinates. In other coordinates there are none to be had, and only
    `instrument_only` makes a table, of the instrument's velocity.

    Raises:
        DataError: where there is no bottom track, or it is not in beam coordinates and `instrument_only` is not set.
    """
    account = Account(unit="byte")
    found = ensembles(data, account)
    pings = [e for e in found if e.velocity_mps is not None]
    for e in found:
        if e.velocity_mps is None:
            account.pass_by("ensemble without bottom track", e.position)
    counts = [sum(e.frame == k for e in pings) for k in range(len(FRAMES))]
    if found and not pings:
        raise DataError(
            f"{place}: none of {len(found)} ensembles has bottom track (data type 0600h), expected it in some; "
            f"switch it on (BP1) and record it (PD0){lost(account)}"
        )
    if pings and not counts[0] and not options.instrument_only:
        frame = FRAMES[max(range(len(FRAMES)), key=counts.__getitem__)]
        raise DataError(
            f"{place}: {len(pings)} pings in {ADVICE[frame]} hold no beam velocities; set the instrument to beam "
            "coordinates (EX00000) and record again, or convert its own velocity with --instrument-only"
        )
    use = 0 if counts[0] and not options.instrument_only else max(range(4), key=counts.__getitem__)
    rows = Rows(_BEAMS if use == 0 else 0, account)
    for e in pings:
        if e.time_ns is None:
            account.skip("clock out of range", e.position)
        elif e.frame != use:
            account.skip(f"{FRAMES[e.frame]} coordinates among {FRAMES[use]} coordinates", e.position)
        else:
            _add(rows, e, e.time_ns)
    table = rows.finish(negate=options.negate_beams)
    raise_if_empty(account, place, "ensemble with bottom track")
    return _recording(table, account, pings, use)


def _add(rows: Rows, e: Ensemble, time_ns: int) -> None:
    """A ping to the table, in beams or in axes."""
    velocity = e.velocity_mps or ()
    extra = {
        "heading_rad": e.heading_rad,
        "pitch_rad": e.pitch_rad,
        "roll_rad": e.roll_rad,
        "sound_speed_mps": e.sound_speed_mps,
    }
    if e.frame == 0:
        valid = [math.isfinite(v) for v in velocity]
        rows.add(
            e.position,
            time_ns,
            velocity,
            valid,
            range_m=e.range_m or None,
            quality=e.correlation or None,
            extra=extra,
        )
        return
    # The bottom's velocity in the instrument's axes is the vehicle's with the opposite sign.
    instrument = _VEHICLE[e.frame](*(-v for v in velocity[:3]))
    known = all(math.isfinite(v) for v in instrument)
    extra["error_velocity_mps"] = velocity[3]
    rows.add(e.position, time_ns, (), (), instrument=instrument, verdict=int(known), extra=extra)


def _from_ship(starboard: float, forward: float, up: float) -> tuple[float, float, float]:
    return forward, starboard, -up


def _from_earth(east: float, north: float, up: float) -> tuple[float, float, float]:
    return north, east, -up


_VEHICLE = {1: _from_ship, 2: _from_ship, 3: _from_earth}
_TABLE_FRAMES = ("none", "frd", "frd", "ned")


def _recording(table: BeamTable, account: Account, pings: Sequence[Ensemble], frame: int) -> Recording:
    first = pings[0]
    angle = {0: 15, 1: 20, 2: 30}.get(first.config >> 8 & 3)
    angle = first.angle_deg if angle is None and 0 < first.angle_deg < 60 else angle
    up = bool(first.config & 0x80)
    notes = ["time is the ensemble's own clock, to a hundredth of a second"]
    if up:
        notes.append("the instrument is configured to look up, but the packaged geometry looks down")
    if frame == 1:
        notes.append(
            "instrument axes (y towards beam 3, x towards beam 2) are taken as forward and starboard"
        )
    if frame:
        notes.append("no beam velocities: the table holds the instrument's velocity alone")
    return Recording(
        format=NAME,
        table=table,
        account=account,
        frame=_TABLE_FRAMES[frame],
        clock="the instrument's real-time clock",
        time_of="record",
        quality="correlation, counts 0 to 255" if frame == 0 else "",
        corrected=[]
        if frame == 0
        else [
            f"{FRAMES[frame]} axes (starboard or east, forward or north, up) of the bottom to those of the vehicle"
        ],
        geometry=f"teledyne_{angle}" if frame == 0 and angle in {20, 30} and not up else "",
        resolution_mps=1e-5 if first.fine else 1e-3,
        notes=notes,
        facts={"coordinates": FRAMES[frame], "beam_angle_deg": angle, "looks_up": up},
    )
