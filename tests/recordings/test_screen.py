"""Readings that are none: streams that stand still, and steps that neither a vehicle nor the gyros make."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from bottomlock.recordings.screen import beside_the_steps, depth_steps, standing, yaw_steps
from bottomlock.recordings.streams import Attitudes, Depths, Flags, Floats, Inertial

RATE_HZ, SECONDS = 5.0, 180.0
COUNT = int(RATE_HZ * SECONDS)
TIME_NS = (np.arange(COUNT) / RATE_HZ * 1e9).astype(np.int64)
AT_S = TIME_NS * 1e-9


def depth(seed: int = 1, step_m: float = 1e-3) -> Floats:
    """A depth that sinks and rises by 2 m a minute, with noise, rounded."""
    noise = 0.02 * np.random.default_rng(seed).normal(size=COUNT)
    return np.asarray(np.round((5.0 + 2.0 * np.sin(AT_S / 10.0) + noise) / step_m) * step_m)


def turning(jumps_deg: Floats) -> tuple[Attitudes, Inertial]:
    """A vehicle that turns by 6 deg/s both ways; the attitude has jumps (n,), the gyros have not."""
    fine_s = np.arange(0.0, SECONDS, 0.02)
    yaw, rate = 60.0 * np.sin(AT_S / 10.0), np.deg2rad(6.0 * np.cos(fine_s / 10.0))
    omega = np.stack([np.zeros_like(rate), np.zeros_like(rate), rate], axis=1)
    noise = 0.1 * np.random.default_rng(2).normal(size=COUNT)
    attitude = Rotation.from_rotvec(np.deg2rad(yaw + jumps_deg + noise)[:, None] * [0.0, 0.0, 1.0])
    inertial = Inertial((fine_s * 1e9).astype(np.int64), np.zeros_like(omega), omega)
    return Attitudes(TIME_NS, attitude), inertial


def during(begin_s: float, end_s: float) -> Flags:
    return np.asarray((begin_s <= AT_S) & (end_s > AT_S))


@pytest.mark.parametrize("step_m", [1e-6, 1e-3, 0.01])
def test_a_stream_that_stands_still_is_left_out_from_its_second_reading_on(step_m: float) -> None:
    values = depth(step_m=step_m)
    still = during(40.0, 100.0)
    values[still] = values[np.flatnonzero(still)[0]]
    found = standing(TIME_NS, values[:, None])
    expected = still.copy()
    expected[np.flatnonzero(still)[0]] = False
    # The readings beside it may have its value by chance.
    assert np.count_nonzero(found != expected) <= 2


@pytest.mark.parametrize("repeats", [1, 5])
def test_repeated_rows_and_short_rests_stay(repeats: int) -> None:
    """An instrument of 1 Hz in a table of 5 Hz repeats each reading; nine seconds may be a rest."""
    values = np.repeat(depth()[::repeats], repeats)[:COUNT]
    values[during(40.0, 49.0)] = values[200]
    assert not standing(TIME_NS, values[:, None]).any()


@pytest.mark.parametrize("every", [1, 10])
def test_a_rest_among_long_runs_stays(every: int) -> None:
    """Twelve seconds are 60 rows, where one run of `every` has ten rows already."""
    values, k = depth(), 0
    while k < COUNT:
        values[k : k + 10] = values[k]
        k += 10 * every
    values[during(40.0, 52.0)] = values[200]
    assert not standing(TIME_NS, values[:, None]).any()


def test_seconds_count_beside_rows() -> None:
    """Seven seconds are 350 rows at 50 Hz."""
    values = np.round(5.0 + np.cumsum(0.01 * np.random.default_rng(4).normal(size=5000)), 6)
    values[1000:1350] = values[1000]
    assert not standing((np.arange(5000) * 20_000_000).astype(np.int64), values[:, None]).any()


def test_a_vehicle_at_rest_before_its_dive_keeps_its_readings() -> None:
    values = depth()
    values[during(0.0, 60.0)] = values[0]
    assert not standing(TIME_NS, values[:, None]).any()


def test_a_stream_that_never_changes_is_not_judged() -> None:
    assert not standing(TIME_NS, np.zeros((COUNT, 1))).any()
    assert not standing(TIME_NS[:5], np.zeros((5, 1))).any()


@given(st.floats(1.0, 50.0), st.floats(20.0, 60.0), st.booleans())
def test_a_step_of_the_depth_leaves_the_longer_part(size_m: float, end_s: float, ends: bool) -> None:
    """A jump that stays, and one that comes back; the rows of the shorter part are left out."""
    values, moved = depth(), during(0.0, end_s) if ends else during(60.0, 60.0 + end_s)
    values[moved] += size_m
    assert np.array_equal(beside_the_steps(depth_steps(Depths(TIME_NS, values)), 0.25), moved)


def test_a_dive_has_no_steps() -> None:
    """Sinking at 2 m/s, and a gap in which the depth went on."""
    sinking = 2.0 * AT_S + 0.02 * np.random.default_rng(3).normal(size=COUNT)
    kept = ~during(50.0, 80.0)
    assert not depth_steps(Depths(TIME_NS[kept], sinking[kept])).any()


@pytest.mark.parametrize("jump_deg", [25.0, -8.0])
def test_a_compass_that_jumps_is_told_by_the_gyros(jump_deg: float) -> None:
    jumped = during(80.0, 140.0)
    attitudes, inertial = turning(np.where(jumped, jump_deg, 0.0))
    steps = yaw_steps(attitudes, inertial)
    assert np.array_equal(beside_the_steps(steps, np.deg2rad(2.5)), jumped)
    assert np.rad2deg(steps[jumped]).mean() == pytest.approx(jump_deg, abs=0.5)


def test_axes_that_are_not_as_stated_and_holes_are_no_steps() -> None:
    """Gyros about another axis miss every turn; over a minute a bias of 0.2 deg/s is 12 deg."""
    attitudes, inertial = turning(np.zeros(COUNT))
    quick = Attitudes(
        TIME_NS, Rotation.from_rotvec([0.0, 0.0, 1.0] * (2.0 * np.sin(AT_S / 5.0))[:, None] ** 5)
    )
    other = Inertial(inertial.time_ns, inertial.force_p_mps2, inertial.omega_p_radps[:, ::-1])
    assert not yaw_steps(quick, other).any()
    off = Inertial(inertial.time_ns, inertial.force_p_mps2, inertial.omega_p_radps + np.deg2rad(0.2))
    assert not yaw_steps(attitudes.kept(~during(50.0, 110.0)), off).any()


def test_turns_that_the_gyros_make_are_no_steps() -> None:
    attitudes, inertial = turning(np.zeros(COUNT))
    assert not yaw_steps(attitudes, inertial).any()
