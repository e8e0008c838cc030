"""Three minutes of the soak of live use; `python tools/live_soak.py` runs an hour."""

from __future__ import annotations

import pytest

from tools.live_soak import live_soak


@pytest.mark.long
def test_three_minutes_of_live_use() -> None:
    """Beams that go and come back, a line that is damaged: nothing wrong, and every message within its sigma."""
    result = live_soak(0.05)
    assert [fault for fault in result["faults"] if "memory" not in fault] == []
    assert {"OK", "PARTIAL", "COASTING"} <= set(result["states"])
    # Ten a second, but for the alignment and the waits of a port at its rate.
    assert 1200 < result["messages"] <= 1800
    assert result["memory_mb"]["grown"] < 10.0
