"""The REMUS 100 oracle on published figures and balances, and Prestero's hull by plain quadrature."""

import math

import numpy as np
import pytest

from tests.oracle import mss_remus


def test_mass_and_speed_are_the_ones_the_model_states() -> None:
    """31.9 kg; 2.5 m/s at 1525 rpm, where the advance number is 0.6632 (remus100.m)."""
    assert mss_remus.rigid_body()[0] == pytest.approx(31.9, abs=0.05)
    state = mss_remus.held(2.5, 0.0, 1525.0, 60.0)
    assert state[0] == pytest.approx(2.5, rel=0.02)
    n = 1525 / 60
    thrust, torque = mss_remus.propeller(2.5, 1525.0)
    assert thrust == pytest.approx(0.1798 * 1026 * 0.14**4 * n**2, rel=1e-3)
    assert torque == pytest.approx(0.0312 * 1026 * 0.14**5 * n**2, rel=1e-3)


def test_straight_run_balances_thrust_and_drag() -> None:
    """Hand-worked: 0.9 T = rho/2 Cd pi b² U² + (m + m_a)/20 U exp(-3 U) in a straight run."""
    state = mss_remus.held(1.54, 0.0, 925.0, 90.0)
    thrust, _ = mss_remus.propeller(float(state[0]), 925.0)
    drag = 0.5 * 1026 * 0.42 * math.pi * (1.0096 * 0.095) ** 2 * state[0] ** 2
    drag += (31.93 + 0.863) / 20 * state[0] * math.exp(-3 * state[0])
    assert 0.9 * thrust == pytest.approx(drag, rel=1e-4)


def test_pitch_up_and_starboard_signs() -> None:
    """Positive rudder turns to starboard, positive stern plane pitches down (remus100.m, 2024-06-23)."""
    assert mss_remus.held(1.54, 0.1, 925.0, 2.0)[11] > 0
    assert mss_remus.held(1.54, 0.0, 925.0, 2.0, stern_rad=0.1)[10] < 0


def test_prestero_added_masses_follow_from_his_hull_and_a_fin_height_of_5_14_inches() -> None:
    """Table 2.2 prints the fin height as 5.14 m; read in inches, Eqs. 4.18 to 4.21 give his Tables 4.2 and 4.3.

    Myring's shape with both offsets (Table 2.1), fins from 0.685 to 0.611 m aft of the origin (Table A.2).
    """
    nose, nose_off, middle, tail, tail_off, d, angle = 0.191, 0.0165, 0.654, 0.541, 0.0368, 0.191, 0.436
    x = np.linspace(0.0, nose - nose_off + middle + tail - tail_off, 40001)
    bow = 0.5 * d * np.sqrt(np.clip(1 - (np.minimum(x + nose_off - nose, 0.0) / nose) ** 2, 0, 1))
    aft = np.maximum(x - (nose + middle - nose_off), 0.0)
    slope = math.tan(angle)
    stern = (1.5 * d / tail**2 - slope / tail) * aft**2 - (d / tail**3 - slope / tail**2) * aft**3
    radius, station, tip, density = bow - stern, 0.611 - x, 5.14 * 0.0254, 1030.0
    finned = (station >= -0.685) & (station <= -0.611)
    cross = tip**2 - radius**2 + radius**4 / tip**2
    per_length = math.pi * density * np.where(finned, cross, radius**2)
    assert np.trapezoid(per_length, x) == pytest.approx(35.5, rel=0.015)
    assert -np.trapezoid(per_length * station, x) == pytest.approx(1.93, rel=0.015)
    assert np.trapezoid(per_length * station**2, x) == pytest.approx(4.88, rel=0.015)
    assert 2 / math.pi * density * tip**4 * (0.685 - 0.611) == pytest.approx(0.0141, rel=0.005)
    assert np.trapezoid(2 * radius, x) == pytest.approx(0.226, rel=0.005)
