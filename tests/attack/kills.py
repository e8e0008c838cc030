"""Kills campaigns at random moments, and demands that no finished chunk is lost or run again, and the same bits.

`attack(seed, count)` kills `count` processes and returns a line per fault.
"""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from unittest.mock import patch

from bottomlock.campaign import chunk
from bottomlock.campaign.run import run_campaign
from tests.campaign.small_campaign import STEPS_OF_TWO_RUNS, same_bits, short

ROOT = Path(__file__).resolve().parents[2]

RUNS = 300
"""A hundred and fifty chunks: some seconds."""

KILLS_A_CAMPAIGN = 5
"""After so many kills a campaign is run to its end and compared."""

COMMAND = f"""
import sys
import warnings
from pathlib import Path
from bottomlock.campaign import chunk
from bottomlock.campaign.run import run_campaign
from bottomlock.errors import Note
from tests.campaign.small_campaign import STEPS_OF_TWO_RUNS, short
chunk.CHUNK_STEPS = STEPS_OF_TWO_RUNS
warnings.simplefilter("error", Note)
warnings.filterwarnings("ignore", ".*was left by process", Note)
run_campaign([short({RUNS})], Path(sys.argv[1]), threads=1)
"""


def attack(seed: int, count: int) -> list[str]:
    """Kills `count` campaigns with SIGKILL, half of them anywhere from the start of the process, half between chunks.

    A kill that comes after the end of the process does not count.

    Returns:
        A line per fault.
    """
    rng = random.Random(seed)
    faults: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "whole"
        with patch.object(chunk, "CHUNK_STEPS", STEPS_OF_TWO_RUNS):
            run_campaign([short(RUNS)], whole, threads=1)
        killed, number = 0, 0
        while killed < count:
            number += 1
            out = Path(folder) / f"campaign{number}"
            for _ in range(min(KILLS_A_CAMPAIGN, count - killed)):
                before = finished(out)
                killed += _kill(out, rng, anywhere=rng.random() < 0.5)
                faults += _lost(before, finished(out), f"campaign {number}, kill {killed}")
            faults += _resumed(whole, out, f"campaign {number}")
    return faults


def finished(out: Path) -> dict[Path, int]:
    """The files of finished chunks, with the time of their writing."""
    records = out.glob("chunks/straight/record-*")
    return {
        path: path.stat().st_mtime_ns
        for record in records
        for path in (record, record.with_name(f"{record.stem.replace('record', 'samples')}.parquet"))
    }


def _kill(out: Path, rng: random.Random, *, anywhere: bool) -> bool:
    """Whether the process was killed, before its end."""
    before = len(finished(out))
    process = subprocess.Popen([sys.executable, "-c", COMMAND, str(out)], cwd=ROOT)
    # In the middle of its chunks, however long the start of the process takes.
    while not anywhere and len(finished(out)) == before and process.poll() is None:
        time.sleep(0.001)
    time.sleep(rng.uniform(0.0, 1.2 if anywhere else 0.2))
    process.send_signal(signal.SIGKILL)
    return process.wait() == -signal.SIGKILL


def _lost(before: dict[Path, int], after: dict[Path, int], place: str) -> list[str]:
    return [
        f"{place}: {path.name} was finished, and was lost or written again"
        for path, written in before.items()
        if after.get(path) != written
    ]


def _resumed(whole: Path, out: Path, place: str) -> list[str]:
    """Runs a campaign to its end and compares it with one that was never killed."""
    before = finished(out)
    done = subprocess.run(
        [sys.executable, "-c", COMMAND, str(out)], cwd=ROOT, check=False, capture_output=True, text=True
    )
    if done.returncode:
        return [f"{place}: does not resume: {done.stderr.strip().splitlines()[-1]}"]
    faults = _lost(before, finished(out), f"{place}, resumed")
    try:
        same_bits(whole, out)
    except (AssertionError, OSError) as error:
        faults.append(f"{place}: other bits: {error}")
    leftovers = [path.name for path in out.rglob(".*") if path.is_file()]
    return faults + [f"{place}: {name} stays behind" for name in leftovers]
