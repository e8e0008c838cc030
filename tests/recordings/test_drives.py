"""The speed that forces drive a vehicle at: steady and turning by hand, against an integrator, and in what order."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from bottomlock.config.through_water import EffortErrors, ThrustErrors
from bottomlock.errors import KernelError
from bottomlock.recordings.drives import SpeedByForces, speed_by_revolutions
from bottomlock.recordings.readings import EffortReading, ThrustReading

MASS_KG, LINEAR, QUADRATIC = (20.0, 24.0, 32.0), (14.0, 3.0, 33.0), (140.0, 217.0, 0.0)
HULL = EffortErrors(
    mass_kg=MASS_KG, linear_drag_kg_per_s=LINEAR, quadratic_drag_kg_per_m=QUADRATIC, buoyancy_n=2.4
)
STILL = np.zeros(3)


def speeds(hull: EffortErrors, rows: Any, omega: Any = STILL) -> np.ndarray:  # noqa: ANN401
    of = SpeedByForces(hull)
    return np.array(
        [of(EffortReading(time_ns, tuple(force)), np.asarray(omega)).speed_p_mps for time_ns, force in rows]
    )


def test_a_steady_speed_by_hand() -> None:
    """59 N are 14 u + 140 u² at u = 0.6011 m/s; astern as fast; along heave 2.4 N hold the vehicle down."""
    u = (-14.0 + np.sqrt(14.0**2 + 4.0 * 140.0 * 59.0)) / 280.0
    rows = [(0, (59.0, 0.0, 2.4)), *((k * 10**10, (59.0, 0.0, 35.4)) for k in range(1, 4))]
    np.testing.assert_allclose(speeds(HULL, rows)[[0, -1]], [[u, 0.0, 0.0], [u, 0.0, 1.0]], atol=1e-9)
    assert speeds(HULL, [(0, (-59.0, 0.0, 2.4))])[0, 0] == pytest.approx(-u)


def test_a_turn_takes_its_force() -> None:
    """In a steady turn at r the surge of 0.5 m/s presses to port with m r u; what holds it leaves no sway."""
    surge_n, held_n = 14.0 * 0.5 + 140.0 * 0.25, 20.0 * 0.3 * 0.5
    rows = [(k * 10**9, (surge_n, held_n, 2.4)) for k in range(60)]
    np.testing.assert_allclose(speeds(HULL, rows, (0.0, 0.0, 0.3))[-1], [0.5, 0.0, 0.0], atol=1e-4)


@given(
    st.lists(
        st.tuples(st.floats(0.05, 2.0), st.floats(-60.0, 60.0), st.floats(-40.0, 40.0)),
        min_size=3,
        max_size=6,
    ),
    st.floats(-0.5, 0.5),
)
def test_it_follows_as_an_integrator_does(knots: list[tuple[float, float, float]], yaw_rate: float) -> None:
    """Within 2 cm/s of the differential equation, and a steady force holds its speed."""
    t = np.cumsum([one[0] for one in knots])
    forces = np.array([(surge, sway, 2.4) for _, surge, sway in knots])
    omega, mass = np.array([0.0, 0.0, yaw_rate]), np.array(MASS_KG)

    def rate(at_s: float, u: np.ndarray) -> np.ndarray:
        force = np.array([np.interp(at_s, t, forces[:, k]) for k in range(3)]) - (0.0, 0.0, 2.4)
        drag = np.array(LINEAR) * u + np.array(QUADRATIC) * np.abs(u) * u
        return np.asarray((force - np.cross(omega, mass * u) - drag) / mass)

    found = speeds(HULL, zip(np.round(1e9 * t).astype(np.int64).tolist(), forces, strict=True), omega)
    exact = [found[0]]
    # Between knots, where the force is straight, so that no step passes over a bend.
    for span in pairwise(t):
        exact.append(solve_ivp(rate, span, exact[-1], rtol=1e-6, atol=1e-8).y[:, -1])
    np.testing.assert_allclose(found, exact, atol=0.02)


def test_an_axis_without_drag_and_a_propeller_at_rest_say_nothing() -> None:
    surge = EffortErrors(mass_kg=(20.0, 0.0, 0.0), linear_drag_kg_per_s=(10.0, 0.0, 0.0))
    assert surge.driven == (True, False, False)
    rows = [(0, (5.0, 9.0, 9.0)), (10**9, (5.0, 9.0, 9.0))]
    np.testing.assert_allclose(speeds(surge, rows, (0.1, 0.2, 0.3)), [[0.5, 0.0, 0.0]] * 2)
    of = speed_by_revolutions(ThrustErrors(advance_m=0.2))
    assert of(ThrustReading(7, 0.0), STILL).speed_p_mps == (0.0, 0.0, 0.0)
    assert of(ThrustReading(7, -3.0), STILL).speed_p_mps == pytest.approx((-0.6, 0.0, 0.0))


def test_forces_come_in_the_order_of_their_times() -> None:
    """One that does not is refused, and changes nothing."""
    of, other = SpeedByForces(HULL), SpeedByForces(HULL)
    for one in (of, other):
        one(EffortReading(10**9, (50.0, 0.0, 2.4)), STILL)
    with pytest.raises(KernelError, match="its time does not rise: 500 ns"):
        of(EffortReading(500, (-50.0, 0.0, 2.4)), STILL)
    later = EffortReading(2 * 10**9, (20.0, 0.0, 2.4))
    assert of(later, STILL) == other(later, STILL)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e30, 1e307, -6.0e4])
def test_a_force_that_cannot_be_changes_nothing(bad: float) -> None:
    """56,280 N are the drag at 20 m/s; one damaged reading does not spoil those that follow it."""
    of, other = SpeedByForces(HULL), SpeedByForces(HULL)
    for one in (of, other):
        one(EffortReading(10**9, (50.0, 0.0, 2.4)), STILL)
    with pytest.raises(KernelError, match=r"force_p_n at 1500000000 ns is .* N, the drag at 20 m/s"):
        of(EffortReading(15 * 10**8, (bad, 0.0, 2.4)), STILL)
    with pytest.raises(KernelError, match="omega_p_radps at 1500000000 ns is"):
        of(EffortReading(15 * 10**8, (50.0, 0.0, 2.4)), np.array([0.0, np.nan, 0.0]))
    later = EffortReading(2 * 10**9, (20.0, 0.0, 2.4))
    assert of(later, STILL) == other(later, STILL)
