"""Sentences `$NAME,fields*HH` of a whole batch of lines: found, checked, and read in columns.

HH is a checksum in two hexadecimal digits of what stands between `$` and `*`, where neither occurs.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from bottomlock.io.account import Detail
from bottomlock.io.beam_table import Account, Flags, Floats, Integers
from bottomlock.io.lines import (
    Bytes,
    Lines,
    batches,
    fields_between,
    hexadecimal_at,
    is_text,
    numbers,
    wholes,
)
from bottomlock.io.sentences import LONGEST_LINE

_AFTER = np.isin(np.arange(256), list(b",*"))
_LETTER = np.isin(np.arange(256), range(ord("A"), ord("Z") + 1))
_DIGIT = np.isin(np.arange(256), range(ord("0"), ord("9") + 1))
Check = Callable[[Bytes, Integers, Integers, Integers], Flags]
"""Whether checksums fit: of a batch's bytes, where texts begin and end, and the sums that are given."""


@dataclass(frozen=True)
class Names:
    """The names that a family of sentences has: a beginning, then capital letters, then digits.

    Attributes:
        prefix: the beginning.
        letters: least and greatest number of further letters.
        digits: greatest number of digits; a name has 9 characters at most.
        longest: most characters between name and asterisk, behind a comma.
    """

    prefix: bytes
    letters: tuple[int, int]
    digits: int
    longest: int

    def read(self, raw: Bytes, start: Integers, length: Integers) -> tuple[Integers, Flags]:
        """(n,) a number for each name, the same for the same name, and which are names."""
        used = len(self.prefix)
        good = is_text(raw, start, start + used, self.prefix)
        most = self.letters[1] + self.digits
        place = np.arange(used, used + most)
        word = np.where(place < length[:, None], raw.take(start[:, None] + place, mode="clip"), 0)
        upper, digit = _LETTER[word], _DIGIT[word]
        letters, digits = upper.sum(axis=1), digit.sum(axis=1)
        good &= ~(digit[:, :-1] & upper[:, 1:]).any(axis=1)
        good &= (letters >= self.letters[0]) & (letters <= self.letters[1]) & (digits <= self.digits)
        return word @ (1 << 8 * np.arange(most)), good & (length == used + letters + digits)


@dataclass(frozen=True, eq=False)
class Sentences:
    """Sentences whose checksum fits or is not asked for, (n,) each.

    Attributes:
        lines: the batch.
        position: line in the file.
        start: place of the name.
        star: place of the asterisk.
    """

    lines: Lines
    position: Integers
    start: Integers
    star: Integers

    def text(self, k: int) -> bytes:
        """What stands between `$` and `*`."""
        return self.lines.text[self.start[k] : self.star[k]]

    def where(self, chosen: Flags) -> "Sentences":
        """The chosen ones."""
        return Sentences(self.lines, self.position[chosen], self.start[chosen], self.star[chosen])

    def fields(self, count: int) -> tuple[Flags, "Fields"]:
        """Which sentences have so many fields beside the name, and these fields."""
        commas = self.lines.places(b",")
        found, bounds = fields_between(commas, self.start, self.star, count + 1)
        return found == count + 1, Fields(self.lines, bounds[:, 1:-1] + 1, bounds[:, 2:])


@dataclass(frozen=True, eq=False)
class Fields:
    """Where fields begin and end, (n, count) each."""

    lines: Lines
    begin: Integers
    end: Integers

    def is_text(self, column: int, word: bytes) -> Flags:
        """(n,) which fields of a column are exactly a word."""
        return is_text(self.lines.raw, self.begin[:, column], self.end[:, column], word)

    def numbers(self, columns: list[int]) -> tuple[Floats, Flags]:
        """(n, columns) decimal numbers, and which are numbers."""
        return numbers(self.lines.raw, self.begin[:, columns], self.end[:, columns])

    def wholes(self, column: int) -> list[int | None]:
        """(n,) whole numbers of a column, None for anything else."""
        return wholes(self.lines, self.begin[:, column], self.end[:, column])


