"""Nortek DVL500 and DVL1000: bottom track (record id 0x1B) and water track (0x1D) in the binary formats DF21 and DF22.

The status word holds validity flags of velocity, distance and figure of merit for each beam and each axis. Distances
are vertical. Layout as in the manufacturer's published structure, which both records share; DF22 is assumed to have the
same fields.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bottomlock.io.beam_table import Account, BeamTable, Flags, Floats, Integers, Recording, WaterTable
from bottomlock.io.binary_records import Found, fields_at
from bottomlock.io.decoder import binary
from bottomlock.io.nortek_ascii import NO_FOM_MPS, NO_VELOCITY_MPS, TILT_RAD
from bottomlock.io.nortek_frames import (
    BOTTOM_DVL,
    RECORDS,
    WATER_DVL,
    Frames,
    flags_of,
    frames,
    kinds,
    struct_tm_ns,
)
from bottomlock.io.rows import NAN, Options, make_table, make_water, raise_if_empty

_BEAMS = 4
_DATA = np.dtype(
    [
        ("version", "u1"), ("offset", "u1"), ("serial", "<u4"), ("clock", "u1", 6), ("hundred_us", "<u2"),
        ("beams", "<u2"), ("error", "<u4"), ("status", "<u4"), ("sound", "<f4"), ("temperature", "<f4"),
        ("pressure", "<f4"), ("velocity", "<f4", 4), ("distance", "<f4", 4), ("fom", "<f4", 4), ("delay", "<f4", 4),
        ("delay_2", "<f4", 4), ("period", "<f4", 4), ("axes", "<f4", 4), ("axes_fom", "<f4", 4), ("rest", "<f4", 12),
    ]
)  # fmt: skip
UNSURE = "sign not confirmed on a recording: positive towards the bottom is assumed; --negate-beams turns it"


def _sniff(head: bytes) -> bool:
    return b"\xa5" in head and BOTTOM_DVL in kinds(head)


def _read(records: Found, place: str, options: Options) -> Recording:
    """The bottom-track records of a stream, and its water track.

    Raises:
        DataError: where there is none.
    """
    data, account, found = records.data, records.account, frames(records)
    pings = found.pings(found.kind == BOTTOM_DVL, account).of_layout(_DATA, account)
    table = _table(data, pings, account, options)
    water = _water(data, found.where(found.kind == WATER_DVL), account, options)
    raise_if_empty(account, place, "bottom-track record (DF21, DF22)", water, options)
    return Recording(
        format=FORMAT.name,
        table=table,
        account=account,
        frame="instrument",
        clock="the instrument's, UTC if it was set so",
        time_of="record",
        corrected=[
            "distance is vertical: divided by the cosine of 25 deg to lie along the beam",
            "instrument z is the mean of z1 and z2 where both are valid",
        ],
        geometry="nortek_dvl1000",
        notes=[
            "time is that of the record; beam1_delay_s ... hold its DT1, trigger to centre of echo",
            UNSURE,
            *vertical_note(table),
            *no_layer_note(water),
        ],
        water=water,
    )


@np.errstate(invalid="ignore")
def _table(data: bytes, pings: Frames, account: Account, options: Options) -> BeamTable:
    """The table of the records."""
    f, time_ns, on_clock = _on_clock(data, pings)
    account.skip_where("clock out of range", ~on_clock, pings.position)
    at = pings.position[on_clock]
    error, beams = f["error"], f["beams"]
    account.flag_where("instrument reports an error", error > 0, at, lambda k: f"code {error[k]:#x}")
    other = (beams != 0) & (beams != _BEAMS)
    account.flag_where("record states another number of beams", other, at, lambda k: f"{beams[k]} beams")
    good = flags_of(f["status"], 20)
    velocity, along_m, fom = _beams(f, good)
    axes = f["axes"].astype(np.float64)
    first, second = (good[:, k : k + 1] for k in (14, 15))
    mean = 0.5 * (axes[:, 2:3] + axes[:, 3:])
    vertical = np.where(first & second, mean, np.where(first, axes[:, 2:3], axes[:, 3:]))
    known = good[:, 12] & good[:, 13] & (first | second)[:, 0]
    return make_table(
        account,
        _BEAMS,
        at,
        time_ns,
        velocity,
        good[:, :4] & np.isfinite(velocity),
        range_m=along_m,
        sd=fom,
        instrument=np.where(known[:, None], np.hstack([axes[:, :2], vertical]), NAN),
        verdict=known,
        extra={
            "instrument_sd_mps": np.where(good[:, 16:19].all(axis=1), f["axes_fom"][:, :3].max(axis=1), NAN),
            "sound_speed_mps": f["sound"],
            **{f"beam{k + 1}_delay_s": f["delay"][:, k] for k in range(_BEAMS)},
        },
        negate=options.negate_beams,
    )


def _on_clock(data: bytes, records: Frames) -> tuple[NDArray[Any], Integers, Flags]:
    """The fields and times of the records whose clock is in range, and (n,) which these are."""
    fields = fields_at(data, records.start, _DATA)
    time_ns, on_clock = struct_tm_ns(fields["clock"], fields["hundred_us"])
    return fields[on_clock], time_ns[on_clock], on_clock


def _beams(fields: NDArray[Any], good: Flags) -> tuple[Floats, Floats, Floats]:
    """Velocities, ranges along the beams and figures of merit (n, 4); NaN where there is none."""
    velocity, distance, fom = (fields[name].astype(np.float64) for name in ("velocity", "distance", "fom"))
    return (
        np.where(velocity > NO_VELOCITY_MPS + 1e-3, velocity, NAN),
        np.where(good[:, 4:8] & (distance > 0.0), distance / math.cos(TILT_RAD), NAN),
        np.where(good[:, 8:12] & (fom < NO_FOM_MPS), fom, NAN),
    )


@np.errstate(invalid="ignore")
def _water(data: bytes, found: Frames, account: Account, options: Options) -> WaterTable | None:
    """The layer of the water of the water-track records, as cell 1."""
    records = found.where(found.size >= _DATA.itemsize)
    if not len(records.start):
        return None
    fields, time_ns, on_clock = _on_clock(data, records)
    good = flags_of(fields["status"], 20)
    velocity, along_m, fom = _beams(fields, good)
    return make_water(
        account,
        records.position[on_clock],
        time_ns,
        np.ones(len(fields)),
        layer_range_m(along_m),
        velocity,
        good[:, :4] & np.isfinite(velocity),
        sd=fom,
        negate=options.negate_beams,
    )


def layer_range_m(along_m: Floats) -> Floats:
    """(n,) range of a layer of water, the mean over the beams that have one (n, B); 0 where none has."""
    known = np.isfinite(along_m)
    return np.asarray(np.where(known, along_m, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1))


def no_layer_note(water: WaterTable | None) -> list[str]:
    """A note where water track states no distance."""
    if water is None or (water.range_m > 0.0).all():
        return []
    return ["water track without a distance is taken as that of the water at the instrument"]


def vertical_note(table: BeamTable) -> list[str]:
    """A note where the mean of the beams is opposite to the instrument's vertical velocity: a wrong sign."""
    whole = table.valid.all(axis=1) & (table.instrument_valid == 1) & np.isfinite(table.instrument_mps[:, 2])
    if whole.sum() < 20:
        return []
    mean, up = table.velocity_mps[whole].mean(axis=1), table.instrument_mps[whole, 2]
    agreement = float(mean @ up) / math.sqrt(float(mean @ mean) * float(up @ up) + 1e-30)
    if agreement > -0.5:
        return []
    against = f"the mean of the beams is opposite to the instrument's z (correlation {agreement:.2f})"
    return [
        f"{against}: check with `bottomlock audit`; if z points to the bottom, convert with --negate-beams"
    ]


FORMAT = binary(
    "nortek-dvl",
    "Nortek DVL500/1000, DF21 and DF22",
    _sniff,
    RECORDS,
    _read,
    (BOTTOM_DVL, WATER_DVL),
    figures=True,
)
