"""The clock map: jitter, drift and steps, and what it says of each report."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bottomlock.live.clock import CONFIRM_NS, DRIFT, ClockMap, Verdict

STEP_NS = 100_000_000


def run(
    clock: ClockMap, times: np.ndarray, offsets: np.ndarray, delays: np.ndarray
) -> tuple[list[Verdict], np.ndarray]:
    """Verdicts on the reports, and the error of the mapped time of each, ns."""
    verdicts: list[Verdict] = []
    errors = []
    arrivals = np.maximum.accumulate(times + delays)
    for time, offset, arrival in zip(times.tolist(), offsets.tolist(), arrivals.tolist(), strict=True):
        verdicts.append(clock.observe(time + offset, arrival))
        errors.append(clock.host_ns(time + offset) - time)
    return verdicts, np.array(errors)


@given(
    seed=st.integers(0, 2**32),
    drift=st.floats(-DRIFT, DRIFT),
    jitter_ms=st.floats(0.0, 15.0),
    offset=st.integers(-(10**18), 10**18),
    rate=st.sampled_from([1.0, 5.0, 15.0, 200.0]),
)
def test_jitter_and_drift(seed: int, drift: float, jitter_ms: float, offset: int, rate: float) -> None:
    """The mapped time is never early, and late by the least delay of the last time and the drift since then at most."""
    random = np.random.default_rng(seed)
    times = np.cumsum(np.full(400, round(1e9 / rate)))
    delays = np.minimum(random.exponential(jitter_ms * 1e6, 400), 90e6).astype(np.int64)
    offsets = offset + np.round(drift * times).astype(np.int64)
    clock = ClockMap(STEP_NS)
    verdicts, errors = run(clock, times, offsets, delays)
    assert set(verdicts) == {"good"}
    assert clock.steps == 0
    arrivals = np.maximum.accumulate(times + delays)
    assert (errors >= -2).all()
    for k in range(0, 400, 40):
        # Every report so far bounds the error: its own delay, and twice the drift since then.
        bound = (arrivals[: k + 1] - times[: k + 1]) + 2.0 * DRIFT * (arrivals[k] - arrivals[: k + 1])
        assert errors[k] <= bound.min() + k + 2


@given(
    seed=st.integers(0, 2**32),
    step_ms=st.one_of(st.integers(-(10**9), -250), st.integers(250, 10**9)),
    at=st.integers(20, 100),
)
def test_steps_are_found_and_no_wrong_time_is_used(seed: int, step_ms: int, at: int) -> None:
    """A step forward by the second report, one back after a second; until then every report is marked as late."""
    random = np.random.default_rng(seed)
    times = np.cumsum(np.full(200, 100_000_000))
    delays = random.exponential(3e6, 200).clip(0, 60e6).astype(np.int64)
    offsets = np.zeros(200, dtype=np.int64)
    offsets[at:] += step_ms * 1_000_000
    clock = ClockMap(STEP_NS)
    verdicts, errors = run(clock, times, offsets, delays)
    assert clock.steps == 1
    assert clock.last_step_ns == pytest.approx(step_ms * 1e6, abs=61e6)
    first = verdicts.index("stepped")
    span = times[first] - times[at]
    assert span == 1e8 if step_ms > 0 else CONFIRM_NS - 1e8 <= span <= CONFIRM_NS + 2e8
    used = [k for k, verdict in enumerate(verdicts) if verdict != "late"]
    assert np.abs(errors[used]).max() < 70e6
    assert clock.late == first - at


def test_a_wrong_stamp_is_no_step() -> None:
    """Every tenth is years ahead, none like the one before: these alone are not used."""
    times = np.cumsum(np.full(100, 100_000_000))
    offsets = np.zeros(100, dtype=np.int64)
    offsets[9::10] = 10**17 * np.arange(1, 11)
    clock = ClockMap(STEP_NS)
    verdicts, errors = run(clock, times, offsets, np.zeros(100, dtype=np.int64))
    assert [k for k, verdict in enumerate(verdicts) if verdict == "late"] == list(range(9, 100, 10))
    assert np.abs(errors[np.delete(np.arange(100), np.arange(9, 100, 10))]).max() < 1e6


def test_a_stall_of_the_line_is_no_step() -> None:
    """Three seconds without arrival, then everything at once: late reports are not used, and the clock is the same."""
    times = np.cumsum(np.full(100, 100_000_000))
    delays = np.zeros(100, dtype=np.int64)
    delays[40:70] = times[70] - times[40:70]
    clock = ClockMap(STEP_NS)
    verdicts, errors = run(clock, times, np.zeros(100, dtype=np.int64), delays)
    assert verdicts.count("late") == 29
    assert clock.steps == 0
    assert np.abs(errors).max() < 1e6