def sentences(
    data: bytes, names: Names, wanted: tuple[bytes, ...], fits: Check, account: Account, *, trust: bool
) -> Iterator[tuple[Sentences, "Remarks"]]:
    """The wanted sentences of a file, batch by batch; what else there is goes to the account.

    Args:
        data: the file.
        names: what names look like.
        wanted: the names that are wanted.
        fits: whether a checksum fits.
        account: for the counts.
        trust: keep sentences whose checksum does not fit, flagged.
    """
    for batch in batches(data):
        remarks = Remarks(account)
        lines, marks, of = _lines_with_mark(batch, account, remarks)
        start, star, code, of = _found(lines, marks, of, names)
        given = hexadecimal_at(lines.raw, star + 1)
        good = fits(lines.raw, start, star, given) if len(start) else given > 0
        at = lines.number[of]
        whole = lines.piece(start - 1, star + 3)
        if trust:
            account.flag_where("bad checksum, kept on request", ~good, at, whole)
        else:
            remarks.skip("bad checksum", ~good, at, start, whole)
        _leftover(lines, star, of, account, remarks)
        heard = np.ones(len(start), dtype=bool) if trust else good
        mine = np.zeros(len(start), dtype=bool)
        for name in wanted:
            end = start + len(name)
            mine |= is_text(lines.raw, start, end, name) & _AFTER[lines.raw.take(end, mode="clip")]
        _pass_by(lines, start, star, code, of, heard & ~mine, account)
        chosen = heard & mine
        yield Sentences(lines, at[chosen], start[chosen], star[chosen]), remarks


@dataclass
class Remarks:
    """Skipped records of a batch, of which the account is told in the order of the file: `tell` at its end."""

    account: Account

    def __post_init__(self) -> None:
        self._found: list[tuple[int, str, Flags, Integers, Detail]] = []

    def skip(self, reason: str, chosen: Flags, position: Integers, place: Integers, detail: Detail) -> None:
        """Notes the chosen ones of many records; `place` is where each begins."""
        if chosen.any():
            first = int(place[int(np.argmax(chosen))])
            self._found.append((first, reason, chosen, position, detail))

    def tell(self) -> None:
        """Counts what was noted."""
        for _, reason, chosen, position, detail in sorted(self._found, key=lambda one: one[0]):
            self.account.skip_where(reason, chosen, position, detail)


def _lines_with_mark(batch: Lines, account: Account, remarks: Remarks) -> tuple[Lines, Integers, Integers]:
    """Lines with a dollar sign that are not too long, the places of these signs, and the line of each."""
    too_long = batch.end - batch.start > LONGEST_LINE
    whole = batch.piece(batch.start, batch.end)
    marks = batch.places(b"$")
    of = batch.of(marks)
    has = np.zeros(len(batch.start), dtype=bool)
    has[of] = True
    remarks.skip("not a sentence", ~has & ~too_long, batch.number, batch.start, whole)
    remarks.skip("line too long", too_long, batch.number, batch.start, whole)
    account.read += int(np.count_nonzero(~has | too_long))
    chosen = has & ~too_long
    inside = chosen[of]
    index = np.cumsum(chosen) - 1
    return batch.where(chosen), marks[inside], index[of[inside]]


def _found(
    lines: Lines, marks: Integers, of: Integers, names: Names
) -> tuple[Integers, Integers, Integers, Integers]:
    """Where names of sentences begin, their asterisks, the names' numbers, and the line of each."""
    raw, end = lines.raw, lines.end[of]
    stars = np.append(lines.places(b"*"), len(raw))
    star = stars[np.searchsorted(stars, marks)]
    following = np.append(marks[1:], len(raw))
    near = (star < following) & (star + 3 <= end)
    start, star, of = marks[near] + 1, star[near], of[near]
    given = hexadecimal_at(raw, star + 1) >= 0
    start, star, of = start[given], star[given], of[given]
    commas = np.append(lines.places(b","), len(raw))
    comma = np.minimum(commas[np.searchsorted(commas, start)], star)
    code, good = names.read(raw, start, comma - start)
    good &= star - comma <= names.longest + 1
    return start[good], star[good], code[good], of[good]


def _leftover(lines: Lines, star: Integers, of: Integers, account: Account, remarks: Remarks) -> None:
    """Counts lines without a sentence, and what stands behind the last of a line."""
    none = np.ones(len(lines.start), dtype=bool)
    none[of] = False
    behind = lines.end.copy()
    behind[of] = star + 3  # the last of a line stands
    tail = lines.solid_from(behind)
    begin = np.where(none, lines.start, behind)
    remarks.skip("truncated", none | tail, lines.number, begin, lines.piece(begin, lines.end))
    account.read += int(np.count_nonzero(none) + np.count_nonzero(tail)) + len(star)


def _pass_by(
    lines: Lines,
    start: Integers,
    star: Integers,
    code: Integers,
    of: Integers,
    other: Flags,
    account: Account,
) -> None:
    """Counts sentences of other names, in the order of the first of each."""
    index = np.flatnonzero(other)
    if not len(index):
        return
    _, first, count = np.unique(code[index], return_index=True, return_counts=True)
    rising = np.argsort(first)
    first, count = index[first[rising]], count[rising]
    places = (start[first], star[first], lines.number[of[first]], count)
    for begin, end, position, times in zip(*(place.tolist() for place in places), strict=True):
        name = lines.text[begin:end].split(b",", 1)[0]
        account.pass_by("$" + name.decode("ascii"), position, count=times)
