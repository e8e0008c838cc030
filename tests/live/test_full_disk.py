"""A full disk: one line says so, nothing is half-written, and what else the program does goes on.

A file may grow up to a limit of the process, behind which the system takes a part of a write and then nothing, as a
full disk does.
"""

import asyncio
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from bottomlock.errors import OutputError
from bottomlock.export.live import export_live
from bottomlock.instruments.play import Channel, parse_address, play, sink_of
from bottomlock.instruments.schedule import Record
from bottomlock.live.engine import Engine, Message
from bottomlock.live.loop import cancel
from bottomlock.live.raw_log import RawLog
from bottomlock.live.replay import replay_log
from bottomlock.live.runner import Live
from bottomlock.live.transports import open_sink
from bottomlock.ports.address import sink_address
from tests.export.test_export_of_live_logs import text_of, write_log
from tests.live.world import START_NS, World, config

FULL = "File too large"
"""The system's words for the limit."""


@contextmanager
def room_for(most_bytes: int) -> Iterator[None]:
    """Within it no file grows beyond so many bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_of_an_export_every_file_is_whole_or_not_there(tmp_path: Path) -> None:
    """The file without room is named; the others are those of a disk with room, on which the same call ends."""
    settings, log, _ = write_log(tmp_path, text_of("navigation"), World(3.0))
    formats = ["tum", "mcap", "kml"]
    export_live(settings, log, formats)
    folder = log.with_name(f"{log.stem}_export")
    whole = {path.name: path.read_bytes() for path in folder.iterdir()}
    for path in folder.iterdir():
        path.unlink()
    with (
        room_for(len(whole["tracks.mcap"]) - 1),
        pytest.raises(OutputError, match=rf"tracks\.mcap: cannot be written \({FULL}\)"),
    ):
        export_live(settings, log, formats)
    left = {path.name: path.read_bytes() for path in folder.iterdir() if not path.name.endswith(".json")}
    assert left == {"live.tum": whole["live.tum"]}
    export_live(settings, log, formats)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == whole


def test_a_file_as_target_holds_whole_messages_and_ends(tmp_path: Path) -> None:
    """They are appended, and there at once. What finds no room is dropped and said once; later ones follow whole."""
    path = tmp_path / "out"
    path.write_bytes(b"before\n")
    said: list[str] = []
    messages = [b"%04d" % k * 25 for k in range(6)]

    async def run() -> None:
        sink = open_sink(sink_address(f"file:{path}"), said.append)
        task = asyncio.create_task(sink.run())
        await asyncio.sleep(0)
        with room_for(257):
            assert [sink.write(data) for data in messages[:5]] == [True, True, False, False, False]
            assert sink.state == f"cannot be written: {FULL}"
            assert path.read_bytes() == b"".join([b"before\n", *messages[:2]])
        assert sink.write(messages[5])
        assert (sink.written[0], sink.dropped[0], sink.state) == (3, 3, "writing")
        with room_for(357):
            sink.write(messages[0])
            async with asyncio.timeout(5.0):
                await cancel(task)

    asyncio.run(run())
    assert path.read_bytes() == b"".join([b"before\n", *messages[:2], messages[5]])
    assert said == [f"cannot be written: {FULL}"]


def test_a_simulated_instrument_ends_with_a_whole_record(tmp_path: Path) -> None:
    sink = sink_of(parse_address(f"file:{tmp_path / 'out'}", "--dvl"))
    channel = Channel("dvl", sink, lambda _: iter([Record(k, b"%099d\n" % k) for k in range(5)]))
    with room_for(250), pytest.raises(OutputError, match=rf"out: cannot be written: {FULL}"):
        asyncio.run(
            play([channel], speed=None, opened=lambda: None, offset_ns=lambda: 0, sent=lambda *_: None)
        )
    assert (tmp_path / "out").read_bytes() == b"%099d\n%099d\n" % (0, 1)


def test_navigation_goes_on_without_raw_log_and_checkpoint(tmp_path: Path) -> None:
    """Each is said once; the log gives, up to where it was cut off, the bits that were sent."""
    file = tmp_path / "checkpoint"
    settings = config("navigation", extra=f'[checkpoint]\nfile = "{file}"\n')
    log = RawLog(tmp_path, sources=["dvl", "imu"], ports=["probe"], start={})
    said: list[str] = []
    sent: list[Message] = []
    now_ns = START_NS
    live = Live(
        settings, Engine(settings), say=said.append, log=log, send=sent.append,
        clock=lambda: now_ns, real_time=False,
    )  # fmt: skip
    arrivals = list(World(4.0).arrivals(imu=True))
    with room_for(40_000):
        for now_ns, source, data in arrivals[: len(arrivals) // 2]:  # noqa: B007 - the clock's
            live.arrive(source, data)
        before = len(sent)
    with room_for(100):
        for now_ns, source, data in arrivals[len(arrivals) // 2 :]:  # noqa: B007
            live.arrive(source, data)
            live.save()
            if live._saved is not None:
                live._saved.result()
    live.save()
    live.close()
    assert len(sent) > before > 5
    lost = [words for words in said if FULL in words]
    assert [words.partition(":")[0] for words in lost] == ["raw log ended", "no checkpoint"]
    assert said[-1] == "checkpoints are written again"
    assert file.is_file()
    assert [path.name for path in tmp_path.iterdir() if path.name.endswith(".part")] == []
    result = replay_log(config("navigation"), log.path)
    assert (result.first_difference, result.damaged) == ("", False)
    assert 0 < result.sent < len(sent)
