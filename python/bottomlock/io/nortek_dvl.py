"""Nortek DVL500 and DVL1000: bottom track (record id 0x1B) and water track (0x1D) in the binary formats DF21 and DF22.

The status word holds validity flags of velocity, distance and figure of merit for each beam and each axis. Distances
are vertical. Layout as in the manufacturer's published structure, which both records share; DF22 is assumed to have the
same fields. The Nucleus has the same records for three beams (`nucleus`).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bottomlock.io.beam_table import Account, BeamTable, Flags, Floats, Integers, Recording, WaterTable
from bottomlock.io.binary_records import Found, fields_at
from bottomlock.io.decoder import binary
from bottomlock.io.nortek_ascii import NO_FOM_MPS, NO_VELOCITY_MPS, TILT_RAD
from bottomlock.io.nortek_frames import BOTTOM_DVL, RECORDS, WATER_DVL, flags_of, frames, kinds, struct_tm_ns
from bottomlock.io.rows import NAN, UNSURE, Options, make_table, make_water, raise_if_empty

Records = tuple[NDArray[Any], Integers]
"""Fields of a layout, and positions (n,)."""


@dataclass(frozen=True)
class Layout:
    """Records of bottom and water track, which share their fields.

    Attributes:
        fields: of the data.
        bottom, water: their ids.
        clock: times of fields, and which are in range.
        family: of the instrument; None for any.
        tilt_rad: of the beams, where distances are vertical and marks stand for what is none; None for numbers as they
            are.
        what: a record of bottom track, in words.
    """

    fields: np.dtype[Any]
    bottom: int
    water: int
    clock: Callable[[NDArray[Any]], tuple[Integers, Flags]]
    family: int | None
    tilt_rad: float | None
    what: str

    def of(self, found: Found) -> tuple[Records, Records]:
        """The records of bottom and of water track; others are counted."""
        data, account, every = found.data, found.account, frames(found)
        is_bottom, is_water = every.kind == self.bottom, every.kind == self.water
        if self.family is not None:
            is_bottom &= every.family == self.family
            is_water &= every.family == self.family
        bottom = every.pings(is_bottom, account).of_layout(self.fields, account)
        water = every.where(is_water & (every.size >= self.fields.itemsize))
        of_bottom, of_water = (
            (fields_at(data, one.start, self.fields), one.position) for one in (bottom, water)
        )
        return of_bottom, of_water

    def tables(
        self, bottom: Records, water: Records, account: Account, place: str, options: Options
    ) -> tuple[BeamTable, WaterTable | None, list[str]]:
        """The tables of records, and what is said of their signs and of the water.

        Raises:
            DataError: where there is none.
        """
        table = self._bottom(*bottom, account, options)
        layer = self._layer(*water, account, options) if len(water[0]) else None
        raise_if_empty(account, place, self.what, layer, options)
        notes = [UNSURE, *_vertical_note(table)]
        if layer is not None and not (layer.range_m > 0.0).all():
            notes.append("water track without a distance is taken as that of the water at the instrument")
        return table, layer, notes

    @np.errstate(invalid="ignore")
    def _bottom(
        self, fields: NDArray[Any], position: Integers, account: Account, options: Options
    ) -> BeamTable:
        time_ns, on_clock = self.clock(fields)
        if not on_clock.all():
            account.skip_where("clock out of range", ~on_clock, position)
            fields, position, time_ns = fields[on_clock], position[on_clock], time_ns[on_clock]
        velocity, valid, along_m, fom, rest = self._beams(fields)
        if "error" in (self.fields.names or ()):
            error, beams = fields["error"], fields["beams"]
            account.flag_where(
                "instrument reports an error", error > 0, position, lambda k: f"code {error[k]:#x}"
            )
            other = (beams != 0) & (beams != velocity.shape[1])
            account.flag_where(
                "record states another number of beams", other, position, lambda k: f"{beams[k]} beams"
            )
        axes, known = _axes(fields["axes"], rest)
        has_fom = rest[:, fields["axes"].shape[1] :][:, :3].all(axis=1)
        return make_table(
            account,
            velocity.shape[1],
            position,
            time_ns,
            velocity,
            valid,
            range_m=along_m,
            sd=fom,
            instrument=axes,
            verdict=known,
            extra={
                "instrument_sd_mps": np.where(has_fom, fields["axes_fom"][:, :3].max(axis=1), NAN),
                "sound_speed_mps": fields["sound"],
                **{f"beam{k + 1}_delay_s": one for k, one in enumerate(fields["delay"].T)},
            },
            negate=options.negate_beams,
        )

    @np.errstate(invalid="ignore")
    def _layer(
        self, fields: NDArray[Any], position: Integers, account: Account, options: Options
    ) -> WaterTable | None:
        """The layer of the water, as cell 1, at the mean range of the beams that have one; 0 where none has."""
        time_ns, on_clock = self.clock(fields)
        velocity, valid, along_m, fom, _ = self._beams(fields[on_clock])
        known = np.isfinite(along_m)
        return make_water(
            account,
            position[on_clock],
            time_ns[on_clock],
            np.ones(len(velocity)),
            np.where(known, along_m, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1),
            velocity,
            valid,
            sd=fom,
            negate=options.negate_beams,
        )

    def _beams(self, fields: NDArray[Any]) -> tuple[Floats, Flags, Floats, Floats, Flags]:
        """Velocities, validity, ranges along the beams and figures of merit (n, beams), and the flags of the axes."""
        velocity, distance, fom = (
            fields[name].astype(np.float64) for name in ("velocity", "distance", "fom")
        )
        beams, axes = velocity.shape[1], fields["axes"].shape[1]
        flags = flags_of(fields["status"], 3 * beams + 2 * axes)
        valid, ranged, sure = (flags[:, k * beams : (k + 1) * beams] for k in range(3))
        if self.tilt_rad is not None:
            velocity = np.where(velocity > NO_VELOCITY_MPS + 1e-3, velocity, NAN)
            valid, ranged = valid & np.isfinite(velocity), ranged & (distance > 0.0)
            distance, sure = distance / math.cos(self.tilt_rad), sure & (fom < NO_FOM_MPS)
        return (
            velocity,
            valid,
            np.where(ranged, distance, NAN),
            np.where(sure, fom, NAN),
            flags[:, 3 * beams :],
        )


def _axes(axes: NDArray[np.float32], good: Flags) -> tuple[Floats, Flags]:
    """The instrument's velocity (n, 3), and whether it is valid; of two vertical ones the mean, or the valid one."""
    found = axes.astype(np.float64)
    if axes.shape[1] == 3:
        return found, np.asarray(good[:, :3].all(axis=1))
    z1, z2, first, second = found[:, 2:3], found[:, 3:], good[:, 2:3], good[:, 3:4]
    vertical = np.where(first & second, 0.5 * (z1 + z2), np.where(first, z1, z2))
    known = good[:, 0] & good[:, 1] & (first | second)[:, 0]
    return np.where(known[:, None], np.hstack([found[:, :2], vertical]), NAN), known


