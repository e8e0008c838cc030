"""Sentences of Water Linked's serial protocol, of a whole file: found, checked and read.

A sentence is `wr` and a letter, fields after commas, `*` and the CRC-8 of all before it in two hexadecimal digits.
"""

from dataclasses import dataclass

import numpy as np

from bottomlock.io.beam_table import Account, Flags, Floats, Integers
from bottomlock.io.lines import Lines, batches, fields_between, hexadecimal_at, numbers, running_crc8, wholes
from bottomlock.io.sentences import LONGEST_LINE

LOST, VELOCITY, VELOCITY_ALONE, REFUSED, TRANSDUCER, WATER = range(6)
"""Kinds of events: one that is as good as lost, a `wrz`, a `wrx`, either with wrong fields, a `wru`, a `wrs`."""
_WATER_FIELDS = 11
_OLD_STATUS = ord("S")
"""Stands for the `s` of a `wrs` that has another number of fields than a velocity through the water."""
_MOST_FIELDS, _LONGEST_FIELD = 16, 200
_LETTER = np.isin(np.arange(256), list(b"abcdefghijklmnopqrstuvwxyz!?"))
_AFTER = np.isin(np.arange(256), list(b",*"))
_KINDS = {
    b"wrt": "wrt (distances alone, deprecated)",
    b"wrp": "wrp (dead reckoning)",
    b"wrS": "wrs (no velocity through the water)",
}
_DIGITS = bytes.maketrans(b"123456789", b"0" * 9)


@dataclass(frozen=True, eq=False)
class Events:
    """The sentences of a file that open, fill or close a ping, in their order, (n,) each.

    Attributes:
        position: line.
        kind: one of the kinds above.
        flag: number of a transducer; 1 and 0 as a velocity is flagged; else -1.
        numbers: (n, 6) of a velocity: x, y, z, altitude (NaN of a `wrs`), figure of merit, interval; of a transducer:
            four of them.
        framed: a logger wrote something around the sentence.
        lost: (n + 1,) lines and sentences that cannot be read, before each and after the last.
        frame: (n, 4) places in the file between which that stands, before and after.
        validity_us: of each velocity, in their order.
    """

    position: Integers
    kind: Integers
    flag: Integers
    numbers: Floats
    framed: Flags
    lost: Integers
    frame: Integers
    validity_us: list[int | None]

    def same_frame(self, data: bytes, k: int, other: int) -> bool:
        """Whether what stands around two sentences has the same form."""
        # Of two on a line, the first has the second around it.
        if self.position[k] == self.position[other]:
            return False
        (a, b, c, d), (e, f, g, h) = self.frame[k].tolist(), self.frame[other].tolist()
        return _shape(data[a:b]) == _shape(data[e:f]) and _shape(data[c:d]) == _shape(data[g:h])


def _shape(around: bytes) -> bytes:
    """What stands beside a sentence, without its digits: a logger's time stamp changes, its form does not."""
    text = around.strip().translate(_DIGITS)
    while b"00" in text:
        text = text.replace(b"00", b"0")
    return text


@dataclass(frozen=True, eq=False)
class _Sentences:
    """Places of possible sentences, (m,) each: begin, asterisk, line; whether the CRC fits; where the next `wr` is."""

    start: Integers
    star: Integers
    line: Integers
    good: Flags
    inner: Integers

    def where(self, chosen: Flags) -> "_Sentences":
        """The chosen ones."""
        return _Sentences(
            self.start[chosen], self.star[chosen], self.line[chosen], self.good[chosen], self.inner[chosen]
        )


def _possible(lines: Lines, marks: Integers, of: Integers) -> _Sentences:
    """Every place from which a sentence goes to the next asterisk, its CRC perhaps wrong.

    Args:
        lines: of a batch.
        marks: every place of `wr` in them.
        of: the line of each.
    """
    raw, stars = lines.raw, lines.places(b"*")
    chosen = marks + 3 < len(raw)
    chosen[chosen] = _LETTER[raw[marks[chosen] + 2]] & _AFTER[raw[marks[chosen] + 3]]
    begin, line = marks[chosen], of[chosen]
    index = np.searchsorted(stars, begin)
    within = index < len(stars)
    begin, star, line = begin[within], stars[index[within]], line[within]
    within = star + 3 <= lines.end[line]
    begin, star, line = begin[within], star[within], line[within]
    # The bounds of all fields but the name; a field reaches from one to the next.
    bounds = np.flatnonzero(_AFTER[raw])
    first, last = np.searchsorted(bounds, begin), np.searchsorted(bounds, star)
    long = np.concatenate(([0], np.cumsum(np.diff(bounds) > _LONGEST_FIELD + 1)))
    given = hexadecimal_at(raw, star + 1)
    fits = (last - first <= _MOST_FIELDS) & (long[last] == long[first]) & (given >= 0)
    begin, star, line, given = begin[fits], star[fits], line[fits], given[fits]
    following = np.append(marks, len(raw))[np.searchsorted(marks, begin, side="right")]
    good = running_crc8(raw, 0x107)(begin, star) == given if len(begin) else given > 0
    return _Sentences(begin, star, line, good, np.where(following + 2 <= star, following, -1))


