"""Recorded outages of an A50: how long the autopilot is without a message while a beam is valid."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("pymavlink", reason="needs pymavlink (extra mavlink)")

from bottomlock.setup.form import SetupForm
from tests.setup.recorded_trace import CALM_S, LATITUDE_DEG, gaps, of_form, recording, sent, trace

CIRCLE, PLAIN, TURN = "out20210528_circle.txt", "out20210528.txt", "out20210528_straight+turn360.txt"
EXTENSION = {CIRCLE: 42, PLAIN: 17, TURN: 20}
"""Gaps of the A50's own extension, which sends on `velocity_valid`."""
VELOCITY = {CIRCLE: 41, PLAIN: 17, TURN: 21}
"""Of mode velocity, which has no more than the beams; it also leaves out reports that repeat the one before."""


@pytest.mark.parametrize("name", [CIRCLE, PLAIN, TURN])
def test_no_gap_as_recorded(tmp_path: Path, name: str) -> None:
    """Mode navigation: none over 400 ms while a beam is valid; the A50's extension and mode velocity have them."""
    moves = trace(recording(name))
    times, states = sent(of_form(SetupForm(latitude_deg=LATITUDE_DEG), tmp_path), moves, moves)
    assert gaps(times, moves) == []
    assert times[0] < CALM_S
    assert not [state for state in states if state.startswith("UNSAFE")]
    assert len(gaps(moves.time_s[moves.shown_valid], moves)) == EXTENSION[name]
    times, _ = sent(of_form(SetupForm(mode="velocity"), tmp_path), moves)
    assert len(gaps(times, moves)) == VELOCITY[name]
