"""JSON objects of a text with one a line, or several where line ends were lost.

A line that is one sound object is read by a fast parser; whatever that refuses, and what has a key twice, is read again
by the parser of the standard library, which says how far a line is good.
"""

import json
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic_core import from_json

from bottomlock.io.beam_table import Account
from bottomlock.io.lines import batches

LONGEST_JSON = 65_536
"""Longest line that is read as a report, bytes."""
# A report that begins within a line, after one that was cut off.
_RESTARTS = ('{"time"', '{"ts"', '{"type"')
_MOST_RESTARTS = 8


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object; one that names a key twice is two, with what stood between them lost."""
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("a key is given twice")
    return found


_DECODER = json.JSONDecoder(object_pairs_hook=_object)


Object = dict[str, Any]


@dataclass(frozen=True)
class Line:
    """The objects of a line; `damaged` if there is more in it than these."""

    objects: tuple[Object, ...]
    damaged: bool

    def tell(self, account: Account, position: int, text: bytes, count: int) -> None:
        """Counts so many lines that are all the same."""
        account.read += count * (len(self.objects) + self.damaged)
        if self.damaged:
            account.skip("merged line" if self.objects else "truncated", position, text, count=count)
        elif len(self.objects) > 1:
            account.flag("merged line, all of it read", position, count=count)


def objects(
    data: bytes, other: Callable[[Object], str | None], account: Account
) -> Iterator[tuple[int, Object]]:
    """The objects of a file, with the number of their line; what else there is goes to the account.

    Args:
        data: the file.
        other: the kind of an object that is passed by, None for one that is wanted.
        account: for the counts.
    """
    for lines in batches(data):
        long = lines.end - lines.start > LONGEST_JSON
        edges = zip(lines.start.tolist(), lines.end.tolist(), strict=True)
        has = np.array([lines.text.find(b"{", *edge) >= 0 for edge in edges], dtype=bool)
        none, whole = ~(has | long), lines.piece(lines.start, lines.end)
        account.read += int(np.count_nonzero(none)) + int(np.count_nonzero(long))
        account.skip_where("truncated", none, lines.number, whole)
        account.skip_where("line too long", long, lines.number, whole)
        chosen = lines.where(has & ~long)
        for position, text, count, line in _different(chosen.number.tolist(), chosen.texts(), other):
            line.tell(account, position, text, count)
            for one in line.objects:
                kind = other(one)
                if kind is None:
                    yield position, one
                else:
                    account.pass_by(kind, position, count=count)


def _different(
    positions: list[int], texts: list[bytes], other: Callable[[Object], str | None]
) -> Iterator[tuple[int, bytes, int, Line]]:
    """Number, text, count and content of lines in their order; the same text without a wanted object comes once."""
    times = Counter(texts)
    if 2 * len(times) > len(texts):
        for position, text in zip(positions, texts, strict=True):
            yield position, text, 1, parse(text)
        return
    parsed = {text: parse(text) for text in times}
    quiet = {text for text, line in parsed.items() if None not in map(other, line.objects)}
    first = dict(zip(reversed(texts), reversed(positions), strict=True))
    found = [(first[text], text, times[text]) for text in quiet]
    if len(quiet) < len(times):
        found += [(at, text, 1) for at, text in zip(positions, texts, strict=True) if text not in quiet]
    for position, text, count in sorted(found):
        yield position, text, count, parsed[text]


def _keys(value: Object) -> int:
    """How many keys an object has, and the objects that it holds itself or in lists; deeper ones are not counted."""
    keys = len(value)
    for one in value.values():
        if type(one) is list:
            keys += sum([len(each) for each in one if type(each) is dict])
        elif type(one) is dict:
            keys += len(one)
    return keys


def parse(text: bytes) -> Line:
    """The objects of a line without blanks around it."""
    try:
        value = from_json(text, allow_inf_nan=False)
    except ValueError:
        return _parse_in_pieces(text.decode("utf-8", "replace"))
    # Every key has its colon: more colons are those of texts, of deeper objects, or of a key that is given twice.
    if type(value) is dict and _keys(value) == text.count(b":"):
        return Line((value,), damaged=False)
    return _parse_in_pieces(text.decode("utf-8", "replace"))


def _parse_in_pieces(text: str) -> Line:
    """The objects of a line that may be damaged."""
    found: list[Object] = []
    at, restarts, damaged = 0, 0, False
    while 0 <= at < len(text):
        try:
            value, end = _DECODER.raw_decode(text, at)
        except (ValueError, RecursionError):
            damaged = True
            later = [p for p in (text.find(start, at + 1) for start in _RESTARTS) if p >= 0]
            restarts += 1
            at = min(later) if later and restarts <= _MOST_RESTARTS else -1
            continue
        if isinstance(value, dict):
            found.append(value)
        else:
            damaged = True
        at = end
        while at < len(text) and text[at] in " \t\r":
            at += 1
    return Line(tuple(found), damaged=damaged)
