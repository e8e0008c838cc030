"""Teledyne PD0: ensembles with bottom track (0x0600), its high-resolution velocity (0x5803), and the water.

An ensemble is 7F 7F, its length, a table of offsets to data types, and a 16-bit sum of all its bytes. The fixed leader
(command EX) gives the coordinates of the four bottom-track velocities: beams, or the instrument's, the ship's or the
earth's axes and an error velocity. Recorded velocities are those of the bottom relative to the instrument: a beam is
positive when the bottom comes nearer, which is our b . v; velocities in axes are negated to those of the vehicle. The
same holds of the water: of its profile (0x0100, correlation 0x0200, cells by the fixed leader) or, where a file has
none, of the water-mass layer that a bottom track holds.

Source: Teledyne RD Instruments, Workhorse and Pathfinder guides, "PD0 output data format"; signs from recordings with
GPS (docs/formats.md).
"""

from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Self

import numpy as np
from numpy.typing import NDArray

from bottomlock.errors import DataError
from bottomlock.io.beam_table import Account, BeamTable, Flags, Floats, Integers, Recording, WaterTable
from bottomlock.io.binary_records import (
    EMPTY,
    Found,
    Headers,
    Places,
    Records,
    bytes_of,
    calendar_ns,
    fields_at,
    numbered,
    search,
    sums_fit,
    words_at,
)  # fmt: skip
from bottomlock.io.decoder import binary
from bottomlock.io.pd0_axes import beams_of_axes
from bottomlock.io.rows import NAN, Options, lost, make_table, make_water, raise_if_empty

_MARK, _BEAMS = b"\x7f\x7f", 4
FRAMES = ("beam", "instrument", "ship", "earth")
_BAD = -32768
# Bad in 0.01 mm/s: the coarse mark scaled, or the type's own least value.
_BAD_FINE = (-(2**31), _BAD * 100)
# Header, two offsets, and the parts of both leaders that are read.
_LEAST = 6 + 2 * 2 + 26 + 24
# Of the variable leader: year of the century, month, day, hour, minute, second, hundredth; the same after a century.
_CLOCK, _CENTURY, _CENTURY_CLOCK = np.arange(4, 11), 57, np.arange(58, 65)
_ATTITUDE = np.dtype(
    [("sound", "<u2"), ("depth", "<u2"), ("heading", "<u2"), ("pitch", "<i2"), ("roll", "<i2")]
)
_COARSE = np.dtype([("range", "<u2", 4), ("velocity", "<i2", 4), ("correlation", "u1", 4)])
_USES_TILTS = 1 << 2
# Bits of the configuration.
_CONVEX, _LOOKS_UP = 1 << 3, 1 << 7
# Numbers in `_spans` of what is read: fixed and variable leader, bottom track, its fine velocities, profile, its
# correlations; and their ids. Of the two ids of a leader the last stands.
_KINDS = np.array([0, 1, 0, 1, 2, 3, 4, 5])
_IDS = np.array([0x0001, 0x0081, 0x0000, 0x0080, 0x0600, 0x5803, 0x0100, 0x0200])
_CELLS = np.dtype(
    {"names": ["cells", "size", "first"], "formats": ["u1", "<u2", "<u2"], "offsets": [9, 12, 32]}
)
_CELL, _CELL_CORRELATION = np.dtype([("velocity", "<i2", 4)]), np.dtype([("correlation", "u1", 4)])
_LAYER = np.dtype([("near", "<u2"), ("far", "<u2"), ("velocity", "<i2", 4), ("correlation", "u1", 4)])
_HIGH, _FINE = np.dtype([("high", "u1", 4)]), np.dtype([("velocity", "<i4", 4)])
ADVICE = {
    "instrument": "instrument coordinates (EX01xxx)",
    "ship": "ship coordinates (EX10xxx)",
    "earth": "earth coordinates (EX11xxx)",
}


def _sniff(head: bytes) -> bool:
    """Whether the beginning of a file looks like it: a header, perhaps after some text."""
    start = _header_places(head)
    return bool(_spans(head, start, words_at(head, start + 2))[0].any())


