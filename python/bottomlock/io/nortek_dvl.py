"""Nortek DVL500 and DVL1000: bottom track (record id 0x1B) and water track (0x1D) in the binary formats DF21 and DF22.

The status word holds validity flags of velocity, distance and figure of merit for each beam and each axis. Distances
are vertical. Layout as in the manufacturer's published structure, which both records share; DF22 is assumed to have the
same fields. The Nucleus has the same records for three beams (`nucleus`).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple

import numpy as np

from bottomlock.io.beam_table import BeamTable, Recording
from bottomlock.io.decoder import Cells, Decoder, Format, RecordDecoder, Row
from bottomlock.io.nortek_ascii import NO_FOM_MPS, NO_VELOCITY_MPS, TILT_RAD
from bottomlock.io.nortek_frames import (
    BOTTOM_DVL,
    FRAMING,
    WATER_DVL,
    body,
    kinds,
    name_of,
    struct_tm_ns,
)
from bottomlock.io.rows import NAN, UNSURE


class _Beams(NamedTuple):
    """Of a record, by beam: velocities, validity, ranges along it, figures of merit; and the flags of the axes."""

    velocity: list[float]
    valid: list[bool]
    range_m: list[float]
    sd: list[float]
    rest: list[bool]


@dataclass(frozen=True)
class Layout:
    """Records of bottom and water track, which share their fields.

    Attributes:
        fields: of the data.
        bottom, water: their ids.
        clock: time of the fields; None for one that is out of range.
        family: of the instrument; None for any.
        tilt_rad: of the beams, where distances are vertical and marks stand for what is none; None for numbers as they
            are.
        what: a record of bottom track, in words.
    """

    fields: np.dtype[Any]
    bottom: int
    water: int
    clock: Callable[[np.void], int | None]
    family: int | None
    tilt_rad: float | None
    what: str

    @property
    def beams(self) -> int:
        """Number of beams."""
        return int(self.fields["velocity"].shape[0])

    def row(self, position: int, fields: np.void) -> Row:
        """A ping of the bottom."""
        found = self._beams(fields)
        axes, known = _axes(fields["axes"], found.rest)
        of_fom = found.rest[len(fields["axes"]) :][:3]
        return Row(
            position=position,
            time_ns=self.clock(fields),
            velocity=found.velocity,
            valid=found.valid,
            range_m=found.range_m,
            sd=found.sd,
            instrument=axes,
            verdict=int(known),
            extra={
                "instrument_sd_mps": float(fields["axes_fom"][:3].max()) if all(of_fom) else NAN,
                "sound_speed_mps": float(fields["sound"]),
                **{f"beam{k + 1}_delay_s": float(one) for k, one in enumerate(fields["delay"])},
            },
        )

    def layer(self, position: int, fields: np.void) -> Row:
        """The layer of the water, as cell 1, at the mean range of the beams that have one; 0 where none has."""
        velocity, valid, range_m, sd, _ = self._beams(fields)
        along = np.array(range_m)
        known = np.isfinite(along)
        middle = np.where(known, along, 0.0).sum() / max(known.sum(), 1)
        cells = Cells(number=[1], range_m=[middle], velocity=[velocity], valid=[valid], sd=[sd])
        return Row(
            position=position, time_ns=self.clock(fields), velocity=[], valid=[], cells=cells, alone=True
        )

    def _beams(self, fields: np.void) -> _Beams:
        velocity, distance, fom = (
            fields[name].astype(np.float64) for name in ("velocity", "distance", "fom")
        )
        beams, axes, status = self.beams, len(fields["axes"]), int(fields["status"])
        flags = np.array([bool(status >> k & 1) for k in range(3 * beams + 2 * axes)])
        valid, ranged, sure = (flags[k * beams : (k + 1) * beams] for k in range(3))
        if self.tilt_rad is not None:
            velocity = np.where(velocity > NO_VELOCITY_MPS + 1e-3, velocity, NAN)
            valid, ranged = valid & np.isfinite(velocity), ranged & (distance > 0.0)
            distance, sure = distance / math.cos(self.tilt_rad), sure & (fom < NO_FOM_MPS)
        along, sd = np.where(ranged, distance, NAN), np.where(sure, fom, NAN)
        return _Beams(*(one.tolist() for one in (velocity, valid, along, sd, flags[3 * beams :])))


class TrackDecoder(Decoder):
    """Records of bottom and water track, whatever holds them."""

    frame = "instrument"
    layout: ClassVar[Layout]

    @np.errstate(invalid="ignore")
    def track(self, position: int, kind: int, fields: np.void) -> None:
        """Takes a record of one of the two kinds."""
        if kind == self.layout.water:
            self.rows.append(self.layout.layer(position, fields))
            return
        row, account = self.layout.row(position, fields), self.account
        if row.time_ns is None:
            account.skip("clock out of range", position)
            return
        if "error" in (self.layout.fields.names or ()):
            if error := int(fields["error"]):
                account.flag("instrument reports an error", position, f"code {error:#x}")
            if fields["beams"] not in {0, self.layout.beams}:
                account.flag("record states another number of beams", position, f"{fields['beams']} beams")
        self.rows.append(row)

    def ready(self) -> list[Row]:
        """As `Decoder.ready`; water without a time is none."""
        return [row for row in super().ready() if row.time_ns is not None]

    def finished(self) -> Recording:
        """The tables, with what is said of their signs and of the water; DataError where no record is a ping."""
        for row in self.rows:
            if row.alone:
                self.account.pass_by(name_of(self.layout.water), row.position)
        rows = [row for row in self.rows if row.time_ns is not None]
        found = self.tables(self.layout.what, self.layout.beams, rows)
        notes = [UNSURE, *_vertical_note(found.table)]
        if found.water is not None and not (found.water.range_m > 0.0).all():
            notes.append("water track without a distance is taken as that of the water at the instrument")
        return replace(found, notes=notes)


class RecordTracks(TrackDecoder, RecordDecoder):
    """The same of binary records; others are counted by their names."""

    framing = FRAMING

    def record(self, position: int, data: bytes) -> None:
        """Takes a record."""
        layout, kind, content = self.layout, data[2], body(data)
        is_ours = kind in {layout.bottom, layout.water} and layout.family in {None, data[3]}
        if is_ours and len(content) >= layout.fields.itemsize:
            self.track(position, kind, np.frombuffer(content, layout.fields, 1)[0])
        elif is_ours and kind == layout.bottom:
            self.account.skip("bottom track of another layout", position, f"{len(content)} bytes")
        else:
            self.account.pass_by(name_of(kind), position)


def _axes(axes: Any, good: list[bool]) -> tuple[list[float], bool]:  # noqa: ANN401 - an array of three or four
    """The instrument's velocity (3), and whether it is valid; of two vertical ones the mean, or the valid one."""
    found = axes.astype(np.float64).tolist()
    if len(found) == 3:
        return found, all(good[:3])
    x, y, z1, z2 = found
    known = good[0] and good[1] and (good[2] or good[3])
    vertical = 0.5 * (z1 + z2) if good[2] and good[3] else z1 if good[2] else z2
    return ([x, y, vertical] if known else [NAN] * 3), known


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


LAYOUT = Layout(
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
    lambda fields: struct_tm_ns(fields["clock"].tobytes(), int(fields["hundred_us"])),
    family=None,
    tilt_rad=TILT_RAD,
    what="bottom-track record (DF21, DF22)",
)  # fmt: skip


class _Decoder(RecordTracks):
    """Of a DVL500 or DVL1000."""

    layout = LAYOUT

    def recording(self) -> Recording:
        """The tables, as `Decoder.recording`."""
        found = self.finished()
        return replace(
            found,
            clock="the instrument's, UTC if it was set so",
            geometry="nortek_dvl1000",
            notes=[
                "distance is vertical: divided by the cosine of 25 deg to lie along the beam",
                "instrument z is the mean of z1 and z2 where both are valid",
                "time is that of the record; beam1_delay_s ... hold its DT1, trigger to centre of echo",
                *found.notes,
            ],
        )


FORMAT = Format(
    "nortek-dvl",
    "Nortek DVL500/1000, DF21 and DF22",
    lambda head: b"\xa5" in head and BOTTOM_DVL in kinds(head),
    _Decoder,
    figures=True,
)
