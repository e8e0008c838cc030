"""JSON objects of a text with one a line, or several where line ends were lost."""

import json
from collections.abc import Callable, Iterator
from typing import Any

from bottomlock.io.beam_table import Account
from bottomlock.io.sentences import lines_of

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


def objects(
    data: bytes, other: Callable[[Object], str | None], account: Account
) -> Iterator[tuple[int, Object]]:
    """The objects of a file, with the number of their line; what else there is goes to the account.

    Args:
        data: the file.
        other: the kind of an object that is passed by, None for one that is wanted.
        account: for the counts.
    """
    for position, line in lines_of(data):
        account.read += 1
        if len(line) > LONGEST_JSON:
            account.skip("line too long", position, line)
            continue
        found, damaged = _parse(line.decode("utf-8", "replace"))
        account.read += len(found) + damaged - 1
        if damaged:
            account.skip("merged line" if found else "truncated", position, line)
        elif len(found) > 1:
            account.flag("merged line, all of it read", position)
        for one in found:
            kind = other(one)
            if kind is None:
                yield position, one
            else:
                account.pass_by(kind, position)


def _parse(text: str) -> tuple[list[Object], bool]:
    """The objects of a line without blanks around it, and whether there is more in it than these."""
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
    return found, damaged
