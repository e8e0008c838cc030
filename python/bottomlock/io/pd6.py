"""Records without beam velocities: PD6 (text), PD3, PD4, PD5 (binary). They are counted, and rejected with advice.

PD6's own velocity can be had with `instrument_only`: `:BI` holds x, y, z and error in mm/s, blank-padded, with A or V
for its validity; +88888 and -32768 stand for none. A good sentence fills its line, or the quoted field of a logger's
CSV.
"""

import re
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from bottomlock.errors import DataError
from bottomlock.io.beam_table import Account, Flags, Floats, Integers, Recording
from bottomlock.io.binary_records import BLOCK, blocks, bytes_of, words_at
from bottomlock.io.lines import Bytes, Lines, batches, joined, numbers, numbers_of
from bottomlock.io.rows import NAN, PLAIN, Options, make_table, raise_if_empty, running_sums
from bottomlock.io.sentences import LONGEST_LINE

NAME = "pd6"
NAME_BINARY = "pd4"
_START = re.compile(rb":(SA|TS|BI|BS|BE|BD|WI|WS|WE|WD),")
_NAMES = (b"SA", b"TS", b"BI", b"BS", b"BE", b"BD", b"WI", b"WS", b"WE", b"WD")
_KIND = np.zeros(1 << 16, dtype=np.int8)
_KIND[[name[0] << 8 | name[1] for name in _NAMES]] = 1
_BI = ord("B") << 8 | ord("I")
_VELOCITY = re.compile(rb":BI" + rb",\s{0,8}([+-]\s{0,8}[0-9]{1,6})" * 4 + rb",([AV])")
# The same in lines; any other line is a match without groups.
_EVERY_VELOCITY = re.compile(
    (rb"^:BI" + rb",_{0,8}+([+-]_{0,8}+[0-9]{1,6}+)" * 4 + rb",([AV])_*+$|^.*+$").replace(
        b"_", rb"[ \t\r\x0b\x0c]"
    ),
    re.MULTILINE,
)
_MOST_DIGITS = 4
"""Digits in a logger's name of the instrument."""
_DIGIT = np.isin(np.arange(256), list(b"0123456789"))
_SPACE = np.isin(np.arange(256), list(b" \t\r\n\x0b\x0c"))
_NONE_MPS = (88.888, -32.768)
ADVICE = (
    "set the instrument to PD0 in beam coordinates (PD0, EX00000) and record again; a Water Linked instrument to its "
    "own protocol, on serial (wrz, wru) or TCP port 16171"
)


@dataclass(frozen=True, eq=False)
class Velocities:
    """`:BI` sentences: line, the host's time (ns) or None, velocity (n, 3), whether the instrument calls it valid."""

    position: Integers
    host_ns: list[int | None]
    velocity_mps: Floats
    valid: Flags


def sniff(head: bytes) -> bool:
    """Whether the beginning of a file looks like PD6."""
    return len(set(_START.findall(head))) >= 3 or _VELOCITY.search(head) is not None


def _logged(lines: Lines, colon: Integers) -> tuple[Flags, Integers, Integers, Integers]:
    """Lines of a logger's CSV: the host's time, a field of any text, the sentence, perhaps in quotes, and a last field.

    Args:
        lines: of a batch.
        colon: (n,) place of the first colon of each.

    Returns:
        (n,) which lines are such; where their time ends; where the sentence of any line begins, and where it ends.
    """
    raw, start, end = lines.raw, lines.start, lines.end
    commas = np.append(lines.places(b","), [len(raw)] * 2)
    quoted, others = lines.places(b'"'), _counted(~_DIGIT[raw])
    at = np.searchsorted(commas, start)
    time_end, comma = commas[at], commas[at + 1]
    opened = (comma == colon - 2) & (raw[np.maximum(colon - 1, 0)] == ord('"'))
    logged = ((comma == colon - 1) | opened) & (comma - time_end <= 65) & (end - start <= LONGEST_LINE)
    logged &= np.searchsorted(quoted, time_end) == np.searchsorted(quoted, comma)
    # A field with many digits holds the time of another line, whose beginning is lost.
    logged &= comma - time_end - (others[comma] - others[time_end]) <= _MOST_DIGITS
    # The time: digits, perhaps a point and more digits.
    points = np.append(lines.places(b"."), len(raw))
    point = np.minimum(points[np.searchsorted(points, start)], time_end)
    digits, decimals = point - start, time_end - point - 1
    logged &= (digits >= 1) & (digits <= 12) & (others[time_end] - others[start] == (point < time_end))
    logged &= (point == time_end) | ((decimals >= 1) & (decimals <= 9))
    # The sentence ends as early as it can: before a short last field, and before the quote that closes it.
    last = commas[np.searchsorted(commas, end) - 1]
    short = (last > colon) & (last < end) & (end - last <= 33)
    short &= np.searchsorted(quoted, np.where(short, last, end)) == np.searchsorted(quoted, end)
    stop = np.where(short, last, end)
    stop = stop - ((stop - 1 > colon) & (raw[stop - 1] == ord('"')))
    return logged, time_end, np.where(logged, colon, _text_start(raw, start)), np.where(logged, stop, end)


