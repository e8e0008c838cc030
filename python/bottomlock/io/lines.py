"""Text records of a whole file at once: lines, running checksums, fields between commas, numbers.

A file is taken in batches of whole lines. Within a batch places are indices of its bytes, and what is found (lines,
sentences, fields) is held as arrays of places where each begins and ends.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bottomlock.io.beam_table import Flags, Floats, Integers
from bottomlock.io.progress import reporter
from bottomlock.io.sentences import number, whole
from bottomlock.support.later import pl

BATCH = 1 << 18
"""Bytes of a batch, more where its last line goes on."""

Bytes = NDArray[np.uint8]

_FEW = 600
"""Bytes of numbers up to which reading them one by one is faster than a column of them."""
_MOST_DIGITS = 18
_FEW_LINES = 2048
"""Bytes below which lines are cut one by one."""

_BLANKS = b"\r\n \t\x00"
_BLANK = np.isin(np.arange(256), list(_BLANKS))
_HEX = np.full(256, -1, dtype=np.int16)
_HEX[list(b"0123456789abcdef")] = _HEX[list(b"0123456789ABCDEF")] = range(16)
_ODD_SPACE = np.isin(np.arange(256), list(b"\x0b\x0c"))
_SPACE = re.compile(rb"[ \t\r\x0b\x0c]")
# Words that Python and polars take for numbers, and digits with underscores, are none here.
_NO_WORDS = bytes.maketrans(b"nN_", b"!!!")


@dataclass(frozen=True, eq=False)
class Lines:
    """Lines of a batch that are not empty, without line ends, blanks and NULs around them.

    Attributes:
        text: bytes of the batch.
        raw: the same as an array.
        offset: place of the batch in the file.
        number: (n,) of each line in the file, from 1.
        start: (n,) place of its first byte.
        end: (n,) place behind its last byte.
    """

    text: bytes
    raw: Bytes
    offset: int
    number: Integers
    start: Integers
    end: Integers

    def of(self, at: Integers) -> Integers:
        """(m,) index of the line in which a place lies, for places within lines."""
        return np.searchsorted(self.start, at, side="right") - 1

    def where(self, chosen: Flags) -> Lines:
        """The chosen lines."""
        return Lines(
            self.text, self.raw, self.offset, self.number[chosen], self.start[chosen], self.end[chosen]
        )

    def piece(self, start: Integers, end: Integers) -> Callable[[int], bytes]:
        """The bytes between two places, by index: the detail of an account."""
        return lambda k: self.text[start[k] : end[k]]

    def texts(self) -> list[bytes]:
        """The lines."""
        return [self.text[a:b] for a, b in zip(self.start.tolist(), self.end.tolist(), strict=True)]

    def places(self, byte: bytes) -> Integers:
        """Every place of a byte, rising."""
        return np.flatnonzero(self.raw == byte[0])

    def solid_from(self, place: Integers) -> Flags:
        """(n,) lines that have more than white space from a place on, which is within the line or its end."""
        solid = place < self.end
        # Of characters at the end of a line these two alone are white space.
        for k in np.flatnonzero(solid & _ODD_SPACE[self.raw[self.end - 1]]).tolist():
            solid[k] = bool(self.text[place[k] : self.end[k]].strip())
        return solid


def batches(data: bytes) -> Iterator[Lines]:
    """The lines of a file, some hundred kilobytes at a time."""
    report = reporter()
    at, before = 0, 0
    while at < len(data):
        if at and report is not None:
            report(at)
        stop = data.find(b"\n", at + BATCH) + 1 or len(data)
        text = data[at:stop]
        raw = np.frombuffer(text, dtype=np.uint8)
        if len(text) < _FEW_LINES:
            yield Lines(text, raw, at, *_few_lines(text, before))
            return
        breaks = np.flatnonzero(raw == ord("\n"))
        start, end = _stripped(raw, np.concatenate(([0], breaks + 1)), np.append(breaks, len(raw)))
        some = np.flatnonzero(end > start)
        yield Lines(text, raw, at, before + 1 + some, start[some], end[some])
        at, before = stop, before + len(breaks)


def _few_lines(text: bytes, before: int) -> tuple[Integers, Integers, Integers]:
    """Number, start and end of the lines of the last batch of a file, cut one by one: a record that is read alone."""
    found, at = [], 0
    for position, line in enumerate(text.split(b"\n"), before + 1):
        if solid := line.strip(_BLANKS):
            start = at + line.index(solid[0])
            found.append((position, start, start + len(solid)))
        at += len(line) + 1
    columns = np.array(found, dtype=np.int64).reshape(-1, 3).T
    return columns[0], columns[1], columns[2]


def _stripped(raw: Bytes, start: Integers, end: Integers) -> tuple[Integers, Integers]:
    """Lines without the blanks around them; an empty one ends where it starts."""
    end = np.where((end > start) & (raw.take(end - 1, mode="clip") == ord("\r")), end - 1, end)
    edges = _BLANK[raw.take(start, mode="clip")] | _BLANK[raw.take(end - 1, mode="clip")]
    wide = np.flatnonzero(edges & (end > start))
    if len(wide):
        solid = np.append(np.flatnonzero(~_BLANK[raw]), len(raw))
        first, last = np.searchsorted(solid, start[wide]), np.searchsorted(solid, end[wide])
        start[wide] = np.minimum(solid[first], end[wide])
        end[wide] = np.where(last > first, solid[last - 1] + 1, start[wide])
    return start, end


def hexadecimal_at(raw: Bytes, at: Integers) -> Integers:
    """(n,) numbers of two hexadecimal digits at some places; -1 where there are none, or the bytes end."""
    within = at + 2 <= len(raw)
    safe = np.where(within, at, 0)
    high, low = (_HEX[raw.take(safe + k, mode="clip")] for k in (0, 1))
    return np.where(within & (high >= 0) & (low >= 0), high * 16 + low, -1).astype(np.int64)


def running_xor(raw: Bytes) -> Callable[[Integers, Integers], Bytes]:
    """NMEA 0183's exclusive or of any pieces: a function of their starts and ends (n,)."""
    sums = np.zeros(len(raw) + 1, dtype=np.uint8)
    np.bitwise_xor.accumulate(raw, out=sums[1:])
    return lambda start, end: sums[end] ^ sums[start]


