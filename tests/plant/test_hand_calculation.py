"""Numbers a naval architect would work out on paper, against the model."""

import math

import numpy as np
import pytest

from bottomlock.plant import Vehicle
from bottomlock.plant.equations import fin_wrench, hull_wrench
from bottomlock.plant.maths import SCALAR
from bottomlock.plant.trim import trim
from tests.plant.helpers import GRAVITY_MPS2, at_speed, coast, fins_of, nu_dot


@pytest.mark.parametrize("speed_mps", [1.0, 2.0, 3.0])
def test_trim_is_an_equilibrium(tauv: Vehicle, speed_mps: float) -> None:
    """Nothing accelerates, and a minute of swimming with held fins stays where it is."""
    steady = trim(tauv, speed_mps, GRAVITY_MPS2)
    u, v, w = steady.velocity_p_mps
    attitude = (math.cos(steady.pitch_rad / 2), 0.0, math.sin(steady.pitch_rad / 2), 0.0)
    motion, actuators = (u, v, w, 0.0, 0.0, 0.0), (*steady.fins_rad, steady.shaft_rps)
    rates = nu_dot(tauv, motion, actuators, quaternion=attitude)
    assert np.abs(rates).max() < 1e-9
    start = [0.0, 0.0, 20.0, *attitude, u, v, w, 0.0, 0.0, 0.0]
    track = coast(tauv, start, fins_rad=steady.fins_rad, shaft_rps=steady.shaft_rps, duration_s=60.0)
    assert np.abs(track[-1, 7:10] - np.array([u, v, w])).max() < 1e-6
    assert track[-1, 2] == pytest.approx(20.0, abs=1e-5)


def test_terminal_speed_balances_drag_and_thrust(tauv: Vehicle) -> None:
    """(1-t) rho D⁴ n (K0 n + K1 (1-w) u / D) = (X_uu + 4 rho/2 S C_D0) u², a quadratic in u, within 1 %."""
    prop, fins, density = tauv.propeller, tauv.fins, tauv.water.density
    shaft = 15.0
    drag = tauv.hull.axial_drag + 4 * 0.5 * density * fins.area * fins.zero_lift_drag
    push = (1.0 - prop.thrust_deduction) * density * prop.diameter**4
    constant = push * prop.thrust_at_rest * shaft**2
    slope = push * prop.thrust_slope * shaft * (1.0 - prop.wake_fraction) / prop.diameter
    by_hand = (slope + math.sqrt(slope**2 + 4.0 * drag * constant)) / (2.0 * drag)
    track = coast(
        tauv, at_speed(0.5), fins_rad=fins_of(tauv, roll_rad=0.0132), shaft_rps=shaft, duration_s=120.0
    )
    assert np.linalg.norm(track[-1, 7:10]) == pytest.approx(by_hand, rel=0.01)


def test_pitch_moment_at_an_angle_of_attack(tauv: Vehicle) -> None:
    """At 3 deg and 2 m/s: the Munk moment less fins' and hull's lift at their arms, within 5 %."""
    speed, angle = 2.0, math.radians(3.0)
    u, w = speed * math.cos(angle), speed * math.sin(angle)
    hull, fins, density = tauv.hull, tauv.fins, tauv.water.density
    munk = (tauv.added_mass.x_udot - tauv.added_mass.z_wdot) * u * w
    fin = 0.5 * density * speed**2 * fins.area * 2.0 * (fins.lift_slope + fins.zero_lift_drag) * angle
    by_hand = munk + fins.position_x * fin + hull.centre_of_pressure_x * hull.lift * u * w
    plane = hull_wrench(tauv, SCALAR)((u, 0.0, w, 0.0, 0.0, 0.0))[4]
    tail = fin_wrench(tauv, SCALAR)((u, 0.0, w, 0.0, 0.0, 0.0), (0.0,) * 4)[4]
    assert munk + plane + tail == pytest.approx(by_hand, rel=0.05)
    # weathercock balance: the fins make good about half of what the Munk moment upsets
    assert 0.3 < -fins.position_x * fin / munk < 0.7


def test_fins_steer_the_way_they_should(tauv: Vehicle) -> None:
    """Positive equivalent deflections roll to starboard, pitch the nose up and yaw to starboard."""
    wrench = fin_wrench(tauv, SCALAR)
    still = (2.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for index, entries in enumerate(({"roll_rad": 0.05}, {"pitch_rad": 0.05}, {"yaw_rad": 0.05})):
        moments = np.array(wrench(still, fins_of(tauv, **entries).tolist())[3:])
        assert moments[index] > 1.0
        assert np.abs(np.delete(moments, index)).max() < 1e-9


def test_propeller_torque_heels_to_port(tauv: Vehicle) -> None:
    """A propeller clockwise from aft turns the hull the other way, by torque over righting moment."""
    steady = trim(tauv, 2.0, GRAVITY_MPS2)
    fins = np.array(steady.fins_rad) - fins_of(tauv, roll_rad=steady.modes_rad[0])
    attitude = (math.cos(steady.pitch_rad / 2), 0.0, math.sin(steady.pitch_rad / 2), 0.0)
    start = [0.0, 0.0, 20.0, *attitude, *steady.velocity_p_mps, 0.0, 0.0, 0.0]
    track = coast(tauv, start, fins_rad=fins, shaft_rps=steady.shaft_rps, duration_s=10.0)
    prop = tauv.propeller
    advance = (1.0 - prop.wake_fraction) * 2.0 / (steady.shaft_rps * prop.diameter)
    torque = (
        tauv.water.density
        * prop.diameter**5
        * steady.shaft_rps**2
        * (prop.torque_at_rest + prop.torque_slope * advance)
    )
    stiffness = tauv.rigid_body.mass * GRAVITY_MPS2 * tauv.rigid_body.centre_of_gravity_z
    assert 2.0 * track[-1, 4] == pytest.approx(-torque / stiffness, rel=0.15)
