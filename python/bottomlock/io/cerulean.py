"""Cerulean: `$DVKFC` of the Tracker 650, three cones A, B, C, and `$DVEXT` of the DVL-75, four channels A to D.

A positive velocity of a cone approaches the bottom (manufacturer's definition), as in our beam model. `$DVKFC` ends
with a fixed mark and a checksum whose rule is not published: the published example fits CRC-8 (0x31), other sentences
of the manufacturer the NMEA exclusive or. Either is accepted.

`$DVEXT` states no clock, but the time since the sentence before, and the sign of its channels nowhere.

Source: Cerulean Sonar, "$DVKFC Kalman Filter Raw Data Support Message" and "$DVEXT: DVL Extended Data".
"""

import math
from dataclasses import replace

from bottomlock.io.beam_table import Recording
from bottomlock.io.decoder import Format, Row, SentenceDecoder
from bottomlock.io.rows import NAN, UNSURE
from bottomlock.io.sentences import crc8_of, number, whole, xor_of

_BEAMS = 3
_LEAST_RANGE_CONFIDENCE = 25.0
_FIELDS = 27
_MARKS = {1: b"24577", 5: b"[A]", 12: b"[B]", 19: b"[C]", 26: b"0x0055AAFF"}
"""Version, the cones and the end, by field."""
_COUNT, _TIME = 2, 4
_CONES = [field for first in (6, 13, 20) for field in range(first, first + 6)]


def _numbers(fields: list[bytes]) -> list[float] | None:
    """Time (s since start) and the numbers of the cones; None where the sentence is not as published."""
    if len(fields) != _FIELDS or any(fields[k] != mark for k, mark in _MARKS.items()):
        return None
    found = [v for k in (_TIME, *_CONES) if (v := number(fields[k])) is not None]
    sound = len(found) == 1 + len(_CONES) and whole(fields[_COUNT]) is not None
    return found if sound and 0.0 <= found[0] < 1e9 else None


class _Decoder(SentenceDecoder):
    """The cones of every `$DVKFC`; per cone gain, cycles, range, range confidence, velocity, velocity confidence."""

    form = SentenceDecoder.pattern(rb"DV[A-Z]{2,4}", 600)
    wanted = (b"DVKFC",)

    def fits(self, text: bytes, given: int) -> bool:
        """Either of the two sums."""
        return given in {xor_of(text), crc8_of(text, 0x131)}

    def sentence(self, position: int, text: bytes) -> None:
        """Takes a `$DVKFC`."""
        numbers = _numbers(text.split(b","))
        if numbers is None:
            self.account.skip("sentence with wrong fields or version", position, text)
            return
        _, _, distance, sure, velocity, quality = (numbers[k::6] for k in range(1, 7))
        row = Row(
            position=position,
            time_ns=round(numbers[0] * 1e9),
            velocity=velocity,
            valid=[one >= _LEAST_RANGE_CONFIDENCE for one in sure],
            range_m=[one if one > 0.0 else NAN for one in distance],
            quality=quality,
            extra={f"beam{k + 1}_range_confidence": one for k, one in enumerate(sure)},
        )
        self.rows.append(row)

    def recording(self) -> Recording:
        """The table, as `Decoder.recording`."""
        return replace(
            self.tables("$DVKFC sentence", _BEAMS),
            clock="seconds since the instrument's start",
            quality="velocity confidence as recorded",
            notes=[
                "a cone has no flag: it counts as valid from a range confidence of 25 on, as the manufacturer advises",
                "the sentence has no velocity of the instrument's own",
            ],
        )


_CHANNELS, _MOST_INTERVAL_S = 4, 1000.0
_SECONDS, _LOCKS, _LAST = 14, slice(23, 27), 35


class _Dvl75(SentenceDecoder):
    """The channels of every `$DVEXT`."""

    # It passes on the sentences of a GPS.
    form = SentenceDecoder.pattern(rb"[A-Z]{4,6}", 600)
    wanted = (b"DVEXT",)
    frame = "ned"

    def __post_init__(self) -> None:
        """Begins."""
        super().__post_init__()
        self._sum_ns = 0

    def sentence(self, position: int, text: bytes) -> None:
        """Takes a `$DVEXT`; without the bottom its numbers may be anything."""
        fields = text.split(b",")
        flags = [fields[1], *fields[_LOCKS]]
        numbers = [v for one in (*fields[4:23], *fields[27:_LAST]) if (v := number(one)) is not None]
        if len(fields) != _LAST + 1 or len(numbers) < 27 or not set(flags) <= {b"T", b"F"}:
            self.account.skip("sentence with wrong fields", position, text)
            return
        roll, pitch, heading, _, up, altitude, north, east, _, _, interval_s = numbers[:11]
        if not 0.0 <= interval_s < _MOST_INTERVAL_S:
            self.account.skip("no interval since the last sentence", position, text)
            return
        self._sum_ns += round(interval_s * 1e9)
        locked, *locks = (flag == b"T" for flag in flags)
        row = Row(
            position=position,
            time_ns=self._sum_ns,
            velocity=numbers[19:23],
            valid=[locked and one for one in locks],
            range_m=[one if one > 0.0 else NAN for one in numbers[23:]],
            instrument=[north, east, -up],
            verdict=int(locked),
            extra={
                "altitude_m": altitude if locked and altitude > 0.0 else NAN,
                "heading_rad": math.radians(heading),
                "pitch_rad": math.radians(pitch),
                "roll_rad": math.radians(roll),
            },
        )
        self.rows.append(row)

    def recording(self) -> Recording:
        """The table, as `Decoder.recording`."""
        return replace(
            self.tables("$DVEXT sentence", _CHANNELS),
            clock="sum of intervals",
            resolution_mps=1e-4,
            notes=[
                "velocity up of the instrument negated to one down",
                "the sentences carry no clock: time is the sum of their intervals, and starts at zero",
                "the instrument's own velocity is north, east, down by its own attitude",
                UNSURE,
            ],
        )


FORMAT = Format("cerulean-dvkfc", "Cerulean Tracker 650 $DVKFC", lambda head: b"$DVKFC," in head, _Decoder)
DVL75 = Format("cerulean-dvext", "Cerulean DVL-75 $DVEXT", lambda head: b"$DVEXT," in head, _Dvl75)