def _counted(marks: Flags) -> NDArray[np.int32]:
    """(n + 1,) how many marks there are before each place."""
    counts = np.zeros(len(marks) + 1, dtype=np.int32)
    np.cumsum(marks, dtype=np.int32, out=counts[1:])
    return counts


def _text_start(raw: Bytes, start: Integers) -> Integers:
    """Where lines begin behind the white space that is no blank of a line."""
    odd = np.flatnonzero((raw[start] == 0x0B) | (raw[start] == 0x0C))
    if not len(odd):
        return start
    solid, found = np.append(np.flatnonzero(~_SPACE[raw]), len(raw) - 1), start.copy()
    found[odd] = solid[np.searchsorted(solid, start[odd])]
    return found


def _batch(lines: Lines, account: Account) -> Velocities:
    """Every whole `:BI` sentence; other sentences and what is mangled go to the account."""
    raw = np.append(lines.raw, np.zeros(4, dtype=np.uint8))
    colons = np.append(lines.places(b":"), len(raw))
    colon = colons[np.searchsorted(colons, lines.start)]
    other = colon >= lines.end
    account.pass_by_where("line of something else", other, lines.number)
    lines, colon = lines.where(~other), colon[~other]
    account.read += len(colon)
    logged, time_end, begin, end = _logged(lines, colon)

    marks = colons[:-1]
    of = lines.of(marks)
    pair = raw[marks + 1].astype(np.int64) << 8 | raw[marks + 2]
    known = (_KIND[pair] > 0) & (raw[marks + 3] == ord(",")) & (of >= 0)
    known[known] = marks[known] + 4 <= np.minimum(lines.end, lines.start + LONGEST_LINE)[of[known]]
    of, pair = of[known], pair[known]
    starts, kind = np.bincount(of, minlength=len(colon)), np.zeros(len(colon), dtype=np.int64)
    kind[of[::-1]] = pair[::-1]  # the first of a line stands

    found, chosen = _sentences(lines, raw, begin, end)
    matched = np.zeros(len(colon), dtype=bool)
    matched[chosen] = True
    opens = raw[begin] == ord(":")
    alike = opens & ((raw[begin + 1].astype(np.int64) << 8 | raw[begin + 2]) == kind) & (end - begin >= 3)
    merged = ~matched & ((starts > 1) | ((starts == 1) & ~opens))
    mangled = ~matched & ~merged & ((starts == 0) | (kind == _BI) | ~alike)
    detail = lines.piece(lines.start, lines.end)
    account.skip_where("merged line", merged, lines.number, detail)
    account.skip_where("mangled line", mangled, lines.number, detail)
    rest = ~matched & ~merged & ~mangled
    for name in _NAMES:
        account.pass_by_where(
            f":{name.decode('ascii')}", rest & (kind == (name[0] << 8 | name[1])), lines.number
        )
    return _velocities(lines, chosen, found, np.where(logged, time_end, -1))


def _sentences(
    lines: Lines, raw: Bytes, begin: Integers, end: Integers
) -> tuple[list[tuple[bytes, ...]], Integers]:
    """The four numbers and the flag of each whole `:BI` sentence, and the index of its line."""
    maybe = end - begin >= 17
    for k, byte in enumerate(b":BI,"):
        maybe &= raw[begin + k] == byte
    index = np.flatnonzero(maybe)
    groups = _EVERY_VELOCITY.findall(joined(lines.raw, begin[index], end[index]))
    good = [k for k, group in enumerate(groups[: len(index)]) if group[4]]
    return [groups[k] for k in good], index[good]