def _header_places(data: bytes) -> Places:
    """Places where an ensemble seems to begin: two sync bytes, a table of offsets, and a leader behind it."""
    raw = bytes_of(data)

    def sound(at: Places) -> Flags:
        first = 6 + 2 * raw[at + 5].astype(np.int64)
        good: Flags = (words_at(data, at + 6) == first) & (first + 2 <= words_at(data, at + 2))
        good &= at + first + 2 <= len(raw)
        leader = (at + first)[good]
        good[good] = (raw[leader] <= 1) & (raw[leader + 1] == 0)
        return good

    # The least that a header has, on whole vectors: the first offset is at most 6 + 2 x 255.
    return search(data, _MARK, 8, {7: (0, 2), 5: (1, 255)}, sound)


def _headers(data: bytes) -> Headers:
    """The headers of a file, with the 16-bit sum of all bytes of each ensemble tested."""
    start = _header_places(data)
    last = start + words_at(data, start + 2)
    return Headers(start, last + 2, sums_fit(data, start, last), last - start < _LEAST)


_RECORDS = Records(_MARK, _headers, 6 + 2 * 0xFF + 2, "ensemble")


def _spans(data: bytes, start: Places, size: Places) -> tuple[Flags, Places]:
    """Where the data types of ensembles stand.

    Args:
        data: the file.
        start: (n,) where the ensembles begin, with a header of `_header_places`.
        size: (n,) bytes of each, without its checksum; it may reach beyond the data.

    Returns:
        (n,) whether the table of offsets stays within the ensemble, and place and length (n, 6, 2) of each of `_KINDS`,
        the last of several of one id; length 0 without any.
    """
    count = bytes_of(data)[start + 5].astype(np.int64)
    # One entry for each type of each ensemble.
    owner, number = numbered(count)
    offset = words_at(data, start[owner] + 6 + 2 * number)
    end = np.empty_like(offset)
    end[:-1], end[count.cumsum() - 1] = offset[1:], size
    sound = np.ones(len(start), dtype=bool)
    sound[owner[offset + 2 > size[owner]]] = False
    at, length = start[owner] + offset, end - offset
    readable = sound[owner] & (length >= 2) & (at + 2 <= len(data))
    owner, at, length = owner[readable], at[readable], length[readable]
    spans = np.zeros((len(start), 6, 2), dtype=np.int64)
    which, entry = (words_at(data, at) == _IDS[:, None]).nonzero()
    found = owner[entry], _KINDS[which]
    spans[(*found, 0)], spans[(*found, 1)] = at[entry], length[entry]
    return sound, spans


@dataclass(frozen=True, eq=False)
class Ensembles:
    """The fields of n ensembles that a beam table needs; NaN where missing.

    Attributes:
        position: (n,) where they begin.
        time_ns: (n,).
        on_clock: (n,) the time is one that a clock can show.
        recorded: (n,) index in `FRAMES`.
        frame: (n,) the same of `velocity_mps`.
        bottom: (n,) there is a bottom track.
        velocity_mps: (n, 4), as `range_m` and `correlation`.
        range_m: (n, 4).
        correlation: (n, 4).
        heading_rad: (n,), as `pitch_rad` and `roll_rad`.
        pitch_rad: (n,).
        roll_rad: (n,).
        sound_speed_mps: (n,).
        config: (n,) the system's configuration word.
        angle_deg: (n,) of the beams, 0 where it is not stated.
        fine: (n,) velocities in 0.01 mm/s are there.
        tilted: (n,) axes of ship and earth are levelled by the tilts.
        spans: (n, 6, 2) as `_spans`.
    """

    position: Places
    time_ns: Integers
    on_clock: Flags
    recorded: Integers
    frame: Integers
    bottom: Flags
    velocity_mps: Floats
    range_m: Floats
    correlation: Floats
    heading_rad: Floats
    pitch_rad: Floats
    roll_rad: Floats
    sound_speed_mps: Floats
    config: Integers
    angle_deg: Integers
    fine: Flags
    tilted: Flags
    spans: Integers

    def where(self, chosen: Flags) -> Self:
        """The chosen ones."""
        if np.count_nonzero(chosen) == len(chosen):
            return self
        return replace(self, **{each.name: getattr(self, each.name)[chosen] for each in fields(self)})

    def beams(self, velocity: Floats, owner: Integers, angle_deg: int) -> Floats:
        """(m, 4) beams of velocities of the ensembles `owner` (m,), in their coordinates."""
        hpr_rad = np.stack([self.heading_rad, self.pitch_rad, self.roll_rad], axis=1)[owner]
        convex = self.config[owner] & _CONVEX > 0
        tilt_rad = float(np.radians(angle_deg))
        return beams_of_axes(velocity, self.recorded[owner], self.tilted[owner], convex, tilt_rad, hpr_rad)


