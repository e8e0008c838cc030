"""Recorded outages of an A50: how long the autopilot is without a message while a beam is valid."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pymavlink", reason="needs pymavlink (extra mavlink)")

from bottomlock.setup.form import SetupForm
from tests.setup.recorded_trace import (
    CALM_S,
    LATITUDE_DEG,
    Trace,
    deltas,
    gaps,
    of_form,
    recording,
    sent,
    smooth_velocity,
    trace,
)

CIRCLE, PLAIN, TURN = "out20210528_circle.txt", "out20210528.txt", "out20210528_straight+turn360.txt"
EXTENSION = {CIRCLE: 42, PLAIN: 17, TURN: 20}
"""Gaps of the A50's own extension, which sends on `velocity_valid`."""
VELOCITY = {CIRCLE: 41, PLAIN: 17, TURN: 21}
"""Of mode velocity, which has no more than the beams; it also leaves out reports that repeat the one before."""


def by_extension(moves: Trace) -> np.ndarray:
    """Times of the messages of BlueOS-Water-Linked-DVL: `if not valid: return`."""
    times: np.ndarray = moves.time_s[moves.shown_valid]
    return times


@pytest.mark.parametrize("autopilot", ["ardusub", "px4"])
@pytest.mark.parametrize("name", [CIRCLE, PLAIN, TURN])
def test_no_gap_as_recorded(tmp_path: Path, name: str, autopilot: str) -> None:
    """Mode navigation: none over 400 ms while a beam is valid; the A50's extension has them on the same bytes."""
    moves = trace(recording(name))
    form = SetupForm(autopilot=autopilot, latitude_deg=LATITUDE_DEG)
    times, states = sent(of_form(form, tmp_path), moves, moves)
    assert gaps(times, moves) == []
    assert times[0] < CALM_S
    assert not [state for state in states if state.startswith("UNSAFE")]
    assert len(gaps(by_extension(moves), moves)) == EXTENSION[name]


@pytest.mark.parametrize("name", [CIRCLE, PLAIN, TURN])
def test_beams_alone_cannot_bridge(tmp_path: Path, name: str) -> None:
    """Mode velocity, stated as it is: a single beam is no velocity, and nothing is made up."""
    moves = trace(recording(name))
    times, _ = sent(of_form(SetupForm(mode="velocity"), tmp_path), moves)
    assert len(gaps(times, moves)) == VELOCITY[name]


@pytest.mark.parametrize("keep", [(0,), (1,), (2,), (3,), (0, 1), (0, 2)])
@pytest.mark.parametrize("name", [CIRCLE, TURN])
def test_no_gap_with_one_beam_for_ten_seconds(tmp_path: Path, name: str, keep: tuple[int, ...]) -> None:
    """Every second ten seconds only these beams stay; what is sent is within what the message claims."""
    lines = recording(name)
    moves, whole = trace(lines, keep), trace(lines)
    assert (moves.beams == len(keep)).sum() > 100
    assert max(length for _, length in gaps(by_extension(moves), moves)) > 10.0
    data: list[bytes] = []
    times, _ = sent(of_form(SetupForm(latitude_deg=LATITUDE_DEG), tmp_path), moves, whole, data)
    assert gaps(times, moves) == []
    at_s, velocity = smooth_velocity(whole)
    error, sd = deltas(times, data, at_s, velocity)
    # Three axes and a σ for all of them: the mean square of the ratio of a message is 1 where the claim is exact.
    assert float(np.mean((error / sd[:, np.newaxis]) ** 2)) < 1.0
    assert float(np.abs(error).max()) < 4.0 * float(sd.max())
