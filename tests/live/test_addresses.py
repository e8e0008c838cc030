"""Every kind of source gives the bytes that came, every kind of target the bytes that were written."""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from bottomlock.live.loop import cancel
from bottomlock.live.transports import open_source
from bottomlock.ports.address import source_address
from tests.live.world import World

DATA = b"".join(data for _, _, data in World(1.0).arrivals())
LIMIT_S = 10.0


@pytest.fixture
def terminal() -> Iterator[tuple[int, str]]:
    """A serial line without hardware: the instrument's end, and the device at ours."""
    pytest.importorskip("serial_asyncio_fast", reason="needs pyserial-asyncio-fast (extra live)")
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    yield ours, os.ttyname(theirs)
    for one in (ours, theirs):
        os.close(one)


async def until(condition: Callable[[], bool]) -> None:
    """Waits for a condition."""
    async with asyncio.timeout(LIMIT_S):
        while not condition():  # noqa: ASYNC110 - what is waited for has no event
            await asyncio.sleep(0.005)


async def taken(address: str, write: Callable[[], None] | None = None) -> bytes:
    """What a source gives of `DATA`, which `write` puts there once it is open."""
    found, opened = bytearray(), asyncio.Event()

    def take(data: bytes) -> bool:
        found.extend(data)
        return True

    source = open_source(
        source_address(address), lambda _: None, on_data=take, on_connected=opened.set, silence_s=60.0
    )
    task = asyncio.create_task(source.run())
    async with asyncio.timeout(LIMIT_S):
        await opened.wait()
    if write is not None:
        write()
    await until(lambda: len(found) >= len(DATA))
    await cancel(task)
    return bytes(found)


def test_a_serial_line_as_source(terminal: tuple[int, str]) -> None:
    """Raw bytes, none of which a terminal changes."""
    end, device = terminal
    assert asyncio.run(taken(f"serial:{device}:115200", lambda: put(end))) == DATA


def put(end: int) -> None:
    """Writes `DATA`, less than a terminal holds."""
    assert os.write(end, DATA) == len(DATA)


def test_a_fifo_as_source(tmp_path: Path) -> None:
    """It is opened before there is a writer."""
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)

    def write() -> None:
        end = os.open(fifo, os.O_WRONLY | os.O_NONBLOCK)
        put(end)
        os.close(end)

    assert asyncio.run(taken(f"file:{fifo}", write)) == DATA


def test_stdin_and_stdout(tmp_path: Path) -> None:
    """A process in a pipe: reports in, sentences out, exit code 0 where its input ends."""
    path = tmp_path / "live.toml"
    path.write_text("""
        name = "pipe"
        mode = "velocity"
        dvl = { geometry = "waterlinked_a50", beam_noise_mps = 0.01 }
        source = [{ name = "dvl", address = "stdin", format = "waterlinked-json", rate_hz = 10, clock = "arrival" }]
        port = [{ port = "sentence", to = "stdout", rate_hz = 10 }]
    """)
    done = subprocess.run(
        [sys.executable, "-m", "bottomlock", "live", path],
        input=DATA, capture_output=True, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert len(lines) >= 1
    assert all(line.startswith(b"$PBLK") for line in lines)
