"""Nortek Nucleus1000 as the manufacturer's Python driver logs its packets: `nucleus_log.csv`, a row a packet.

Columns and flags are those of the binary records (`nucleus`); a row of another packet leaves them empty.

Source: NortekSupport/nucleus_driver, src/nucleus_driver/_logger.py and _parser.py.
"""

from dataclasses import replace

from bottomlock.errors import DataError
from bottomlock.io.beam_table import Recording
from bottomlock.io.decoder import Format, LineDecoder, Row, water_of
from bottomlock.io.nortek_dvl import UNSURE, no_layer_note, vertical_note
from bottomlock.io.nortek_frames import BOTTOM_NUCLEUS, WATER_NUCLEUS, name_of
from bottomlock.io.rows import NAN
from bottomlock.io.sentences import number, whole

_BEAMS = (1, 2, 3)
_FLAGS = (
    *(f"status.beam{k}{what}Valid" for what in ("Velocity", "Distance", "Fom") for k in _BEAMS),
    *(f"status.{axis}{what}Valid" for what in ("Velocity", "Fom") for axis in "xyz"),
)
_NUMBERS = (
    *(f"{what}Beam{k}" for what in ("velocity", "distance", "fom", "dt") for k in _BEAMS),
    *(f"{what}{axis}" for what in ("velocity", "fom") for axis in "XYZ"),
    "soundSpeed",
)
_OF_TIME = ("timeStamp", "microSeconds", "flags.posixTime")
_SAID = {b"True": True, b"False": False, b"1": True, b"0": False}


class _Decoder(LineDecoder):
    """A header, and a row a packet."""

    frame = "instrument"
    longest = 1 << 24

    def __post_init__(self) -> None:
        """Begins."""
        super().__post_init__()
        self._at: dict[str, int] = {}
        self._width = 0
        self._posix = False
        self._water: list[Row] = []

    def line(self, position: int, line: bytes) -> None:
        """Takes the header or a row.

        Raises:
            DataError: where the header lacks a column.
        """
        fields = line.split(b",")
        if not self._at:
            self._header(fields)
            return
        account = self.account
        account.read += 1
        kind = whole(fields[self._at["id"]]) if len(fields) > self._at["id"] else None
        if kind is not None and kind not in {BOTTOM_NUCLEUS, WATER_NUCLEUS}:
            account.pass_by(name_of(kind), position)
        elif len(fields) != self._width:
            account.skip("truncated" if len(fields) < self._width else "merged line", position, line)
        elif kind is None or (row := self._row(position, fields)) is None:
            account.skip("a field that is no number", position, line)
        else:
            (self.rows if kind == BOTTOM_NUCLEUS else self._water).append(row)

    def _header(self, fields: list[bytes]) -> None:
        self._width = len(fields)
        self._at = {name.strip().decode("utf-8", "replace"): k for k, name in enumerate(fields)}
        for name in ("id", *_OF_TIME, *_FLAGS, *_NUMBERS):
            if name not in self._at:
                raise DataError(
                    "is missing",
                    place=self.place,
                    key=f"column '{name}'",
                    expected="a log of Nortek's driver",
                )

    def _row(self, position: int, fields: list[bytes]) -> Row | None:
        def of(name: str) -> bytes:
            return fields[self._at[name]].strip()

        seconds, micros, posix = (
            whole(of("timeStamp")),
            whole(of("microSeconds")),
            _SAID.get(of("flags.posixTime")),
        )
        good = [one for name in _FLAGS if (one := _SAID.get(of(name))) is not None]
        values = [v for name in _NUMBERS if (v := number(of(name))) is not None]
        if seconds is None or micros is None or not 0 <= micros <= 999_999 or posix is None:
            return None
        if len(good) < len(_FLAGS) or len(values) < len(_NUMBERS):
            return None
        self._posix |= posix
        distance, fom = ([one if ok else NAN for one, ok in zip(values[k : k + 3], good[k : k + 3], strict=True)]
                         for k in (3, 6))  # fmt: skip
        known = [one for one in distance if one == one]  # noqa: PLR0124 - NaN where there is none
        return Row(
            position=position,
            time_ns=(seconds * 1_000_000 + micros) * 1000,
            velocity=values[:3],
            valid=good[:3],
            range_m=distance,
            sd=fom,
            instrument=values[12:15],
            verdict=int(all(good[9:12])),
            extra={
                "instrument_sd_mps": max(values[15:18]) if all(good[12:15]) else NAN,
                "sound_speed_mps": values[18],
                **{f"beam{k}_delay_s": value for k, value in zip(_BEAMS, values[9:12], strict=True)},
            },
            water_m=sum(known) / max(len(known), 1) if whole(of("id")) == WATER_NUCLEUS else None,
        )

    def recording(self) -> Recording:
        """The table, as `Decoder.recording`."""
        found = self.tables("bottom-track row of a Nucleus", len(_BEAMS))
        water = water_of(self._water, len(_BEAMS), self.account, negate=self.options.negate_beams)
        return replace(
            found,
            clock="the instrument's, since 1970" if self._posix else "since the instrument's start",
            notes=[
                "time is that of the record; beam1_delay_s ... hold the offsets that it states",
                "distance is kept as recorded",
                UNSURE,
                *vertical_note(found.table),
                *no_layer_note(water),
            ],
            water=water,
        )


def _sniff(head: bytes) -> bool:
    first = head.split(b"\n", 1)[0]
    return b"velocityBeam1," in first and b"status.beam1VelocityValid," in first


FORMAT = Format(
    "nucleus-csv", "Nortek Nucleus1000, CSV of its driver", _sniff, _Decoder, live=False, figures=True
)