def _velocities(
    lines: Lines, chosen: Integers, found: list[tuple[bytes, ...]], time_end: Integers
) -> Velocities:
    """Numbers of the sentences, and the host's times where a logger wrote them."""
    text = b"\n".join(chain.from_iterable(group[:3] for group in found)).replace(b" ", b"")
    value, known = numbers_of(text + b"\n" if found else b"")
    velocity = np.where(known, value * 1e-3, NAN).reshape(len(found), 3)
    velocity[np.isin(velocity, _NONE_MPS)] = NAN
    start, stop = lines.start[chosen], time_end[chosen]
    timed = stop >= 0
    host, _ = numbers(lines.raw, start[timed], stop[timed])
    times: list[int | None] = [None] * len(chosen)
    for k, ns in zip(np.flatnonzero(timed).tolist(), np.rint(host * 1e9).tolist(), strict=True):
        times[k] = int(ns)
    return Velocities(
        lines.number[chosen], times, velocity, np.array([g[4] == b"A" for g in found], dtype=bool)
    )


def velocities(data: bytes, account: Account) -> Velocities:
    """Every whole `:BI` sentence of a file."""
    parts = [_batch(lines, account) for lines in batches(data)]
    nothing = Velocities(np.empty(0, dtype=np.int64), [], np.empty((0, 3)), np.empty(0, dtype=bool))
    position, velocity, valid = (
        np.concatenate([getattr(part, name) for part in (nothing, *parts)])
        for name in ("position", "velocity_mps", "valid")
    )
    return Velocities(position, [t for part in parts for t in part.host_ns], velocity, valid)


def read(data: bytes, place: str, options: Options = PLAIN) -> Recording:
    """Rejects PD6 with advice, or reads the instrument's velocity where `instrument_only` is set.

    Raises:
        DataError: always without `instrument_only`; with it, where no velocity has a host's time.
    """
    account = Account(unit="line")
    found = velocities(data, account)
    if not options.instrument_only:
        lost = f", {account.lost} damaged lines" if account.lost else ""
        raise DataError(
            f"{place}: PD6 holds no beam velocities ({len(found.position)} velocities :BI, "
            f"{np.count_nonzero(found.valid)} of them valid{lost}); {ADVICE}"
        )
    timed = np.array([t is not None for t in found.host_ns], dtype=bool)
    account.skip_where("without a time of the logging host", ~timed, found.position)
    times = [t for t in found.host_ns if t is not None]
    none = np.empty((len(times), 0))
    table = make_table(
        account,
        0,
        found.position[timed],
        times,
        none,
        none,
        instrument=found.velocity_mps[timed],
        verdict=found.valid[timed],
        arrival_ns=times,
    )
    raise_if_empty(account, place, ":BI sentence with a host's time")
    return Recording(
        format=NAME,
        table=table,
        account=account,
        frame="instrument",
        clock="the logging host's, seconds since 1970",
        time_of="arrival",
        notes=["no beam velocities: the table holds the instrument's velocity alone, axes as recorded"],
    )


_BINARY = {0x7D: "PD4 or PD5", 0x7E: "PD3"}


def binary_records(data: bytes) -> dict[str, int]:
    """How many whole PD3, PD4 and PD5 records there are, by kind: their sums fit."""
    counts: dict[str, int] = {}
    raw, sums = bytes_of(data), running_sums(data)
    behind = 0
    for block in blocks(max(len(raw) - 5, 0)):
        part = raw[block : min(block + BLOCK, len(raw) - 5)]
        at = block + np.flatnonzero((part == 0x7D) | (part == 0x7E))
        # PD3 has a fixed length; PD4 (45) and PD5 (86) state theirs.
        short, stated = raw.take(at) == 0x7E, words_at(raw, at + 2)
        end = at + np.where(short, 55, stated)
        possible = (short | (stated == 45) | (stated == 86)) & (end + 2 <= len(raw))
        at, end = at[possible], end[possible]
        fits = (sums.take(end) - sums.take(at)) == words_at(raw, end).astype(np.uint16)
        for start, after in zip(at[fits].tolist(), (end[fits] + 2).tolist(), strict=True):
            if start >= behind:
                kind = _BINARY[data[start]]
                counts[kind] = counts.get(kind, 0) + 1
                behind = after
    return counts


def sniff_binary(head: bytes) -> bool:
    """Whether the beginning of a file looks like PD3, PD4 or PD5."""
    return head[:1] in {b"\x7d", b"\x7e"} and bool(binary_records(head))


def read_binary(data: bytes, place: str, options: Options = PLAIN) -> Recording:
    """Rejects PD3, PD4 and PD5 with advice.

    Raises:
        DataError: always.
    """
    counts = binary_records(data)
    found = ", ".join(f"{count} {kind} records" for kind, count in counts.items()) or "no whole record"
    also = "; --instrument-only does not read them" if options.instrument_only else ""
    raise DataError(f"{place}: PD3, PD4 and PD5 hold no beam velocities ({found}); {ADVICE}{also}")
