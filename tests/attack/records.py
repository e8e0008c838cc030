"""Damages the records of every format and demands a sound table or an error of one line, and never a mixed ping.

Whole records are damaged (bits, length; cut, dropped, repeated), where `tools/fuzz_readers.py` changes any bytes.
"""

import functools
import random
import struct
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from bottomlock.errors import BottomlockError
from bottomlock.io import table as table_format
from bottomlock.io.beam_table import BeamTable, Recording
from bottomlock.io.formats import BYTES
from bottomlock.io.rows import Options
from tests.attack import logs
from tools.fuzz_readers import fault_of

TABLES = ("table-csv", "table-parquet")
"""The plain tables, read from a file."""
_FORMS = {form.name: form for form in BYTES}


def damage(log: logs.Log, rng: random.Random) -> list[bytes]:
    """The records, some of them flipped, changed in length, cut, dropped or repeated."""
    share = rng.choice((0.05, 0.2, 0.5))
    found: list[bytes] = []
    first, last = log.kept, len(log.records) - log.last
    for k, record in enumerate(log.records):
        if first <= k < last and rng.random() < share:
            found += _damaged(record, log, rng)
        else:
            found.append(record)
    return found


def _damaged(record: bytes, log: logs.Log, rng: random.Random) -> list[bytes]:
    kind = rng.randrange(7)
    work = bytearray(record)
    at = rng.randrange(len(work))
    if kind == 0:
        work[at] ^= 1 << rng.randrange(8)
    elif kind == 1:
        return []
    elif kind == 2:
        return [record, record]
    elif kind == 3:
        # A text record keeps its line end, or loses it and runs into the next line.
        return [record[:at] + (b"\n" if log.length_at is None and rng.random() < 0.5 else b"")]
    elif kind == 4:
        # Without checksums, a line that lost its end and the next its beginning may look like a whole one.
        return [record[at:]] if log.checksum else []
    elif kind == 5:
        work[at:at] = rng.randbytes(rng.randint(1, 30))
    elif log.length_at is None:
        del work[at : min(at + rng.randint(1, 30), len(work) - 1)]
    else:
        length = rng.choice((0, 1, 0xFFFF, rng.randrange(0x10000), len(record) + rng.randint(-4, 4)))
        struct.pack_into("<H", work, log.length_at, length)
    return [bytes(work)]


Owners = Mapping[float, frozenset[tuple[str, int]]]


def _columns(table: BeamTable) -> Iterator[tuple[str, np.ndarray]]:
    """The columns whose every number names its ping."""
    for name in ("velocity_mps", "range_m", "instrument_mps"):
        block = getattr(table, name)
        for k in range(block.shape[1]):
            yield f"{name}[{k}]", block[:, k]


@functools.cache
def clean(name: str, seed: int) -> tuple[logs.Log, Recording, Owners]:
    """A log, what it gives undamaged, and the columns and pings of every number."""
    log = logs.build(name, seed)
    recording = read(name, logs.joined(log.records))
    owners: dict[float, set[tuple[str, int]]] = {}
    for column, values in _columns(recording.table):
        for k, value in enumerate(values.tolist()):
            if np.isfinite(value):
                owners.setdefault(value, set()).add((column, k))
    return log, recording, {value: frozenset(places) for value, places in owners.items()}


def read(name: str, data: bytes) -> Recording:
    """Reads a file of a format from its bytes."""
    return _FORMS[name].read(data, "attack", Options())


def mixed(recording: Recording, whole: Recording, owners: Owners, *, checksum: bool = True) -> str | None:
    """Says which ping holds numbers of two, or holds less than it did without a remark in the account; else None.

    Without a `checksum` a changed validity flag passes for a good one, as any changed digit.
    """
    table = recording.table
    pings: list[set[int] | None] = [None] * table.rows
    for column, values in _columns(table):
        for row, value in enumerate(values.tolist()):
            places = owners.get(value)
            if places is None:
                continue  # none, or changed: a format without checksums cannot show it
            here = {k for where, k in places if where == column}
            if not here:
                return f"row {row}: {column} holds a number of {min(places)}"
            named = pings[row]
            pings[row] = here if named is None else named & here
            if not pings[row]:
                return f"row {row}: numbers of two pings"
    account = recording.account
    for row, named in enumerate(pings):
        if not named:
            continue
        fewer = table.valid[row].sum() < whole.table.valid[min(named)].sum()
        if checksum and fewer and not (account.flagged or account.skipped):
            return f"row {row}: beams are missing without a remark"
        if (table.time_ns[row] in whole.table.time_ns) and not any(
            whole.table.time_ns[k] == table.time_ns[row] for k in named
        ):
            return f"row {row}: numbers of one ping, time of another"
    return None


def attack_bytes(name: str, seed: int, rng: random.Random) -> str | None:
    """One damaged log of a format read from bytes; the fault, or None."""
    log, whole, owners = clean(name, seed)
    data = logs.joined(damage(log, rng))
    _FORMS[name].sniff(data)
    try:
        recording = read(name, data)
    except BottomlockError as error:
        return "an error of several lines" if "\n" in str(error) else None
    return fault_of(recording, data) or mixed(recording, whole, owners, checksum=log.checksum)


@functools.cache
def _table_bytes(name: str) -> bytes:
    """The table of a log as a file holds it."""
    _, recording, _ = clean("waterlinked-json", 0)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "log")
        frame = recording.table.to_frame()
        if name == "table-csv":
            frame.write_csv(path)
        else:
            frame.write_parquet(path, compression="uncompressed")
        return path.read_bytes()


def attack_table(name: str, folder: Path, rng: random.Random) -> str | None:
    """One damaged plain table; the fault, or None."""
    work = bytearray(_table_bytes(name))
    for _ in range(rng.choice((1, 1, 2, 5))):
        at = rng.randrange(len(work))
        kind = rng.randrange(4)
        if kind == 0:
            work[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            work[at] = rng.randrange(256)
        elif kind == 2:
            del work[at : at + rng.randint(1, 40)]
        else:
            work[at:at] = rng.choice((b"9" * 30, b"1e300", b"-1", b"\n", b",", b"\x00", b"nan", b"\xff"))
    path = folder / f"log.{name.removeprefix('table-')}"
    path.write_bytes(work)
    try:
        recording = table_format.read_path(path, "attack")
    except BottomlockError as error:
        return "an error of several lines" if "\n" in str(error) else None
    return fault_of(recording, bytes(work))