@functools.cache
def _crc8_powers(polynomial: int) -> Bytes:
    """(period, 256): a byte after as many further bytes of zero as the row says; then it is itself again."""
    once = np.arange(256, dtype=np.int64)
    for _ in range(8):
        once = np.where(once & 0x80, once << 1 ^ polynomial, once << 1)
    rows = [np.arange(256)]
    while len(rows) == 1 or (rows[-1] != rows[0]).any():
        rows.append(once[rows[-1]])
    return np.array(rows[:-1], dtype=np.uint8)


@functools.cache
def _turns(period: int) -> NDArray[np.int32]:
    """Where in `_crc8_powers` the row begins that undoes the multiplication, at each place of two batches."""
    turn = (-np.arange(period) % period * 256).astype(np.int32)
    return np.tile(turn, 2 * BATCH // period + 1)


def running_crc8(raw: Bytes, polynomial: int) -> Callable[[Integers, Integers], Bytes]:
    """CRC-8 that starts from 0, of any pieces: a function of their starts and ends (n,).

    The CRC is linear: each byte counts by itself, multiplied by x^8 for every byte from it on. The running exclusive or
    takes bytes with that multiplication undone as far as their place; what is left of it is done at a piece's end.
    """
    powers = _crc8_powers(polynomial)
    period = len(powers)
    sums = np.zeros(len(raw) + 1, dtype=np.uint8)
    turns = _turns(period)
    turns = turns[: len(raw)] if len(raw) <= len(turns) else np.resize(turns, len(raw))
    turned = powers.reshape(-1).take(turns + raw)
    np.bitwise_xor.accumulate(turned, out=sums[1:])
    return lambda start, end: powers[end % period, sums[end] ^ sums[start]]


def fields_between(
    separators: Integers, start: Integers, end: Integers, count: int
) -> tuple[Integers, Integers]:
    """Fields of pieces of text, as `bytes.split` gives them.

    Args:
        separators: every place of the separator, rising.
        start: (n,) where the pieces begin.
        end: (n,) where they end.
        count: fields that a piece should have.

    Returns:
        (n,) how many fields each has, and of the pieces with `count` of them the bounds (m, count + 1): field k lies
        between the byte behind bound k and bound k + 1.
    """
    first, last = np.searchsorted(separators, start), np.searchsorted(separators, end)
    fields = last - first + 1
    fits = fields == count
    bounds = np.empty((np.count_nonzero(fits), count + 1), dtype=np.int64)
    bounds[:, 0], bounds[:, -1] = start[fits] - 1, end[fits]
    bounds[:, 1:-1] = separators[first[fits, None] + np.arange(count - 1)]
    return fields, bounds


def numbers(raw: Bytes, start: Integers, end: Integers) -> tuple[Floats, Flags]:
    """The decimal numbers of many fields, in the shape of `start`, and which are numbers, as `sentences.number`."""
    values, good = numbers_of(joined(raw, start.ravel(), end.ravel()))
    return values.reshape(start.shape), good.reshape(start.shape)


def numbers_of(text: bytes) -> tuple[Floats, Flags]:
    """The same of text with a number a line, the last with its line end too; a few are read one by one."""
    if not text:
        return np.empty(0), np.empty(0, dtype=bool)
    if len(text) < _FEW:
        few = [number(cell) for cell in text[:-1].split(b"\n")]
        return np.array([math.nan if v is None else v for v in few]), np.array([v is not None for v in few])
    cells = text[:-1].translate(_NO_WORDS).decode("latin-1").split("\n")
    if _SPACE.search(text):
        cells = [cell.strip(" \t\r\x0b\x0c") for cell in cells]
    found = pl.Series(cells, dtype=pl.String).cast(pl.Float64(), strict=False)
    # Null becomes NaN, and no number is one.
    values = np.array(found.to_numpy())
    return values, ~np.isnan(values)


def wholes(lines: Lines, start: Integers, end: Integers) -> list[int | None]:
    """(n,) whole numbers of fields, as `sentences.whole`."""
    sizes = end - start
    if sizes.sum() < _FEW:
        return [whole(lines.text[a:b]) for a, b in zip(start.tolist(), end.tolist(), strict=True)]
    cells = joined(lines.raw, start, end)[:-1].decode("latin-1").split("\n")
    found = pl.Series(cells, dtype=pl.String).cast(pl.Int64(), strict=False).to_list()
    # Blanks, more than 64 bits, and what is too long.
    for k in np.flatnonzero((sizes > _MOST_DIGITS) | np.array([v is None for v in found])).tolist():
        found[k] = whole(lines.text[start[k] : end[k]])
    return found


def joined(raw: Bytes, start: Integers, end: Integers) -> bytes:
    """The bytes of many pieces, a line each."""
    stop = np.cumsum(end - start + 1)
    if not len(stop):
        return b""
    begin = np.concatenate(([0], stop[:-1]))
    at = np.arange(int(stop[-1])) + np.repeat(start - begin, end - start + 1)
    text = raw.take(at, mode="clip")
    text[stop - 1] = ord("\n")
    return text.tobytes()


def is_text(raw: Bytes, start: Integers, end: Integers, word: bytes) -> Flags:
    """(n,) which pieces are exactly a word."""
    at = start[:, None] + np.arange(len(word))
    same = (raw.take(at, mode="clip") == np.frombuffer(word, dtype=np.uint8)).all(axis=1)
    return np.asarray(same & (end - start == len(word)))