def _times(raw: NDArray[np.uint8], leader: Places, length: Places) -> tuple[Integers, Flags]:
    """Clocks of variable leaders, ns since 1970, and which are sound; the one with a century where it is set."""
    clock = raw[leader[:, None] + _CLOCK].astype(np.int64)
    clock[:, 0] += 1900 + 100 * (clock[:, 0] < 80)
    long = (length >= 65).nonzero()[0]
    if len(long):
        century = raw[leader[long] + _CENTURY].astype(np.int64)
        set_ = (century == 19) | (century == 20)
        long = long[set_]
        clock[long] = raw[leader[long][:, None] + _CENTURY_CLOCK]
        clock[long, 0] += century[set_] * 100
    return calendar_ns(clock, clock[:, 6] * 10_000_000)


def _bottom(data: bytes, spans: Places) -> tuple[Flags, Floats, Floats, Floats, Flags]:
    """By spans of ensembles: has bottom track, velocities (m/s), ranges (m), correlations, has fine velocities."""
    velocity, range_m, correlation = np.full((3, len(spans), _BEAMS), np.nan)
    (at, length), (fine_at, fine_length) = spans[:, 2].T, spans[:, 3].T
    has, has_fine = length >= 44, fine_length >= 18
    coarse = fields_at(data, at[has] + 16, _COARSE)
    # The ranges' third bytes came with longer ranges than 655 m; older firmware ends before them.
    cm = coarse["range"].astype(np.int64)
    long = length[has] >= 81
    cm[long] += fields_at(data, at[has][long] + 77, _HIGH)["high"].astype(np.int64) << 16
    range_m[has] = np.where(cm > 0, cm * 0.01, NAN)
    velocity[has] = np.where(coarse["velocity"] == _BAD, NAN, coarse["velocity"] * 1e-3)
    correlation[has] = coarse["correlation"]
    if has_fine.any():
        fine = fields_at(data, fine_at[has_fine] + 2, _FINE)["velocity"]
        bad = (fine == _BAD_FINE[0]) | (fine == _BAD_FINE[1])
        bad |= has[has_fine, None] & np.isnan(velocity[has_fine])
        velocity[has_fine] = np.where(bad, NAN, fine * 1e-5)
    return has | has_fine, velocity, range_m, correlation, has_fine


def _ensembles(found: Found) -> Ensembles:
    """The ensembles with both leaders; the account lists the others."""
    data, start, end, account = found
    raw = bytes_of(data)
    sound, spans = _spans(data, start, end - start - 2)
    whole = sound & (spans[:, 0, 1] >= 26) & (spans[:, 1, 1] >= 24)
    account.skip_where(EMPTY, ~whole, start)
    spans = spans[whole]
    (fixed, fixed_length), (leader, leader_length) = spans[:, 0].T, spans[:, 1].T
    time_ns, on_clock = _times(raw, leader, leader_length)
    state = fields_at(data, leader + 14, _ATTITUDE)
    axes = raw[fixed + 25].astype(np.int64)
    frame = axes >> 3 & 3
    bottom, velocity, range_m, correlation, fine = _bottom(data, spans)
    angle = np.zeros(len(spans), dtype=np.int64)
    long = fixed_length > 58
    angle[long] = raw[fixed[long] + 58]
    return Ensembles(
        position=start[whole],
        time_ns=time_ns,
        on_clock=on_clock,
        recorded=frame,
        frame=frame,
        tilted=(axes & _USES_TILTS) > 0,
        bottom=bottom,
        velocity_mps=velocity,
        range_m=range_m,
        correlation=correlation,
        heading_rad=np.radians(state["heading"] * 0.01),
        pitch_rad=np.radians(state["pitch"] * 0.01),
        roll_rad=np.radians(state["roll"] * 0.01),
        sound_speed_mps=np.where(state["sound"] > 0, state["sound"], NAN),
        config=words_at(data, fixed + 4),
        angle_deg=angle,
        fine=fine,
        spans=spans,
    )


