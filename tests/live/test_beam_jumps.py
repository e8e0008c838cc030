"""Outliers in mode velocity: left out by a beam's own past and by the other beams; a vehicle that moves is not."""

from __future__ import annotations

import numpy as np
import pytest

from bottomlock.io.beams import read_geometry
from bottomlock.live.engine import Engine
from bottomlock.live.estimator import REOPENED, BeamJumps
from tests.live.world import BEAM_SD, VELOCITY, World, config, fly, lines

SECOND = 1_000_000_000
ALL = np.ones(4, dtype=bool)
SD = np.full(4, BEAM_SD)


def made(acceleration_mps2: float = 1.0) -> BeamJumps:
    """A50 beams of 0.01 m/s: a jump within 0.1 s is more than 0.0566 + 0.1 m/s."""
    return BeamJumps(read_geometry("waterlinked_a50").geometry, acceleration_mps2)


def test_a_jump_by_hand() -> None:
    """4 √2 σ and the acceleration: 0.156 passes, 0.158 does not; two complete beams tell nothing more."""
    one = made()
    three = np.array([True, True, True, False])
    one.kept(0, np.zeros(4), three, SD)
    assert one.kept(SECOND // 10, np.array([0.156, 0.0, 0.0, 0.0]), three, SD).tolist() == three.tolist()
    one = made()
    one.kept(0, np.zeros(4), three, SD)
    assert one.kept(SECOND // 10, np.array([0.158, 0.0, 0.0, 0.0]), three, SD).tolist() == [
        False,
        True,
        True,
        False,
    ]
    assert one.why == "no vehicle changes its velocity so: beam 1 left out"


def test_the_other_beams_tell_a_smaller_one() -> None:
    """Closure of four beams, half of a beam's error each: 0.08 m/s is four sigma of it, and no jump by itself."""
    one = made()
    one.kept(0, np.zeros(4), ALL, SD)
    assert one.kept(SECOND // 10, np.array([0.0, 0.08, 0.0, 0.0]), ALL, SD).tolist() == [
        True,
        False,
        True,
        True,
    ]
    assert one.kept(2 * SECOND // 10, np.array([0.0, 0.06, 0.0, 0.0]), ALL, SD).all()


def test_a_vehicle_that_moved_is_taken_after_three_readings() -> None:
    """And a beam that was away for more than two seconds at once."""
    one = made()
    one.kept(0, np.zeros(4), ALL, SD)
    new = read_geometry("waterlinked_a50").geometry.beam_velocities([[9.0, 3.0, 0.0]])[0]
    kept = [one.kept(k * SECOND // 10, new, ALL, SD).all() for k in range(1, REOPENED + 2)]
    assert kept == [False] * REOPENED + [True]
    assert one.kept(5 * SECOND, np.zeros(4), ALL, SD).all()


def test_a_beam_that_sticks_stays_out() -> None:
    """While the others tell it apart, and after that nothing is used: two that moved may be either's."""
    one = made()
    kept = [
        one.kept(k * SECOND // 10, np.array([0.0, min(k, 1) * 0.4, 0.0, 0.0]), ALL, SD) for k in range(40)
    ]
    assert [valid.sum() for valid in kept[:21]] == [4] + 20 * [3]
    assert not any(valid.any() for valid in kept[21:])
    one = made()
    one.kept(0, np.zeros(4), ALL, SD)
    assert not one.kept(SECOND // 10, np.array([0.4, -0.3, 0.0, 0.0]), ALL, SD).any()
    assert one.why == "no vehicle changes its velocity so: beam 1, 2, 3, 4 left out"


@pytest.mark.parametrize(("lost", "most"), [((), 1.5), ((3,), 2.6)])
def test_outliers_do_not_reach_the_ports(lost: tuple[int, ...], most: float) -> None:
    """2.7 % of the readings with twelve times the noise: error² over claim², 5 without any test.

    Three beams have no closure: an outlier within what the vehicle may do from ping to ping stays.
    """
    sent = fly(Engine(config()), World(120.0, lambda _: lost, outliers=0.027).arrivals())
    whole = [line for line in lines(sent) if line.rank == 3]
    assert len(whole) > 1000
    assert float(np.mean([((line.velocity - VELOCITY) / line.sd) ** 2 for line in whole])) < most
