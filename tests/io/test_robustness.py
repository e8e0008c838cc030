"""Readers under damage: a table that keeps its promises or an error of one line, quickly, whatever the bytes."""

import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bottomlock.errors import DataError
from bottomlock.io.decoder import Format
from bottomlock.io.formats import BYTES
from bottomlock.io.rows import PLAIN, Options
from tests.attack.adversaries import ADVERSARIES
from tools import fuzz_readers, reader_seeds

FORMS = {form.name: form for form in BYTES}
SEEDS = reader_seeds.seeds()
NAMES = sorted(SEEDS)


def test_every_format_of_bytes_has_seeds() -> None:
    """A new reader has to come with records for the fuzzer."""
    assert set(SEEDS) == set(FORMS)


@pytest.mark.parametrize("name", NAMES)
def test_seeds_are_known_by_their_content_alone(name: str) -> None:
    """The first format whose mark fits is the right one, for every seed."""
    for data in SEEDS[name]:
        assert next(form.name for form in BYTES if form.sniff(data)) == name


def test_short_fuzzing() -> None:
    """Thousands of mutated records over all readers: no finding. The long run is tools/fuzz_readers.py."""
    counts, faults = fuzz_readers.run(4_000, 60.0, seed=7, found=None)
    assert faults == []
    assert min(counts.values()) > 50


@given(st.sampled_from(NAMES), st.data())
def test_records_are_counted_whole(name: str, data: st.DataObject) -> None:
    """A flipped bit loses no record in silence: what is not in the table or unchanged is in the account."""
    seed = SEEDS[name][0]
    options = Options(instrument_only=False)
    whole = FORMS[name].read(seed, "log", options)
    at = data.draw(st.integers(0, len(seed) - 1))
    flipped = bytearray(seed)
    flipped[at] ^= 1 << data.draw(st.integers(0, 7))
    try:
        found = FORMS[name].read(bytes(flipped), "log", options)
    except DataError:
        return
    told = found.account.skipped or found.account.flagged or found.account.other != whole.account.other
    assert found.table.rows >= whole.table.rows or told


@pytest.mark.parametrize("name", sorted(ADVERSARIES))
def test_no_input_makes_a_reader_hang(name: str) -> None:
    """An eighth of a megabyte of false starts costs seconds at most: a byte is looked at a bounded number of times.

    A reader that looks at every byte from every false start would take a quarter of an hour over the eighth.
    """
    form: Format = FORMS[name]
    for whole in ADVERSARIES[name]:
        data = whole[: len(whole) // 8]
        start = time.process_time()
        assert fuzz_readers.try_one(form, data, PLAIN) is None
        assert time.process_time() - start < 2.5


def test_times_that_do_not_rise_cost_their_own_rows() -> None:
    """One wild time in the future is one lost ping, and a repeated time another."""
    lines = [reader_seeds.a50_report(k, version="json_v3") for k in range(6)]
    wild = reader_seeds.a50_report(2, version="json_v3", time_of_validity=4_000_000_000_000_000)
    twice = reader_seeds.a50_report(3, version="json_v3", vx=0.7)
    recording = FORMS["waterlinked-json"].read(
        b"".join([*lines[:2], wild, lines[3], twice, *lines[4:]]), "log", PLAIN
    )
    assert recording.table.rows == 5
    skipped = recording.account.skipped
    assert (skipped["time out of order"].first, skipped["time repeats"].first) == (3, 5)
    assert np.all(np.diff(recording.table.time_ns) > 0)