def _read(records: Found, place: str, options: Options) -> Recording:
    """The bottom-track pings of a file.

    Beam velocities where ensembles are in beam coordinates. Of other coordinates `instrument_only` makes a table of the
    instrument's velocity, and `beams_from_axes` one of the beams that went into it, where these were four.

    Raises:
        DataError: where there is no bottom track, or it is not in beam coordinates and neither option is set.
    """
    account, found = records.account, _ensembles(records)
    count = len(found.position)
    if options.beams_from_axes and count:
        found = _in_beams(found, place)
    without = ~found.bottom
    account.pass_by_where("ensemble without bottom track", without, found.position)
    pings = found.where(found.bottom)
    counts = np.bincount(pings.frame, minlength=len(FRAMES)).tolist()
    if count and not any(counts):
        raise DataError(
            f"none of {count} ensembles has bottom track (data type 0600h)",
            place=place,
            expected="it in some",
            hint=f"switch it on (BP1) and record it (PD0){lost(account)}",
        )
    most = counts.index(max(counts))
    if any(counts) and not counts[0] and not options.instrument_only:
        raise DataError(
            f"{sum(counts)} pings in {ADVICE[FRAMES[most]]} hold no beam velocities",
            place=place,
            hint=(
                "set the instrument to beam coordinates (EX00000) and record again, recover the "
                "beams from solutions of four with --beams-from-axes, or convert its own velocity "
                "with --instrument-only"
            ),
        )
    use = 0 if counts[0] and not options.instrument_only else most
    account.skip_where("clock out of range", ~pings.on_clock, pings.position)
    for frame, name in enumerate(FRAMES):
        if frame != use and counts[frame]:
            others = pings.on_clock & (pings.frame == frame)
            account.skip_where(f"{name} coordinates among {FRAMES[use]} coordinates", others, pings.position)
    table = _table(pings.where(pings.on_clock & (pings.frame == use)), use, account, options)
    raise_if_empty(account, place, "ensemble with bottom track")
    in_water = found.where(found.on_clock & (found.frame == 0))
    water = None if use else _water(records.data, in_water, account, options)
    return _recording(table, account, pings, use, water)


def _table(e: Ensembles, frame: int, account: Account, options: Options) -> BeamTable:
    """The table of pings in one frame, of beams or of axes."""
    attitude = {
        name: getattr(e, name) for name in ("heading_rad", "pitch_rad", "roll_rad", "sound_speed_mps")
    }
    common = partial(make_table, account, position=e.position, time_ns=e.time_ns, negate=options.negate_beams)
    velocity = e.velocity_mps
    if frame == 0:
        return common(
            beams=_BEAMS,
            velocity=velocity,
            valid=np.isfinite(velocity),
            range_m=e.range_m,
            quality=e.correlation,
            extra=attitude,
        )
    # Starboard, forward, up or east, north, up; the bottom's velocity is the vehicle's with the opposite sign.
    instrument = velocity[:, [1, 0, 2]] * np.array([-1.0, -1.0, 1.0])
    none = np.empty((len(velocity), 0))
    return common(
        beams=0,
        velocity=none,
        valid=none,
        instrument=instrument,
        verdict=np.isfinite(instrument).all(axis=1),
        extra=attitude | {"error_velocity_mps": velocity[:, 3]},
    )


_TABLE_FRAMES = ("none", "frd", "frd", "ned")


def _beam_angle_deg(pings: Ensembles) -> int | None:
    """Of the beams to the instrument's axis, as the first ensemble states it."""
    own = int(pings.angle_deg[0])
    return {0: 15, 1: 20, 2: 30}.get(int(pings.config[0]) >> 8 & 3, own if 0 < own < 60 else None)


def _in_beams(e: Ensembles, place: str) -> Ensembles:
    """The ensembles with the beams that went into their velocities.

    Raises:
        DataError: where the beams' angle is not stated, or the instrument looks up.
    """
    angle = _beam_angle_deg(e)
    if angle is None or e.config[0] & _LOOKS_UP:
        why = (
            "do not state the angle of their beams" if angle is None else "are of an instrument that looks up"
        )
        raise DataError(
            "needs a known transducer that looks down",
            place=place,
            key="--beams-from-axes",
            hint=f"its ensembles {why}",
        )
    beams = e.beams(e.velocity_mps, np.arange(len(e.position)), angle)
    return replace(e, velocity_mps=beams, frame=np.zeros_like(e.frame))