def _taken(found: _Sentences) -> _Sentences:
    """What a reader takes in turn: of those that end alike the ones up to the first whose CRC fits."""
    if not len(found.start):
        return found
    good_before: Integers = np.cumsum(found.good) - found.good
    begins = np.append(True, found.star[1:] != found.star[:-1])
    first = np.maximum.accumulate(np.where(begins, np.arange(len(begins)), 0))
    return found.where(good_before == good_before[first])


def _leftover(lines: Lines, found: _Sentences, after: Integers, of: Integers, account: Account) -> Flags:
    """Counts lines without a sentence, and what stands behind the last of a line; (n,) the lines without."""
    none = np.ones(len(lines.start), dtype=bool)
    none[found.line] = False
    behind = lines.end.copy()
    behind[found.line] = after  # the last of a line stands
    tail = lines.solid_from(behind)
    begun = np.zeros(len(none), dtype=bool)
    begun[of] = True
    whole = lines.piece(lines.start, lines.end)
    account.skip_where("truncated", none & begun, lines.number, whole)
    account.skip_where("not a sentence", none & ~begun, lines.number, whole)
    account.skip_where("truncated", tail, lines.number, lines.piece(behind, lines.end))
    account.read += int(np.count_nonzero(none) + np.count_nonzero(tail))
    return none


def _account(lines: Lines, found: _Sentences, accepted: Flags, account: Account) -> None:
    """Counts sentences that are damaged."""
    at, good = lines.number[found.line], found.good
    merged = ~good & (found.inner >= 0)
    account.skip_where("merged line", merged, at, lines.piece(lines.start[found.line], lines.end[found.line]))
    account.skip_where("bad checksum", ~accepted & ~merged, at, lines.piece(found.start, found.star + 3))
    text = lines.piece(found.start, found.star)
    account.flag_where("bad checksum, kept on request", accepted & ~good, at, text)


def _values(words: bytes, values: list[int]) -> Integers:
    """(256,) what a byte stands for; -1 for nothing."""
    found = np.full(256, -1)
    found[list(words)] = values
    return found


_FLAGS = dict.fromkeys((VELOCITY, VELOCITY_ALONE, WATER), _values(b"yn", [1, 0])) | {
    TRANSDUCER: _values(b"0123", [0, 1, 2, 3])
}
_LAYOUTS = {
    ord("z"): (VELOCITY, 12, [1, 2, 3, 5, 6, 10], 4),
    ord("s"): (WATER, _WATER_FIELDS, [1, 2, 3, 5, 5, 9], 4),
    ord("x"): (VELOCITY_ALONE, 9, [2, 3, 4, 6, 5, 1], 7),
    ord("u"): (TRANSDUCER, 6, [2, 3, 4, 5], 1),
}
"""By letter: kind, fields, those that are numbers, the one that is a flag or the transducer's number."""
_VALIDITY = {VELOCITY: 8, WATER: 7}
"""By kind: the field with the time of validity."""
_OTHER = ~np.isin(np.arange(256), list(_LAYOUTS))


def _read(
    lines: Lines, found: _Sentences, letter: Integers, commas: Integers, account: Account
) -> tuple[Integers, Integers, Floats, list[int | None]]:
    """Kinds, flags and numbers of sentences, and the times of validity of the velocities, as in `Events`."""
    raw, n = lines.raw, len(letter)
    kind, flag, values = np.full(n, LOST), np.full(n, -1), np.full((n, 6), np.nan)
    validity: list[int | None] = [None] * n
    parts: list[tuple[int, Integers, Integers, Integers, Integers, list[int], int]] = []
    for mark, (sort, count, columns, flagged) in _LAYOUTS.items():
        mine = np.flatnonzero(letter == mark)
        if not len(mine):
            continue
        fields, bounds = fields_between(commas, found.start[mine], found.star[mine], count)
        parts.append((sort, mine, mine[fields == count], bounds[:, :-1] + 1, bounds[:, 1:], columns, flagged))
    if not parts:
        return kind, flag, values, validity
    begins = np.concatenate([begin[:, columns].ravel() for _, _, _, begin, _, columns, _ in parts])
    ends = np.concatenate([end[:, columns].ravel() for _, _, _, _, end, columns, _ in parts])
    every, known = numbers(raw, begins, ends)
    at = 0
    for sort, mine, of, begin, end, columns, flagged in parts:
        size = (len(of), len(columns))
        here = slice(at, at := at + size[0] * size[1])
        word, single = raw[begin[:, flagged]], end[:, flagged] - begin[:, flagged] == 1
        flag[of] = _FLAGS[sort][word]
        good = of[single & (flag[of] >= 0) & known[here].reshape(size).all(axis=1)]
        values[of, : size[1]] = every[here].reshape(size)
        bad = np.zeros(n, dtype=bool)
        bad[mine], bad[good] = True, False
        what = "transducer" if sort == TRANSDUCER else "velocity"
        account.skip_where(
            f"{what} report with wrong fields",
            bad,
            lines.number[found.line],
            lines.piece(found.start, found.star),
        )
        kind[bad] = LOST if sort == TRANSDUCER else REFUSED
        kind[good] = sort
        if sort == WATER:
            values[of, 3] = np.nan
        if sort in _VALIDITY:
            field = _VALIDITY[sort]
            for k, time_us in zip(of.tolist(), wholes(lines, begin[:, field], end[:, field]), strict=True):
                validity[k] = time_us
    return kind, flag, values, validity


