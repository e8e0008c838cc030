"""Nortek DVL500 and DVL1000: bottom track in the binary formats DF21 and DF22 (record id 0x1B).

The status word holds validity flags of velocity, distance and figure of merit for each beam and each axis. Distances
are vertical. Layout as in the manufacturer's published structure; DF22 is assumed to have the same fields.
"""

import math
import struct

import numpy as np

from bottomlock.io.beam_table import Account, BeamTable, Recording
from bottomlock.io.nortek_ascii import NO_FOM_MPS, NO_VELOCITY_MPS, TILT_RAD
from bottomlock.io.nortek_frames import BOTTOM_DVL, Frame, frames, kinds, name_of, struct_tm_ns
from bottomlock.io.rows import NAN, PLAIN, Options, Rows, raise_if_empty

NAME = "nortek-dvl"
_BEAMS = 4
_DATA = struct.Struct("<BBI6sHHII3f24f20f")
_SIZE = _DATA.size
UNSURE = "sign not confirmed on a recording: positive towards the bottom is assumed; --negate-beams turns it"


def sniff(head: bytes) -> bool:
    """Whether the beginning of a file looks like this format."""
    return b"\xa5" in head and BOTTOM_DVL in kinds(head)


def read(data: bytes, place: str, options: Options = PLAIN) -> Recording:
    """The bottom-track records of a stream.

    Raises:
        DataError: where there is none.
    """
    account = Account(unit="byte")
    rows = Rows(_BEAMS, account)
    for frame in frames(data, account):
        if frame.kind != BOTTOM_DVL:
            account.pass_by(name_of(frame.kind), frame.position)
        elif len(frame.data) < _SIZE:
            account.skip("bottom track of another layout", frame.position, f"{len(frame.data)} bytes")
        else:
            _add(rows, frame)
    table = rows.finish(negate=options.negate_beams)
    raise_if_empty(account, place, "bottom-track record (DF21, DF22)")
    return Recording(
        format=NAME,
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
        ],
    )


def _add(rows: Rows, frame: Frame) -> None:
    """A record to the table."""
    _, _, _, clock, hundred_us, beams, error, status, sound, _, _, *numbers = _DATA.unpack_from(frame.data)
    time_ns = struct_tm_ns(clock, hundred_us)
    if time_ns is None:
        rows.account.skip("clock out of range", frame.position)
        return
    if error:
        rows.account.flag("instrument reports an error", frame.position, f"code {error:#x}")
    if beams not in {0, _BEAMS}:
        rows.account.flag("record states another number of beams", frame.position, f"{beams} beams")
    velocity, distance, fom, delay = (numbers[4 * k : 4 * k + 4] for k in range(4))
    axes, axes_fom = numbers[24:28], numbers[28:32]
    good = [bool(status >> k & 1) for k in range(20)]
    ups = [axes[k] for k in (2, 3) if good[12 + k]]
    known = good[12] and good[13] and bool(ups)
    rows.add(
        frame.position,
        time_ns,
        [v if v > NO_VELOCITY_MPS + 1e-3 else NAN for v in velocity],
        [ok and v > NO_VELOCITY_MPS + 1e-3 for v, ok in zip(velocity, good[:4], strict=True)],
        range_m=[
            d / math.cos(TILT_RAD) if ok and d > 0.0 else NAN
            for d, ok in zip(distance, good[4:8], strict=True)
        ],
        sd=[f if ok and f < NO_FOM_MPS else NAN for f, ok in zip(fom, good[8:12], strict=True)],
        instrument=(*axes[:2], sum(ups) / len(ups)) if known else (NAN, NAN, NAN),
        verdict=int(known),
        extra={
            "instrument_sd_mps": max(axes_fom[:3]) if all(good[16:19]) else NAN,
            "sound_speed_mps": sound,
            **{f"beam{k + 1}_delay_s": d for k, d in enumerate(delay)},
        },
    )


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
