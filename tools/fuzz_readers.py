"""Feeds mutated records to every reader of bytes: `python -m tools.fuzz_readers --inputs 10000000 --seconds 7200`.

A reader may make a table that keeps what every table promises, or refuse with a DataError of one line; anything else
(another exception, more than a second, more rows than bytes) is a finding, written to a folder and counted. Half of the
mutated records get their checksums made right again, so that the fields behind them are reached.
"""

import random
import re
import resource
import signal
import struct
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import cyclopts
import numpy as np

from bottomlock.encoders import framing
from bottomlock.errors import DataError
from bottomlock.io.beam_table import Recording
from bottomlock.io.decoder import Format
from bottomlock.io.formats import BYTES
from bottomlock.io.rows import Options
from tools import reader_seeds

# Of processor time: a busy machine is not the reader's fault.
LIMIT_S = 1.0
MEMORY_BYTES = 4 << 30
LONGEST = 8192
TOLD = 500_000
OPTIONS = (Options(), Options(instrument_only=True), Options(keep_stale=True, negate_beams=True))
INTERESTING = (
    b"\x00", b"\xff", b"\x7f\x7f", b"\xa5", b"\n", b",", b"*", b"$", b"-", b"nan", b"inf", b"1e999", b"-1", b"+-", b"{",
    b"}", b"[", b'"', b":", b"=", b"wr", b"\x00\x80", b"\xff\x7f", b"\xff\xff\xff\xff", b"9" * 30,
    b"99999999999999999999", b"null", b"true", b"1e-400", b"\r\n\r\n", b"$PNORBT0,", b"wru,0,",
)  # fmt: skip


def mutate(data: bytes, rng: random.Random, others: list[bytes]) -> bytes:
    """A record changed in one to six places."""
    work = bytearray(data)
    for _ in range(rng.randint(1, 6) if rng.random() < 0.7 else 1):
        size = len(work)
        at = rng.randrange(size + 1)
        kind = rng.randrange(9)
        if kind == 0 and size:
            work[at % size] ^= 1 << rng.randrange(8)
        elif kind == 1 and size:
            work[at % size] = rng.randrange(256)
        elif kind == 2:
            del work[at : at + rng.randint(1, 40)]
        elif kind == 3:
            work[at:at] = work[at : at + rng.randint(1, 200)]
        elif kind in {4, 5}:
            chosen = rng.choice(INTERESTING)
            work[at : at + (len(chosen) if kind == 5 else 0)] = chosen
        elif kind == 6:
            other = rng.choice(others)
            start = rng.randrange(len(other) + 1)
            work[at:] = other[start:]
        elif kind == 7:
            del work[at:]
        elif size >= 2:
            at %= size - 1
            word = (struct.unpack_from("<H", work, at)[0] + rng.randint(-4, 4)) & 0xFFFF
            struct.pack_into("<H", work, at, word)
    return bytes(work[:LONGEST])


def _right_pd0(data: bytes) -> bytes:
    work, at = bytearray(data), 0
    while (at := work.find(b"\x7f\x7f", at)) >= 0 and at + 4 <= len(work):
        end = at + struct.unpack_from("<H", work, at + 2)[0]
        if at + 8 <= end <= len(work) - 2:
            struct.pack_into("<H", work, end, sum(work[at:end]) & 0xFFFF)
            at = end
        at += 2
    return bytes(work)


def _right_nortek(data: bytes) -> bytes:
    work, at = bytearray(data), 0
    while (at := work.find(b"\xa5", at)) >= 0 and at + 10 <= len(work):
        header, size = work[at + 1], struct.unpack_from("<H", work, at + 4)[0]
        start = at + header
        if 10 <= header <= 64 and start + size <= len(work):
            struct.pack_into("<H", work, at + 6, framing.nortek_sum(bytes(work[start : start + size])))
            struct.pack_into("<H", work, start - 2, framing.nortek_sum(bytes(work[at : start - 2])))
            at = start + size - 1
        at += 1
    return bytes(work)


def _right_crc(data: bytes) -> bytes:
    sentence = re.compile(rb"(wr[a-z][^*\r\n]{0,300})\*..", re.DOTALL)
    return sentence.sub(lambda m: m[1] + b"*%02x" % framing.crc8(m[1]), data)


def _right_nmea(data: bytes) -> bytes:
    sentence = re.compile(rb"\$([^*\r\n]{0,600})\*..", re.DOTALL)
    return sentence.sub(lambda m: reader_seeds.nmea(m[1])[:-2], data)


