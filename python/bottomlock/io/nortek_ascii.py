"""Nortek DVLs in text: `$PNORBT0` (DF351, plain) and `$PNORBT1` (DF350, tagged), a line a beam.

BV is the beam's velocity (-32.768 invalid), FOM its figure of merit (10 invalid), DIST the vertical distance (0
invalid), DT1 the milliseconds from the trigger to the echo's centre.

`$PNORBT6` to `$PNORBT9` (DF356 to DF359, the even ones tagged) hold the velocity along the instrument's axes and the
distances of four beams, whose velocities they do not have.

Source: Nortek, DVL manual; fields of `$PNORBT6` to `$PNORBT9` as in Knio/pynmea2, types/proprietary/nor.py.
"""

import datetime as dt
import math
from dataclasses import replace

from bottomlock.errors import DataError
from bottomlock.io.beam_table import Recording
from bottomlock.io.decoder import Format, Row, SentenceDecoder
from bottomlock.io.rows import NAN, UNSURE
from bottomlock.io.sentences import number, whole

MOST_BEAMS = 4
NO_VELOCITY_MPS, NO_FOM_MPS = -32.768, 10.0
TILT_RAD = math.radians(25.0)
"""Tilt of Nortek's DVL500 and DVL1000, to turn a vertical distance into one along the beam."""
_TAGS = (b"BEAM", b"DATE", b"TIME", b"DT1", b"DT2", b"BV", b"FOM", b"DIST", b"STAT")
_BEAM, _DATE, _TIME, _DT1, _BV, _FOM, _DIST = 0, 1, 2, 3, 5, 6, 7
_AXES_TAGS = (b"TIME", b"DT1", b"DT2", b"VX", b"VY", b"VZ", b"FOM", b"D1", b"D2", b"D3", b"D4")
_OF_AXES = (b"PNORBT6", b"PNORBT7", b"PNORBT8", b"PNORBT9")
_EPOCH = dt.datetime(1970, 1, 1)  # noqa: DTZ001 - as the times, without a zone


def _untagged(fields: list[bytes], tags: tuple[bytes, ...]) -> list[bytes] | None:
    """Values in the order of the tags, from either form; None where one is missing or out of place."""
    if len(fields) != len(tags) or b"=" not in fields[0]:
        return fields if len(fields) == len(tags) else None
    values = []
    for tag, text in zip(tags, fields, strict=True):
        name, equals, value = text.partition(b"=")
        if not equals or name != tag:
            return None
        values.append(value)
    return values


