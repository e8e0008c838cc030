"""Damaged or dropped records: a ping is as it was, or marked incomplete; no ping holds numbers of two."""

import random
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bottomlock.encoders import framing
from bottomlock.io import waterlinked_json, waterlinked_serial
from bottomlock.io.formats import BYTES
from bottomlock.io.rows import Options
from tests.attack import logs, records
from tools import reader_seeds as seeds

NAMES = sorted(logs.BUILDERS)


def test_every_reader_of_bytes_is_attacked() -> None:
    """A new format with beams has to come with a log of distinct pings."""
    assert set(logs.BUILDERS) == {form.name for form in BYTES}


@pytest.mark.parametrize("name", NAMES)
def test_the_undamaged_log_is_read_whole(name: str) -> None:
    """Every ping of the generator, every beam valid: what the law compares with."""
    _, whole, _ = records.clean(name, 0)
    assert whole.table.rows == logs.PINGS
    assert whole.table.valid.all()
    assert not whole.account.skipped
    assert records.mixed(whole, whole, records.clean(name, 0)[2]) is None


@given(st.sampled_from(NAMES), st.randoms(use_true_random=False))
def test_a_ping_is_as_it_was_or_marked_incomplete(name: str, rng: random.Random) -> None:
    """Any records flipped, cut, dropped, repeated or of another length."""
    assert records.attack_bytes(name, 0, rng) is None


@given(st.sets(st.integers(0, 5 * (logs.PINGS - 1) - 1)))
def test_dropped_lines_of_the_serial_protocol(dropped: set[int]) -> None:
    """No line names its ping: lines that are gone without a trace are found by the interval of the next report."""
    log, whole, owners = records.clean("waterlinked-serial", 0)
    assert whole is not None
    left = logs.joined([line for k, line in enumerate(log.records) if k not in dropped])
    assert records.mixed(waterlinked_serial.FORMAT.read(left, "log"), whole, owners) is None


def _pings(*velocities: float) -> list[bytes]:
    """Lines of pings 125 ms apart, whose four beams all read the same."""
    lines = []
    for j, v in enumerate(velocities):
        at = 1_000_000 + 125_000 * j
        lines.append(f"wrz,{v},0,0,y,2.0,0.002,0;0;0;0;0;0;0;0;0,{at},{at},125.0,0")
        lines += [f"wru,{k},{v},2.0,-40,-95" for k in range(4)]
    return [framing.waterlinked_sentence(line.encode()) for line in lines]


def test_lines_gone_without_a_trace_cost_the_ping_before() -> None:
    """Two of its own, the report and two of the next: the rest would pass for one ping."""
    lines = _pings(10.0, 11.0, 12.0)
    recording = waterlinked_serial.FORMAT.read(b"".join(lines[:3] + lines[8:]), "log")
    assert recording.table.valid.tolist() == [[False] * 4, [True] * 4]
    (flag,) = (name for name in recording.account.flagged if "may be another's" in name)
    assert recording.account.flagged[flag].first == 1


def test_lines_of_a_logger_are_joined() -> None:
    """A time stamp before every sentence is no lost line; a word that stands there once is."""
    lines = [b"%d.%02d " % (9 + k, k) + line for k, line in enumerate(_pings(10.0, 11.0))]
    assert waterlinked_serial.FORMAT.read(b"".join(lines), "log").table.valid.all()
    lines[7] = b"xrz,1 " + lines[7]
    assert waterlinked_serial.FORMAT.read(b"".join(lines), "log").table.beams_valid.tolist() == [4, 1]


@pytest.mark.parametrize(("clock", "times"), [("reports", [100, 200, 300, 400]), ("distinct", [100, 200])])
def test_both_clocks_of_a_log_with_repeats(clock: str, times: list[int]) -> None:
    """Without time stamps an exact repeat adds its interval to the clock, or is left out; both sums are told."""
    log = seeds.a50_report(0) + seeds.a50_report(1) * 3
    recording = waterlinked_json.FORMAT.read(log, "log", Options(clock=clock))  # type: ignore[arg-type]
    assert (recording.table.time_ns // 1_000_000).tolist() == times
    (note,) = (note for note in recording.notes if "byte for byte" in note)
    assert note.startswith("2 reports repeat")
    assert "0.4 s with them (--clock reports) and 0.2 s without (--clock distinct)" in note
    assert not any("missing from that sum" in note for note in recording.notes)


@pytest.mark.parametrize("name", records.TABLES)
def test_damaged_plain_tables(name: str, tmp_path: Path) -> None:
    """Bits, bytes and words of a table: what is read keeps what tables promise, or is an error of one line."""
    rng = random.Random(20)
    assert [fault for _ in range(60) if (fault := records.attack_table(name, tmp_path, rng))] == []
