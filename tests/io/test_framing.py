"""Byte streams cut into pings: any pieces give the same pings, and they are those of the reader of files."""

import random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bottomlock.errors import DataError
from bottomlock.io.beam_table import BeamTable
from bottomlock.io.formats import BYTES
from bottomlock.io.framing import Lines
from bottomlock.io.rows import Options, longest_rising
from bottomlock.live.readings import PingReader
from bottomlock.recordings.readings import Ping
from tools import reader_seeds as seeds

FORMATS = sorted(one.name for one in BYTES if one.live)
READ = {one.name: one.read for one in BYTES}
STREAMS = {name: seeds.seeds()[name] for name in FORMATS}
# One firmware: a stream of reports with and without a clock has no time of its own.
STREAMS["waterlinked-json"] = [
    seeds.a50_report(step, version="json_v3.1", lost=lost)
    for step, lost in ((0, ()), (0, ()), (1, (2,)), (2, (0, 1, 2, 3)), (3, ()))
] + [b'{"ts":1.0,"x":2.0,"type":"position_local","format":"json_v3.1"}\n']
STREAMS["waterlinked-serial"] = [
    b"".join(line for line in data.splitlines(keepends=True) if b"wrx" not in line)
    for data in STREAMS["waterlinked-serial"]
    if b"wrz" in data
]


def read_in_pieces(name: str, data: bytes, cuts: list[int], beams: int) -> tuple[list[Ping], dict[str, int]]:
    """The pings of a stream that comes in pieces, with what is held at its end, and what was skipped."""
    reader, found, at = PingReader(name, beams), [], 0
    for cut in [*sorted(cuts), len(data)]:
        found += reader.feed(data[at:cut])
        at = cut
    return found + reader.flush(), dict(reader.skipped)


def in_pieces(name: str, data: bytes, cuts: list[int], beams: int) -> list[Ping]:
    """The pings alone."""
    return read_in_pieces(name, data, cuts, beams)[0]


def same(ping: Ping, table: BeamTable, row: int) -> None:
    """A ping of a stream is a row of the table, to the bit."""
    assert ping.time_ns == table.time_ns[row]
    width = table.beams
    np.testing.assert_array_equal(ping.valid[:width], table.valid[row])
    np.testing.assert_array_equal(ping.velocity_mps[:width], table.velocity_mps[row])
    np.testing.assert_array_equal(ping.range_m[:width], table.range_m[row])
    np.testing.assert_array_equal(ping.sd_mps[:width], table.sd_mps[row])
    np.testing.assert_array_equal(ping.instrument_mps, table.instrument_mps[row])
    assert ping.stale == (table.stale is not None and bool(table.stale[row]))


def as_in_file(name: str, data: bytes, pings: list[Ping]) -> None:
    """The pings in the order of their times are those of the reader of files."""
    try:
        table = READ[name](data, "log", seeds_options(name)).table
    except DataError:
        assert not pings
        return
    kept = [pings[k] for k in longest_rising([ping.time_ns for ping in pings])]
    assert len(kept) == table.rows
    for row, ping in enumerate(kept):
        same(ping, table, row)


def seeds_options(name: str) -> Options:
    """A serial report without transducers is a ping with all beams lost."""
    return Options(instrument_only=name == "waterlinked-serial")


def beams_of(name: str) -> int:
    """Beams of the instruments of the seeds."""
    return 3 if name in {"nucleus", "cerulean-dvkfc"} else 4


@pytest.mark.first_cases(2)
@pytest.mark.parametrize("name", FORMATS)
@given(data=st.data())
def test_any_pieces_give_the_pings_of_the_file(name: str, data: st.DataObject) -> None:
    """Seeds of the readers in a row, cut anywhere."""
    streams = data.draw(st.lists(st.sampled_from(STREAMS[name]), min_size=1, max_size=3))
    stream = b"".join(streams)
    cuts = data.draw(st.lists(st.integers(0, len(stream)), max_size=12))
    pings = in_pieces(name, stream, cuts, beams_of(name))
    whole = in_pieces(name, stream, [], beams_of(name))
    assert [ping.time_ns for ping in pings] == [ping.time_ns for ping in whole]
    as_in_file(name, stream, pings)


@pytest.mark.parametrize("name", FORMATS)
def test_damage_in_any_pieces(name: str) -> None:
    """Bytes lost, changed and put in: pieces or the whole, pings and reasons are the same; also one byte at a time."""
    draw = random.Random(20_260)
    for _ in range(12):
        stream = bytearray(b"".join(draw.choices(STREAMS[name], k=3)))
        for _ in range(draw.randrange(4)):
            at = draw.randrange(len(stream))
            end = at + draw.choice([0, 1, 1, 30])
            stream[at:end] = draw.randbytes(draw.choice([0, 1, 3, 20]))
        content = bytes(stream)
        whole, skipped = read_in_pieces(name, content, [], beams_of(name))
        cuts = [draw.randrange(len(content)) for _ in range(draw.randrange(20))]
        for pieces in (cuts, list(range(len(content)))):
            found, why = read_in_pieces(name, content, pieces, beams_of(name))
            assert why == skipped
            assert [(p.time_ns, p.velocity_mps.tobytes(), p.valid.tolist()) for p in found] == [
                (p.time_ns, p.velocity_mps.tobytes(), p.valid.tolist()) for p in whole
            ]


@pytest.mark.parametrize("name", FORMATS)
def test_a_damaged_record_of_a_stream_has_its_reason(name: str) -> None:
    """Of a binary record too, of which the framer sees the damage; the ping after it is read."""
    good = STREAMS[name][0]
    bad = bytearray(good)
    bad[len(good) // 2 + 7 if name != "waterlinked-json" else 1] ^= 0x10
    reader = PingReader(name, beams_of(name))
    pings = reader.feed(bytes(bad)) + reader.feed(good) + reader.flush()
    assert pings
    assert any(one in {"bad checksum", "truncated", "merged line"} for one in reader.skipped)


def test_lines_too_long_are_dropped_whole() -> None:
    """However they come: the line after them is whole."""
    stream = b"x" * 30 + b"\nshort\n" + b"y" * 11 + b"\nlast\n"
    for step in (1, 4, 100):
        lines = Lines(10)
        found = [line for at in range(0, len(stream), step) for line in lines.feed(stream[at : at + step])]
        assert found == [b"short", b"last"]
        assert lines.dropped == 41


def test_a_serial_ping_is_there_with_its_fourth_transducer() -> None:
    """No wait for the next report: that would cost an interval."""
    lines = STREAMS["waterlinked-serial"][0].splitlines(keepends=True)
    reader = PingReader("waterlinked-serial", 4)
    first = next(k for k, line in enumerate(lines) if b"wrz" in line)
    assert not any(reader.feed(line) for line in lines[first : first + 4])
    assert len(reader.feed(lines[first + 4])) == 1
    assert not reader.waiting
