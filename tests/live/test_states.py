"""The states: one table of conditions, worse at once, better after the settling time."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bottomlock.io.beams import read_geometry
from bottomlock.live.doubts import Contradiction, Doubt, Doubts
from bottomlock.live.sections import StatesSection
from bottomlock.live.states import ORDER, Facts, StateMachine, judge
from bottomlock.ports.estimate import SILENT, State

S = 1_000_000_000
LIMITS = StatesSection(rejected_pings=5)
GOOD = Facts(
    now_ns=100 * S,
    mode="navigation",
    waiting_for="",
    ping_age_ns=S // 10,
    ping_period_ns=S // 5,
    rank=3,
    imu_age_ns=S // 100,
    imu_period_ns=S // 100,
    velocity_sd_mps=0.01,
    doubt=Doubt(),
    stepped=False,
)


def changed(**change: Any) -> Facts:  # noqa: ANN401 - of any fact
    """Good facts with others, and with doubts."""
    doubt = {key: change.pop(key) for key in tuple(change) if key in Doubt.__dataclass_fields__}
    return replace(GOOD, **change, doubt=Doubt(**doubt))


@pytest.mark.parametrize(
    ("change", "navigation", "velocity", "why"),
    [
        ({}, "OK", "OK", "beams determine the whole velocity"),
        ({"rank": 2}, "PARTIAL", "PARTIAL", "beams determine 2 of 3 directions"),
        ({"ping_age_ns": int(0.61 * S)}, "COASTING", "UNSAFE", "no usable beam for 0.6 s"),
        ({"ping_age_ns": int(0.59 * S)}, "OK", "OK", "beams determine the whole velocity"),
        (
            {"ping_age_ns": S, "water_age_ns": int(0.59 * S)},
            "WATER",
            "UNSAFE",
            "no usable beam for 1.0 s: velocity through the water and the last current",
        ),
        ({"ping_age_ns": S, "water_age_ns": int(0.61 * S)}, "COASTING", "UNSAFE", "no usable beam for 1.0 s"),
        ({"rank": 2, "water_age_ns": 0}, "PARTIAL", "PARTIAL", "beams determine 2 of 3 directions"),
        ({"rank": 0, "water_age_ns": 0}, "COASTING", "UNSAFE", "the last ping contradicts the estimate"),
        ({"stepped": True, "water_age_ns": 0}, "COASTING", "UNSAFE", "the clock of a source was set"),
        ({"ping_age_ns": None}, "COASTING", "UNSAFE", "no usable beam"),
        ({"stepped": True}, "COASTING", "UNSAFE", "the clock of a source was set"),
        ({"rejected": 5}, "UNSAFE", "UNSAFE", "5 pings in a row contradict the estimate"),
        ({"rejected": 4}, "OK", "OK", "beams determine the whole velocity"),
        ({"rank": 0}, "COASTING", "UNSAFE", "the last ping contradicts the estimate"),
        ({"closure_ratio": 3.1}, "UNSAFE", "UNSAFE", "beams disagree with one another by 3.1 times"),
        (
            {"own_ratio": 3.1},
            "UNSAFE",
            "UNSAFE",
            "beams differ from the instrument's own velocity by 3.1 times",
        ),
        ({"closure_ratio": 2.9, "own_ratio": 2.9}, "OK", "OK", "beams determine the whole velocity"),
        ({"velocity_sd_mps": 0.6}, "UNSAFE", "UNSAFE", "velocity is uncertain by 0.6 m/s, limit 0.5 m/s"),
        ({"velocity_sd_mps": float("nan")}, "UNSAFE", "UNSAFE", "velocity is uncertain by nan m/s"),
        ({"imu_age_ns": int(0.11 * S)}, "UNSAFE", "OK", "no inertial readings for 0.1 s"),
        ({"imu_age_ns": None}, "UNSAFE", "OK", "no inertial readings"),
        (
            {"imu_age_ns": S, "imu_fault": "in deg/s?"},
            "UNSAFE",
            "OK",
            "no inertial readings for 1.0 s: the last one was rejected, in deg/s?",
        ),
        (
            {"longest": Contradiction("gps_position", 5, S)},
            "PARTIAL",
            "PARTIAL",
            "gps position has contradicted the",
        ),
        ({"longest": Contradiction("heading", 4, S)}, "OK", "OK", "beams determine the whole velocity"),
        (
            {"longest": Contradiction("heading", 9, S - 1)},
            "OK",
            "OK",
            "beams determine the whole velocity",
        ),
        ({"lasting": True}, "PARTIAL", "PARTIAL", "the mean of pings contradicts the estimate"),
        ({"lasting": True, "rejected": 5}, "UNSAFE", "UNSAFE", "5 pings in a row contradict the estimate"),
        ({"fault": "broken"}, "UNSAFE", "UNSAFE", "broken"),
        ({"waiting_for": "the alignment"}, "INITIALISING", "INITIALISING", "waiting for the alignment"),
    ],
)
def test_conditions(change: dict[str, object], navigation: str, velocity: str, why: str) -> None:
    """Each condition of docs/live.md, at its limit."""
    for mode, expected in (("navigation", navigation), ("velocity", velocity)):
        state, words = judge(changed(mode=mode, **change), LIMITS)
        assert state == expected
        if expected == navigation:
            assert words.startswith(why)


facts = st.builds(
    changed,
    rank=st.integers(0, 3),
    ping_age_ns=st.none() | st.integers(0, 2 * S),
    imu_age_ns=st.none() | st.integers(0, 2 * S),
    velocity_sd_mps=st.floats(0, 2),
    rejected=st.integers(0, 8),
    stepped=st.booleans(),
    water_age_ns=st.none() | st.integers(0, 2 * S),
    waiting_for=st.sampled_from(["", "", "", "x"]),
    lasting=st.booleans(),
    longest=st.none() | st.builds(Contradiction, st.just("depth"), st.integers(3, 6), st.just(S)),
)


@given(steps=st.lists(st.tuples(st.integers(0, S), facts), min_size=1, max_size=30))
def test_the_state_is_the_worst_of_the_last_second(steps: list[tuple[int, Facts]]) -> None:
    """Never better than what is asked now, and exactly the worst that was asked within the settling time.

    Ten seconds from pings that contradict on it is UNSAFE, from another sensor that does at best PARTIAL.
    """
    machine, now = StateMachine(LIMITS), 0
    asked: list[tuple[int, State]] = []
    contradicted: list[tuple[int, State]] = []
    for step, one in steps:
        now += step
        state = machine.update(replace(one, now_ns=now))
        wanted = judge(one, LIMITS)[0]
        if wanted == "INITIALISING":
            asked, contradicted = [], []
            assert state == "INITIALISING"
            continue
        contradicted += [(now, "UNSAFE")] if one.doubt.rejected >= 5 else []
        is_long = one.doubt.longest is not None and one.doubt.longest.readings >= 5
        contradicted += [(now, "PARTIAL")] if is_long or one.doubt.lasting else []
        recent = [least for at, least in contradicted if now - at < 10 * S]
        wanted = max([wanted, *recent], key=ORDER.index)
        asked = [(at, one_state) for at, one_state in asked if now - at < S] + [(now, wanted)]
        assert state == max((one_state for _, one_state in asked), key=ORDER.index)
        assert (state in SILENT) == (state == "UNSAFE")


def test_the_run_of_rejections_that_has_lasted_longest() -> None:
    """One that is accepted ends its run; beams, water and what is revised are no part of it."""
    doubts = Doubts(read_geometry("waterlinked_a50"))

    def take(
        at_s: int, sensor: str, verdict: str = "rejected", factor: float | None = None, **kinds: bool
    ) -> None:
        report = {"sensor": sensor, "verdict": verdict, "inflation": factor, "revised": False, **kinds}
        doubts.take(SimpleNamespace(time_ns=at_s * S, **report))  # type: ignore[arg-type]

    for at_s in range(4):
        take(at_s, "beams")
        take(at_s, "water_track")
        take(at_s, "heading", revised=True)
    none = doubts.now.longest
    assert none is None
    for at_s in range(4, 9):
        take(at_s, "heading")
    for at_s in range(8, 11):
        take(at_s, "gps_position")
    assert doubts.now.longest == Contradiction("heading", 5, 4 * S)
    assert str(doubts.now.longest) == "heading has contradicted the estimate for 4 s"
    take(9, "heading", "accepted")
    assert doubts.now.longest == Contradiction("gps_position", 3, 2 * S)


def test_the_mean_of_pings_contradicts_once_a_ping_that_was_accepted_charges() -> None:
    """What is charged after a rejected ping is of rejections, and the next ping ends either."""
    doubts = Doubts(read_geometry("waterlinked_a50"))
    found = []
    for verdict, factor in [
        ("accepted", None),
        ("accepted", 9.0),
        ("accepted", None),
        ("rejected", None),
        ("accepted", 9.0),
    ]:
        doubts.take(
            SimpleNamespace(time_ns=0, sensor="beams", verdict=verdict, inflation=factor, revised=False)  # type: ignore[arg-type]
        )
        found.append(doubts.now.lasting)
    assert found == [False, True, False, False, False]
