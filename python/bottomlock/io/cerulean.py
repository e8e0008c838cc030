"""Cerulean Tracker 650: `$DVKFC`, three cones A, B, C with velocity, range and confidences.

A positive velocity approaches the bottom (manufacturer's definition), as in our beam model. The sentence ends with a
fixed mark and a checksum whose rule is not published: the published example fits CRC-8 (0x31), other sentences of the
manufacturer the NMEA exclusive or. Either is accepted.
"""

import numpy as np

from bottomlock.io.beam_table import Account, BeamTable, Flags, Floats, Integers, Recording
from bottomlock.io.dollar_sentences import Names, Remarks, Sentences, sentences
from bottomlock.io.framing import Lines, Stream
from bottomlock.io.lines import Bytes, running_crc8, running_xor
from bottomlock.io.rows import NAN, PLAIN, Options, make_table, raise_if_empty

NAME = "cerulean-dvkfc"
STREAM = Stream(lambda _: Lines())
_BEAMS = 3
_LEAST_RANGE_CONFIDENCE = 25.0
_NAMES = Names(b"DV", letters=(2, 4), digits=0, longest=600)
_FIELDS = 26
_MARKS = {0: b"24577", 4: b"[A]", 11: b"[B]", 18: b"[C]", 25: b"0x0055AAFF"}
"""Version, the cones and the end, by field."""
_COUNT, _TIME = 1, 3
_CONES = [field for first in (5, 12, 19) for field in range(first, first + 6)]


def sniff(head: bytes) -> bool:
    """Whether the beginning of a file looks like this format."""
    return b"$DVKFC," in head


def _fits(raw: Bytes, start: Integers, star: Integers, given: Integers) -> Flags:
    """Either of the two sums."""
    sums = (running_xor(raw)(start, star), running_crc8(raw, 0x131)(start, star))
    return np.asarray((sums[0] == given) | (sums[1] == given))


def _pings(found: Sentences, remarks: Remarks) -> tuple[Integers, Integers, Floats]:
    """Position, time (ns since start) and the numbers of the cones (n, 18); what is not as published is counted."""
    good, fields = found.fields(_FIELDS)
    use = np.ones(len(fields.begin), dtype=bool)
    for column, word in _MARKS.items():
        use &= fields.is_text(column, word)
    use &= np.array([count is not None for count in fields.wholes(_COUNT)], dtype=bool)
    values, known = fields.numbers([_TIME, *_CONES])
    with np.errstate(invalid="ignore"):
        use &= known.all(axis=1) & (values[:, 0] >= 0.0) & (values[:, 0] < 1e9)
    good[good] = use
    remarks.skip("sentence with wrong fields or version", ~good, found.position, found.start, found.text)
    return found.position[good], np.rint(values[use, 0] * 1e9).astype(np.int64), values[use, 1:]


def read(data: bytes, place: str, options: Options = PLAIN) -> Recording:
    """The cones of every `$DVKFC`.

    Raises:
        DataError: where there is none.
    """
    account = Account(unit="line")
    parts = []
    for found, remarks in sentences(data, _NAMES, (b"DVKFC",), _fits, account, trust=options.ignore_checksum):
        parts.append(_pings(found, remarks))
        remarks.tell()
    table = _table(parts, account, negate=options.negate_beams)
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


def _table(parts: list[tuple[Integers, Integers, Floats]], account: Account, *, negate: bool) -> BeamTable:
    """Per cone: gain, cycles, range, range confidence, velocity, velocity confidence."""
    nothing = np.empty(0, dtype=np.int64)
    position, time_ns = (np.concatenate([nothing, *(part[k] for part in parts)]) for k in (0, 1))
    cones = np.concatenate([np.empty((0, len(_CONES))), *(part[2] for part in parts)])
    _, _, distance, sure, velocity, quality = np.moveaxis(cones.reshape(-1, _BEAMS, 6), 2, 0)
    return make_table(
        account,
        _BEAMS,
        position,
        time_ns,
        velocity,
        sure >= _LEAST_RANGE_CONFIDENCE,
        range_m=np.where(distance > 0.0, distance, NAN),
        quality=quality,
        extra={f"beam{k + 1}_range_confidence": sure[:, k] for k in range(_BEAMS)},
        negate=negate,
    )
