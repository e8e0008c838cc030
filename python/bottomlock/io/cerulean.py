"""Cerulean Tracker 650: `$DVKFC`, three cones A, B, C with velocity, range and confidences.

A positive velocity approaches the bottom (manufacturer's definition), as in our beam model. The sentence ends with a
fixed mark and a checksum whose rule is not published: the published example fits CRC-8 (0x31), other sentences of the
manufacturer the NMEA exclusive or. Either is accepted.
"""

import re

from bottomlock.io.beam_table import Account, Recording
from bottomlock.io.lines import lines_with
from bottomlock.io.rows import NAN, PLAIN, Options, Rows, raise_if_empty
from bottomlock.io.sentences import LONGEST_LINE, crc8_31, hexadecimal, number, whole, xor_of

NAME = "cerulean-dvkfc"
_BEAMS = 3
_LEAST_RANGE_CONFIDENCE = 25.0
_SENTENCE = re.compile(rb"\$(DV[A-Z]{2,4}(?:,[^*$]{0,600})?)\*([0-9A-Fa-f]{2})")
_FIELDS = 27
_VERSION, _END = b"24577", b"0x0055AAFF"


def sniff(head: bytes) -> bool:
    """Whether the beginning of a file looks like this format."""
    return b"$DVKFC," in head


def _read_fields(fields: list[bytes]) -> tuple[int, list[float]] | None:
    """Time (ns since start) and the eighteen numbers of the cones; None where the sentence is not as published."""
    marks = (fields[5], fields[12], fields[19]) if len(fields) == _FIELDS else ()
    if (
        marks != (b"[A]", b"[B]", b"[C]")
        or fields[1] != _VERSION
        or fields[26] != _END
        or whole(fields[2]) is None
    ):
        return None
    time_s = number(fields[4])
    numbers = [number(text) for start in (6, 13, 20) for text in fields[start : start + 6]]
    if time_s is None or not 0.0 <= time_s < 1e9 or None in numbers:
        return None
    return round(time_s * 1e9), [NAN if v is None else v for v in numbers]


def read(data: bytes, place: str, options: Options = PLAIN) -> Recording:
    """The cones of every `$DVKFC`.

    Raises:
        DataError: where there is none.
    """
    account = Account(unit="line")
    rows = Rows(_BEAMS, account)
    for position, line in lines_with(data, b"$", account, "not a sentence", LONGEST_LINE):
        account.read += 1
        if len(line) > LONGEST_LINE:
            account.skip("line too long", position, line)
            continue
        at = 0
        while match := _SENTENCE.search(line, at):
            account.read += at > 0
            at = match.end()
            text, given = match.group(1), hexadecimal(match.group(2))
            if given not in {xor_of(text), crc8_31(text)}:
                if not options.ignore_checksum:
                    account.skip("bad checksum", position, match.group())
                    continue
                account.flag("bad checksum, kept on request", position, match.group())
            fields = text.split(b",")
            if fields[0] != b"DVKFC":
                account.pass_by("$" + fields[0].decode("ascii"), position)
                continue
            found = _read_fields(fields)
            if found is None:
                account.skip("sentence with wrong fields or version", position, text)
                continue
            _add(rows, position, *found)
        if at == 0:
            account.skip("truncated", position, line)
        elif line[at:].strip():
            account.read += 1
            account.skip("truncated", position, line[at:])
    table = rows.finish(negate=options.negate_beams)
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


def _add(rows: Rows, position: int, time_ns: int, numbers: list[float]) -> None:
    """Per cone: gain, cycles, range, range confidence, velocity, velocity confidence."""
    cones = [numbers[6 * k : 6 * k + 6] for k in range(_BEAMS)]
    rows.add(
        position,
        time_ns,
        [cone[4] for cone in cones],
        [cone[3] >= _LEAST_RANGE_CONFIDENCE for cone in cones],
        range_m=[cone[2] if cone[2] > 0.0 else NAN for cone in cones],
        quality=[cone[5] for cone in cones],
        extra={f"beam{k + 1}_range_confidence": cone[3] for k, cone in enumerate(cones)},
    )
