"""The product's F and noise density against the dense oracle, at any attitude including the vertical."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bottomlock.kernel import error_model
from tests.oracle import error_model as oracle
from tests.oracle import nonlinear_error
from tests.oracle.mechanisation import earth_rate_tangent
from tests.oracle.rotations import Array, matrix_from_euler, quaternion_from_euler
from tests.property import settings
from tests.property import strategies as sea


def compare(roll: float, pitch: float, yaw: float, velocity: Array, rate: Array, force: Array) -> None:
    """F and G Q Gᵀ, against the blocks of Eqs. 9 and 10 and against the complex step."""
    model = settings.table_2()
    got = error_model(
        model,
        attitude_t_p=quaternion_from_euler(roll, pitch, yaw),
        velocity_p_mps=velocity,
        omega_p_radps=rate,
        force_p_mps2=force,
    )
    rotation = matrix_from_euler(roll, pitch, yaw)
    gravity = np.array([0.0, 0.0, settings.GRAVITY])
    earth = earth_rate_tangent(settings.LATITUDE_RAD)
    F = oracle.f_full(rotation, velocity, rate, gravity, earth)
    np.testing.assert_allclose(got["f"], F, atol=1e-12)
    G = oracle.g_full(rotation, velocity)
    Q = oracle.noise_density(*settings.noise_densities(model))
    np.testing.assert_allclose(got["q"], G @ Q @ G.T, rtol=1e-11, atol=1e-18)
    zero = np.zeros(3)
    point = nonlinear_error.Point(rotation, velocity, rate, force, zero, zero, gravity, earth)
    F_step, G_step = nonlinear_error.differentiate(point)
    np.testing.assert_allclose(got["f"], F_step, atol=1e-11)
    np.testing.assert_allclose(got["q"], G_step @ Q @ G_step.T, rtol=1e-10, atol=1e-18)


@given(angles=sea.angles, velocity=sea.velocities, rate=sea.rates, force=sea.numbers(-20, 20, 3))
def test_any_attitude(angles: tuple[float, float, float], velocity: Array, rate: Array, force: Array) -> None:
    """Eqs. 4, 5, 9 and 10 as erratum E8 confirms them, two independent derivations, every entry."""
    compare(*angles, velocity, rate, force)


@pytest.mark.parametrize("pitch_deg", [89.9, -89.9])
@given(roll=st.floats(-3.1, 3.1), yaw=st.floats(-3.1, 3.1), velocity=sea.velocities, rate=sea.rates)
def test_near_the_vertical(pitch_deg: float, roll: float, yaw: float, velocity: Array, rate: Array) -> None:
    """Euler angles are singular there; the misalignment vector is not, so nothing may grow."""
    compare(roll, float(np.deg2rad(pitch_deg)), yaw, velocity, rate, np.array([9.8, 0.1, -0.2]))