def _pass_by(letter: Integers, position: Integers, account: Account, *, trust: bool) -> Flags:
    """Counts sentences of other kinds; (n,) those that are no events."""
    other = (letter > 0) & _OTHER[letter]
    quiet = other.copy()
    if not other.any():
        return quiet
    for one in np.flatnonzero(np.bincount(letter[other])).tolist():
        name = b"wr" + bytes([one])
        account.pass_by_where(_KINDS.get(name, name.decode("ascii")), letter == one, position)
        # A kept sentence with a wrong checksum may have been a velocity report.
        if trust and name not in _KINDS:
            quiet[letter == one] = False
    return quiet


def _batch(lines: Lines, account: Account, *, trust: bool) -> Events:
    """The events of a batch."""
    raw = lines.raw
    too_long = lines.end - lines.start > LONGEST_LINE
    account.skip_where("line too long", too_long, lines.number, lines.piece(lines.start, lines.end))
    dropped, lines = lines.where(too_long), lines.where(~too_long)
    marks = np.flatnonzero((raw[:-1] == ord("w")) & (raw[1:] == ord("r")))
    of = lines.of(marks)
    inside = of >= 0
    inside[inside] = marks[inside] + 2 <= lines.end[of[inside]]
    marks, of = marks[inside], of[inside]
    commas = lines.places(b",")
    found = _taken(_possible(lines, marks, of))
    accepted = found.good | (trust & (found.inner < 0))
    _account(lines, found, accepted, account)
    after = np.where(accepted | (found.inner < 0), found.star + 3, found.inner)
    rest = _leftover(lines, found, after, of, account)
    account.read += len(dropped.start) + len(found.start)

    letter = np.where(accepted, raw[found.start + 2], 0)
    fields = np.searchsorted(commas, found.star) - np.searchsorted(commas, found.start) + 1
    letter[(letter == ord("s")) & (fields != _WATER_FIELDS)] = _OLD_STATUS
    position = lines.number[found.line]
    kind, flag, values, validity = _read(lines, found, letter, commas, account)
    heard = accepted & ~_pass_by(letter, position, account, trust=trust)
    # What stands around a sentence: from the one before it or the line's start, and to the line's end.
    begin, end = lines.start[found.line], lines.end[found.line]
    follows = np.append(False, found.line[1:] == found.line[:-1]) if len(begin) else heard
    before = np.where(follows, np.roll(after, 1), begin)
    framed = (before < found.start) | (found.star + 3 < end)
    frame = np.empty((len(before), 4), dtype=np.int64)
    for k, place in enumerate((before, found.start, found.star + 3, end)):
        frame[:, k] = lines.offset + place

    unread = np.concatenate([found.start[~accepted], lines.end[rest], dropped.end])
    count = int(np.count_nonzero(heard))
    velocity = np.isin(kind, (VELOCITY, VELOCITY_ALONE, WATER))
    return Events(
        position=position[heard],
        kind=kind[heard],
        flag=flag[heard],
        numbers=values[heard],
        framed=framed[heard],
        frame=frame[heard],
        lost=np.bincount(np.searchsorted(found.start[heard], unread), minlength=count + 1),
        validity_us=[validity[k] for k in np.flatnonzero(velocity & heard).tolist()],
    )


_NOTHING = Events(
    position=np.zeros(0, dtype=np.int64),
    kind=np.zeros(0, dtype=np.int64),
    flag=np.zeros(0, dtype=np.int64),
    numbers=np.zeros((0, 6)),
    framed=np.zeros(0, dtype=bool),
    lost=np.zeros(1, dtype=np.int64),
    frame=np.zeros((0, 4), dtype=np.int64),
    validity_us=[],
)


def read_events(data: bytes, account: Account, *, trust: bool) -> Events:
    """Everything of a file that opens, fills or closes a ping; the account lists the lines that cannot be read.

    Args:
        data: the file.
        account: for the counts.
        trust: keep sentences whose CRC does not fit, flagged.
    """
    parts = [_NOTHING, *(_batch(lines, account, trust=trust) for lines in batches(data))]
    if len(parts) == 2:
        return parts[1]
    joined = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in ("position", "kind", "flag", "numbers", "framed", "frame")
    }
    lost = [np.zeros(1, dtype=np.int64)]
    for part in parts:
        lost[-1][-1] += part.lost[0]
        if len(part.kind):
            lost.append(part.lost[1:])
    return Events(
        **joined, lost=np.concatenate(lost), validity_us=[t for part in parts for t in part.validity_us]
    )