def _vertical_note(table: BeamTable) -> list[str]:
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


_LAYOUT = Layout(
    np.dtype(
        [
            ("version", "u1"), ("offset", "u1"), ("serial", "<u4"), ("clock", "u1", 6), ("hundred_us", "<u2"),
            ("beams", "<u2"), ("error", "<u4"), ("status", "<u4"), ("sound", "<f4"), ("temperature", "<f4"),
            ("pressure", "<f4"), ("velocity", "<f4", 4), ("distance", "<f4", 4), ("fom", "<f4", 4), ("delay", "<f4", 4),
            ("delay_2", "<f4", 4), ("period", "<f4", 4), ("axes", "<f4", 4), ("axes_fom", "<f4", 4),
            ("rest", "<f4", 12),
        ]
    ),
    BOTTOM_DVL,
    WATER_DVL,
    lambda fields: struct_tm_ns(fields["clock"], fields["hundred_us"]),
    family=None,
    tilt_rad=TILT_RAD,
    what="bottom-track record (DF21, DF22)",
)  # fmt: skip


def _read(records: Found, place: str, options: Options) -> Recording:
    """The bottom-track records of a stream, and its water track.

    Raises:
        DataError: where there is none.
    """
    table, water, notes = _LAYOUT.tables(*_LAYOUT.of(records), records.account, place, options)
    return Recording(
        table=table,
        account=records.account,
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
            *notes,
        ],
        water=water,
    )


FORMAT = binary(
    "nortek-dvl",
    "Nortek DVL500/1000, DF21 and DF22",
    lambda head: b"\xa5" in head and BOTTOM_DVL in kinds(head),
    RECORDS,
    _read,
    (BOTTOM_DVL, WATER_DVL),
    figures=True,
)
