"""Speed of every reader, MB of log a second of processor time: `python benches/readers.py [FOLDER OF RECORDINGS]`.

A stream comes record by record; its time is that of an hour at 10 Hz, which may be 10 s.
Made logs (tests/attack/logs.py) are repeated; hostile inputs (tests/attack/adversaries.py) are lengthened to `--size`.
Prints a Markdown table.
"""

import argparse
import contextlib
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bottomlock.errors import DataError
from bottomlock.io.beam_table import MOST_BEAMS
from bottomlock.io.decoder import Format
from bottomlock.io.formats import BYTES, detect
from bottomlock.io.rows import PLAIN
from tests.attack import logs
from tests.attack.adversaries import ADVERSARIES

MEGABYTE = 1e6
FORMS = {form.name: form for form in BYTES}
RECORDED = {
    "pd0": "*/*.PD0",
    "waterlinked-json": "a50_waterlinked_json/*.txt",
    "linkquest-csv": "caves_girona_linkquest/dvl_linkquest.csv",
    "nortek-ad2cp": "pd0_nortek_mhkit/*.ad2cp",
}


def speed(form: Format, data: bytes) -> float:
    """MB a second of processor time, of `sniff` and `read` together."""
    start = time.process_time()
    form.sniff(data[:65_536])
    with contextlib.suppress(DataError):
        form.read(data, "log", PLAIN)
    return len(data) / MEGABYTE / max(time.process_time() - start, 1e-9)


def hour_s(form: Format, pings: int = 2000) -> float:
    """Processor time of 36,000 pings of a stream that comes record by record, from so many of a made log."""
    records = logs.build(form.name, 0).records
    decoder, found, at = form.decoder("log", PLAIN, MOST_BEAMS), 0, 0
    start = time.process_time()
    while found < pings:
        decoder.feed(records[at % len(records)])
        found, at = found + len(decoder.take()), at + 1
    return (time.process_time() - start) / found * 36_000


def made(name: str, size: float) -> bytes:
    """A made log repeated to a size; times repeat, so that most pings are left out at the end."""
    data = logs.joined(logs.build(name, 0).records)
    return data * max(1, int(size / len(data)))


def main() -> int:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recordings", nargs="?", type=Path)
    parser.add_argument("--size", type=float, default=4.0, help="of a hostile input, MB")
    parser.add_argument("--only", help="name of one format")
    chosen = parser.parse_args()
    size = chosen.size * MEGABYTE
    print(
        "| Format | Hostile, slowest MB/s | Made log, MB/s | Recording, MB/s | Stream of an hour, s |\n"
        "|---|---|---|---|---|",
        flush=True,
    )
    for name, form in FORMS.items():
        if chosen.only not in {None, name}:
            continue
        hostile = [speed(form, one * max(1, int(size / len(one)))) for one in ADVERSARIES[name]]
        if chosen.only:
            print(", ".join(f"{one:.1f}" for one in hostile))
        recorded = ""
        if chosen.recordings is not None and name in RECORDED:
            files = [one for one in sorted(chosen.recordings.glob(RECORDED[name])) if detect(one) == name]
            data = b"".join(one.read_bytes() for one in files)
            recorded = f"{speed(form, data):.1f}"
        stream = f"{hour_s(form):.1f}" if form.live else ""
        print(
            f"| `{name}` | {min(hostile):.1f} | {speed(form, made(name, size / 4)):.1f} | {recorded} | {stream} |",
            flush=True,
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