RIGHT: dict[str, Callable[[bytes], bytes]] = {
    "pd0": _right_pd0,
    "nortek-dvl": _right_nortek,
    "nortek-ad2cp": _right_nortek,
    "nucleus": _right_nortek,
    "waterlinked-serial": _right_crc,
    "nortek-ascii": _right_nmea,
    "cerulean-dvkfc": _right_nmea,
}


def fault_of(recording: Recording, data: bytes) -> str | None:
    """What a table breaks of what every table promises, or None."""
    table = recording.table
    if table.rows == 0 or table.rows != recording.account.kept:
        return f"{table.rows} rows, {recording.account.kept} counted as kept"
    if table.rows > len(data) or table.beams > 8:
        return f"{table.rows} rows of {table.beams} beams from {len(data)} bytes"
    if not (np.diff(table.time_ns) > 0).all():
        return "times that do not rise"
    if not np.isfinite(table.velocity_mps[table.valid]).all():
        return "a valid beam without a finite velocity"
    if np.isinf(table.velocity_mps).any() or np.isinf(table.instrument_mps).any():
        return "an infinity"
    arrays = (table.velocity_mps, table.valid, table.range_m, table.quality, table.sd_mps)
    shapes, lengths = {array.shape for array in arrays}, {len(one) for one in table.extra.values()}
    if shapes != {(table.rows, table.beams)} or lengths - {table.rows}:
        return f"arrays of shapes {shapes}"
    return None


def try_one(form: Format, data: bytes, options: Options) -> str | None:
    """Reads an input; says what went wrong, or None."""
    try:
        form.sniff(data)
        recording = form.read(data, "fuzz", options)
        recording.to_json()
        return fault_of(recording, data)
    except DataError as error:
        return "an error of several lines" if "\n" in str(error) else None
    except Exception as error:  # noqa: BLE001 - that is what is looked for
        return f"{type(error).__name__}: {error}"


def run(inputs: int, seconds: float, seed: int, found: Path | None) -> tuple[dict[str, int], list[str]]:
    """Mutates until the number or the time is reached; counts by format and what was found."""

    def late(_: int, __: object) -> NoReturn:
        raise TimeoutError(f"more than {LIMIT_S} s")

    rng = random.Random(seed)  # noqa: S311 - no secrets here
    material = reader_seeds.seeds()
    forms = {form.name: form for form in BYTES}
    names = sorted(material)
    everything = [one for many in material.values() for one in many]
    counts = dict.fromkeys(names, 0)
    faults: list[str] = []
    until = time.monotonic() + seconds
    before = signal.signal(signal.SIGPROF, late)
    try:
        for k in range(inputs):
            if k % 1000 == 0 and time.monotonic() > until:
                break
            if k and k % TOLD == 0 and found is not None:
                print(f"{k} inputs, {len(faults)} findings", flush=True)
            name = names[k % len(names)]
            others = everything if rng.random() < 0.1 else material[name]
            data = mutate(rng.choice(material[name]), rng, others)
            if name in RIGHT and rng.random() < 0.5:
                data = RIGHT[name](data)
            signal.setitimer(signal.ITIMER_PROF, LIMIT_S)
            fault = try_one(forms[name], data, OPTIONS[k // len(names) % len(OPTIONS)])
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            counts[name] += 1
            if fault is not None:
                faults.append(f"{name}: {fault}")
                if found is not None:
                    found.mkdir(parents=True, exist_ok=True)
                    (found / f"{name}-{k}.bin").write_bytes(data)
    except KeyboardInterrupt:
        print("interrupted", flush=True)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
    return counts, faults


def main(
    *, inputs: int = 1_000_000, seconds: float = 3600.0, seed: int = 0, found: Path = Path("out/fuzz")
) -> int:
    """Feeds mutated records to every reader of bytes; the exit code is 1 for a finding, written to `--found`."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    start = time.monotonic()
    counts, faults = run(inputs, seconds, seed, found)
    spent = time.monotonic() - start
    for name, count in counts.items():
        print(f"{name:20} {count:>10}")
    total = sum(counts.values())
    rate = total / max(spent, 1e-9)
    print(f"{total} inputs in {spent:.0f} s ({rate:.0f} a second), {len(faults)} findings")
    for fault, times in sorted(Counter(faults).items())[:50]:
        print(f"  {times} x {fault}")
    return int(bool(faults))


if __name__ == "__main__":
    cyclopts.run(main)
