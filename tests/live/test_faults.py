"""Seeded cases of faults of the lines, from `tests.attack.live_faults`."""

from __future__ import annotations

from tests.attack.live_faults import FAULTS, run_case

SHARE = range(24)


def test_a_share_of_the_cases() -> None:
    """Nothing wrong in any, and together they see every state."""
    outcomes = [run_case(number) for number in SHARE]
    assert [outcome.wrong for outcome in outcomes if outcome.wrong] == []
    assert frozenset().union(*(outcome.states for outcome in outcomes)) == {
        "INITIALISING", "OK", "PARTIAL", "COASTING", "UNSAFE",
    }  # fmt: skip
    assert len(FAULTS) == 8