def _water(data: bytes, e: Ensembles, account: Account, options: Options) -> WaterTable | None:
    """The cells of ensembles in beam coordinates: of their profiles or, where none has one, the water-mass layers."""
    angle = _beam_angle_deg(e) if len(e.position) else None
    if angle is None:
        return None
    owner, cell, distance_m, velocity, correlation = _profile(data, e.spans)
    if not len(owner):
        return None
    velocity_mps = np.where(velocity == _BAD, NAN, velocity * 1e-3)
    if e.recorded.any():
        velocity_mps = e.beams(velocity_mps, owner, angle)
    return make_water(
        account,
        e.position[owner],
        e.time_ns[owner],
        cell,
        distance_m / np.cos(np.radians(angle)),
        velocity_mps,
        np.isfinite(velocity_mps),
        quality=correlation,
        negate=options.negate_beams,
    )


_WaterCells = tuple[Integers, Integers, Floats, NDArray[np.int16], Floats]


def _profile(data: bytes, spans: Integers) -> _WaterCells:
    """The cells of the water profiles, as many as velocities and fixed leader have; without any, `_layer`.

    Returns:
        Of each its ensemble, number, distance along the instrument's axis, m, velocities (n, 4), mm/s, and correlations
        (n, 4), NaN where there are none.
    """
    (fixed, fixed_length), *_, (at, length), (correlation_at, correlation_length) = spans.transpose(1, 2, 0)
    known = ((fixed_length >= 34) & (length > 2)).nonzero()[0]
    setup = fields_at(data, fixed[known], _CELLS)
    cells = np.minimum(setup["cells"], (length[known] - 2) // _CELL.itemsize)
    if not cells.any():
        return _layer(data, spans)
    mine, number = numbered(cells)
    owner, distance_m = known[mine], setup["first"][mine] * 0.01 + setup["size"][mine] * 0.01 * number
    velocity = fields_at(data, at[owner] + 2 + _CELL.itemsize * number, _CELL)["velocity"]
    correlation = np.full((len(owner), _BEAMS), np.nan)
    has = 2 + 4 * (number + 1) <= correlation_length[owner]
    there = correlation_at[owner[has]] + 2 + 4 * number[has]
    correlation[has] = fields_at(data, there, _CELL_CORRELATION)["correlation"]
    return owner, number + 1, distance_m, velocity, correlation


def _layer(data: bytes, spans: Integers) -> _WaterCells:
    """The water-mass layers in which a beam has a velocity, as `_profile`; each is cell 1."""
    at, length = spans[:, 2].T
    owner = (length >= 62).nonzero()[0]
    layer = fields_at(data, at[owner] + 46, _LAYER)
    there = (layer["far"] > layer["near"]) & (layer["velocity"] != _BAD).any(axis=1)
    middle_m = (layer["near"].astype(np.float64) + layer["far"]) * 0.05
    correlation = layer["correlation"].astype(np.float64)
    owner = owner[there]
    return owner, np.ones_like(owner), middle_m[there], layer["velocity"][there], correlation[there]


def _recording(
    table: BeamTable, account: Account, pings: Ensembles, frame: int, water: WaterTable | None
) -> Recording:
    config, angle = int(pings.config[0]), _beam_angle_deg(pings)
    up = bool(config & _LOOKS_UP)
    notes = ["time is the ensemble's own clock, to a hundredth of a second"]
    if up:
        notes.append("the instrument is configured to look up, but the packaged geometry looks down")
    if frame == 1:
        notes.append(
            "instrument axes (y towards beam 3, x towards beam 2) are taken as forward and starboard"
        )
    if frame:
        notes.append("no beam velocities: the table holds the instrument's velocity alone")
    corrected = []
    if frame:
        corrected.append(
            f"{FRAMES[frame]} axes (starboard or east, forward or north, up) of the bottom to those of the vehicle"
        )
    elif pings.recorded.any():
        corrected.append("beams recovered from axes and error velocity, of solutions of four beams")
    return Recording(
        table=table,
        account=account,
        frame=_TABLE_FRAMES[frame],
        clock="the instrument's real-time clock",
        time_of="record",
        quality="correlation, counts 0 to 255" if frame == 0 else "",
        corrected=corrected,
        geometry=f"teledyne_{angle}" if frame == 0 and angle in {20, 30} and not up else "",
        resolution_mps=1e-5 if pings.fine[0] else 1e-3,
        notes=notes,
        facts={"coordinates": FRAMES[pings.recorded[0]], "beam_angle_deg": angle, "looks_up": up},
        water=water,
    )


FORMAT = binary("pd0", "Teledyne PD0, bottom track", _sniff, _RECORDS, _read)