def _time_ns(date: bytes, time: bytes) -> int | None:
    """MMDDYY and hhmmss.ssss as nanoseconds since 1970."""
    day, second = whole(date), number(time[4:])
    if len(date) != 6 or day is None or not time[:6].isdigit() or second is None or not 0.0 <= second < 61.0:
        return None
    month, rest = divmod(day, 10_000)
    try:
        minute = dt.datetime(2000 + rest % 100, month, rest // 100, int(time[:2]), int(time[2:4]))  # noqa: DTZ001
    except ValueError:
        return None
    return (minute - _EPOCH) // dt.timedelta(minutes=1) * 60_000_000_000 + round(second * 1e9)


def _numbers(fields: list[bytes]) -> tuple[int, int, list[float]] | None:
    """Time (ns since 1970), beam from 1, and velocity, figure of merit, vertical distance and DT1 (ms) of a line.

    None where its fields are not what they should be.
    """
    values = _untagged(fields, _TAGS)
    if values is None:
        return None
    time_ns, beam = _time_ns(values[_DATE], values[_TIME]), whole(values[_BEAM])
    numbers = [v for k in (_BV, _FOM, _DIST, _DT1) if (v := number(values[k])) is not None]
    if time_ns is None or beam is None or not 1 <= beam <= MOST_BEAMS or len(numbers) < 4:
        return None
    return time_ns, beam, numbers


def _axes(position: int, fields: list[bytes]) -> Row | None:
    """The velocity of a `$PNORBT6` to `$PNORBT9`; None where its fields are not what they should be."""
    values = _untagged(fields[: len(_AXES_TAGS)], _AXES_TAGS)
    numbers = [v for text in values or () if (v := number(text)) is not None]
    seconds, _, part = (values or [b""])[0].partition(b".")
    if len(numbers) < len(_AXES_TAGS) or not seconds.isdigit() or not (part or b"0").isdigit():
        return None
    *axes, fom, d1, d2, d3, d4 = numbers[3:]
    known = all(one > NO_VELOCITY_MPS + 1e-3 for one in axes) and fom < NO_FOM_MPS
    distances = [one for one in (d1, d2, d3, d4) if one > 0.0]
    return Row(
        position=position,
        time_ns=int(seconds) * 1_000_000_000 + int(part[:9].ljust(9, b"0")),
        velocity=[],
        valid=[],
        instrument=axes if known else [NAN] * 3,
        verdict=int(known),
        extra={
            "altitude_m": sum(distances) / len(distances) if distances else NAN,
            "instrument_sd_mps": fom if known else NAN,
        },
    )


class _Decoder(SentenceDecoder):
    """Beam lines, gathered to pings: one begins with another time, or with a beam that is there already."""

    form = SentenceDecoder.pattern(rb"PNOR[A-Z]{0,3}[0-9]{0,2}", 400)
    wanted = (b"PNORBT0", b"PNORBT1", *_OF_AXES)
    _open: Row | None = None

    def __post_init__(self) -> None:
        """Begins."""
        super().__post_init__()
        self._axes: list[Row] = []

    @property
    def waiting(self) -> bool:
        """Whether lines of a ping are held."""
        return self._open is not None

    def sentence(self, position: int, text: bytes) -> None:
        """Takes a line of a beam, or a velocity, which is a row where it is asked for alone."""
        name, *fields = text.split(b",")
        if name in _OF_AXES:
            row = _axes(position, fields) if self.options.instrument_only else None
            if row is not None:
                self._axes.append(row)
            elif self.options.instrument_only:
                self.account.skip("velocity with wrong fields", position, text)
            else:
                self.account.pass_by("velocity without beams", position)
            return
        found = _numbers(fields)
        if found is None:
            self.account.skip("beam line with wrong fields", position, text)
            return
        time_ns, beam, numbers = found
        if self._open is not None and (time_ns != self._open.time_ns or beam in self._open.there):
            self.flush()
        if self._open is None:
            velocity, range_m, sd = ([NAN] * MOST_BEAMS for _ in range(3))
            delays = {f"beam{k + 1}_delay_s": NAN for k in range(MOST_BEAMS)}
            self._open = Row(
                position=position,
                time_ns=time_ns,
                velocity=velocity,
                valid=[False] * MOST_BEAMS,
                range_m=range_m,
                sd=sd,
                extra=delays,
            )
        self._add(self._open, beam, *numbers)
        if len(self._open.there) == self.beams:
            self.flush()

    def _add(self, ping: Row, beam: int, velocity: float, fom: float, distance: float, dt1_ms: float) -> None:
        """Adds a beam, from 1; what the manual says of invalid values becomes none."""
        known, k = velocity > NO_VELOCITY_MPS + 1e-3, beam - 1
        ping.there |= {beam}
        ping.velocity[k] = velocity if known else NAN
        ping.valid[k] = known and fom < NO_FOM_MPS
        ping.range_m[k] = distance / math.cos(TILT_RAD) if distance > 0.0 else NAN
        ping.sd[k] = fom if fom < NO_FOM_MPS else NAN
        ping.extra[f"beam{beam}_delay_s"] = dt1_ms * 1e-3

    def flush(self) -> None:
        """Ends the ping of which lines have come."""
        if self._open is not None:
            self.rows.append(self._open)
        self._open = None

    def reset(self) -> None:
        """Forgets lines of a ping and a line that has begun."""
        self._open = None
        super().reset()

    def recording(self) -> Recording:
        """The table, as `Decoder.recording`."""
        self.flush()
        if self._axes and not self.rows:
            return replace(
                self.tables("velocity $PNORBT6 to $PNORBT9", 0, self._axes),
                frame="instrument",
                clock="the instrument's, seconds since 1970 if it was set so",
                notes=["no beam velocities: the table holds the instrument's velocity alone"],
            )
        for row in self._axes:
            self.account.pass_by("velocity without beams", row.position)
        beams = max((row.beams for row in self.rows), default=0)
        if not self.rows and "velocity without beams" in self.account.other:
            raise DataError(
                "its sentences hold velocities along the instrument's axes and no beams",
                place=self.place,
                expected="beam lines $PNORBT0 or $PNORBT1",
                hint="set DF350 or DF351, or DF21 in binary, or convert the velocities with --instrument-only",
            )
        for row in self.rows:
            if len(row.there) < beams:
                self.account.flag("beam line missing", row.position)
        return replace(
            self.tables("beam line $PNORBT0 or $PNORBT1", beams),
            clock="the instrument's, UTC if it was set so",
            geometry="nortek_dvl1000" if beams == MOST_BEAMS else "",
            resolution_mps=1e-5,
            notes=[
                "distance is vertical: divided by the cosine of 25 deg to lie along the beam",
                "the sentence carries no velocity of the instrument's own",
                "time is that of the sentence; beam1_delay_s ... hold its DT1, trigger to centre of echo",
                UNSURE,
            ],
        )


FORMAT = Format(
    "nortek-ascii", "Nortek $PNORBT0, $PNORBT1", lambda head: b"$PNORBT" in head, _Decoder, figures=True
)
