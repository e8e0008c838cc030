"""Records without beam velocities: PD6 (text), PD3, PD4, PD5 (binary). They are counted, and rejected with advice.

PD6's own velocity can be had with `instrument_only`: `:BI` holds x, y, z and error in mm/s, blank-padded, with A or V
for its validity; +88888 and -32768 stand for none. A good sentence fills its line, or the quoted field of a logger's
CSV.
"""

import re
from typing import NamedTuple

import numpy as np

from bottomlock.errors import DataError
from bottomlock.io.beam_table import Account, Recording
from bottomlock.io.binary_records import BLOCK, blocks, bytes_of, words_at
from bottomlock.io.rows import NAN, PLAIN, Options, Rows, raise_if_empty, running_sums
from bottomlock.io.sentences import LONGEST_LINE, lines_of, number

NAME = "pd6"
NAME_BINARY = "pd4"
_START = re.compile(rb":(SA|TS|BI|BS|BE|BD|WI|WS|WE|WD),")
_LOGGED = re.compile(rb'^([0-9]{1,12}(?:\.[0-9]{1,9})?),[^,":]{0,64},"?(:.*?)"?(?:,[^,"]{0,32})?$')
_VELOCITY = re.compile(rb":BI" + rb",\s{0,8}([+-]\s{0,8}[0-9]{1,6})" * 4 + rb",([AV])")
_CLOCK = re.compile(rb":TS,[0-9]{14},[^:]{0,64}")
_NONE_MPS = {88.888, -32.768}
ADVICE = (
    "set the instrument to PD0 in beam coordinates (PD0, EX00000) and record again; a Water Linked instrument to its "
    "own protocol, on serial (wrz, wru) or TCP port 16171"
)


class Velocity(NamedTuple):
    """A `:BI` sentence: position, host time (ns) or None, velocity (m/s), whether the instrument calls it valid."""

    position: int
    host_ns: int | None
    velocity_mps: tuple[float, float, float]
    valid: bool


def sniff(head: bytes) -> bool:
    """Whether the beginning of a file looks like PD6."""
    return len(set(_START.findall(head))) >= 3 or _VELOCITY.search(head) is not None


def velocities(data: bytes, account: Account) -> list[Velocity]:
    """Every whole `:BI` sentence; other sentences and what is mangled go to the account."""
    found = []
    for position, line in lines_of(data):
        starts = _START.findall(line[:LONGEST_LINE])
        logged = _LOGGED.match(line) if len(line) <= LONGEST_LINE else None
        text = (logged.group(2) if logged else line).strip()
        if not starts and b":" not in text:
            account.pass_by("line of something else", position)
            continue
        account.read += 1
        match = _VELOCITY.fullmatch(text)
        if match:
            numbers = [number(part.replace(b" ", b"")) for part in match.groups()[:3]]
            x, y, z = (NAN if v is None or v * 1e-3 in _NONE_MPS else v * 1e-3 for v in numbers)
            host = number(logged.group(1)) if logged else None
            host_ns = None if host is None else round(host * 1e9)
            found.append(Velocity(position, host_ns, (x, y, z), match.group(5) == b"A"))
        elif len(starts) > 1 or (starts and not text.startswith(b":")):
            account.skip("merged line", position, line)
        elif not starts or starts[0] == b"BI" or not text.startswith(b":" + starts[0]):
            account.skip("mangled line", position, line)
        else:
            account.pass_by(":" + starts[0].decode("ascii"), position)
    return found


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
            f"{place}: PD6 holds no beam velocities ({len(found)} velocities :BI, "
            f"{sum(v.valid for v in found)} of them valid{lost}); {ADVICE}"
        )
    rows = Rows(0, account)
    for v in found:
        if v.host_ns is None:
            account.skip("without a time of the logging host", v.position)
        else:
            rows.add(
                v.position,
                v.host_ns,
                (),
                (),
                instrument=v.velocity_mps,
                verdict=int(v.valid),
                arrival_ns=v.host_ns,
            )
    table = rows.finish()
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
