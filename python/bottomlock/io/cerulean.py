"""Cerulean Tracker 650: `$DVKFC`, three cones A, B, C with velocity, range and confidences.

A positive velocity approaches the bottom (manufacturer's definition), as in our beam model. The sentence ends with a
fixed mark and a checksum whose rule is not published: the published example fits CRC-8 (0x31), other sentences of the
manufacturer the NMEA exclusive or. Either is accepted.
"""

import numpy as np

from bottomlock.io.beam_table import Account, BeamTable, Recording
from bottomlock.io.dollar_sentences import pattern, sentences
from bottomlock.io.framing import Lines, Stream
from bottomlock.io.rows import NAN, PLAIN, Options, make_table, raise_if_empty
from bottomlock.io.sentences import crc8_of, number, whole, xor_of

NAME = "cerulean-dvkfc"
STREAM = Stream(lambda _: Lines())
_BEAMS = 3
_LEAST_RANGE_CONFIDENCE = 25.0
_FORM = pattern(rb"DV[A-Z]{2,4}", 600)
_FIELDS = 27
_MARKS = {1: b"24577", 5: b"[A]", 12: b"[B]", 19: b"[C]", 26: b"0x0055AAFF"}
"""Version, the cones and the end, by field."""
_COUNT, _TIME = 2, 4
_CONES = [field for first in (6, 13, 20) for field in range(first, first + 6)]


def sniff(head: bytes) -> bool:
    """Whether the beginning of a file looks like this format."""
    return b"$DVKFC," in head


def _fits(text: bytes, given: int) -> bool:
    """Either of the two sums."""
    return given in {xor_of(text), crc8_of(text, 0x131)}


def _numbers(fields: list[bytes]) -> list[float] | None:
    """Time (s since start) and the numbers of the cones; None where the sentence is not as published."""
    if len(fields) != _FIELDS or any(fields[k] != mark for k, mark in _MARKS.items()):
        return None
    found = [v for k in (_TIME, *_CONES) if (v := number(fields[k])) is not None]
    sound = len(found) == 1 + len(_CONES) and whole(fields[_COUNT]) is not None
    return found if sound and 0.0 <= found[0] < 1e9 else None


def read(data: bytes, place: str, options: Options = PLAIN) -> Recording:
    """The cones of every `$DVKFC`.

    Raises:
        DataError: where there is none.
    """
    account = Account(unit="line")
    position, found = [], []
    for line, text in sentences(data, _FORM, (b"DVKFC",), _fits, account, trust=options.ignore_checksum):
        numbers = _numbers(text.split(b","))
        if numbers is None:
            account.skip("sentence with wrong fields or version", line, text)
        else:
            position.append(line)
            found.append(numbers)
    table = _table(position, found, account, negate=options.negate_beams)
    raise_if_empty(account, place, "$DVKFC sentence")
    return Recording(
        format=NAME,
        table=table,
        account=account,
        frame="none",
        clock="seconds since the instrument's start",
        time_of="record",
        quality="velocity confidence as recorded",
        notes=[
            "a cone has no flag: it counts as valid from a range confidence of 25 on, as the manufacturer advises",
            "the sentence has no velocity of the instrument's own",
        ],
    )


def _table(position: list[int], found: list[list[float]], account: Account, *, negate: bool) -> BeamTable:
    """Per cone: gain, cycles, range, range confidence, velocity, velocity confidence."""
    values = np.array(found).reshape(-1, 1 + len(_CONES))
    cones = values[:, 1:].reshape(-1, _BEAMS, 6)
    _, _, distance, sure, velocity, quality = np.moveaxis(cones, 2, 0)
    return make_table(
        account,
        _BEAMS,
        position,
        np.rint(values[:, 0] * 1e9).astype(np.int64),
        velocity,
        sure >= _LEAST_RANGE_CONFIDENCE,
        range_m=np.where(distance > 0.0, distance, NAN),
        quality=quality,
        extra={f"beam{k + 1}_range_confidence": sure[:, k] for k in range(_BEAMS)},
        negate=negate,
    )
