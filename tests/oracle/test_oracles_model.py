"""F and G written by hand against two derivations that know none of their blocks; the mechanisation on solved cases."""

import numpy as np
import pytest

from tests.oracle import error_model, mechanisation, nonlinear_error
from tests.oracle.rotations import (
    Array,
    exp_rotation,
    log_rotation,
    matrix_from_euler,
    matrix_from_quaternion,
    quaternion_from_euler,
    quaternion_product,
)

GRAVITY = 9.8
EARTH = mechanisation.earth_rate_tangent(np.deg2rad(32.8))
# The vertical is where Euler angles fail; the error state must not.
ATTITUDES_DEG = [(10.0, 5.0, 40.0), (-170.0, 89.9, 15.0), (25.0, -89.9, -130.0), (0.0, 0.0, 0.0)]


def point(roll_deg: float, pitch_deg: float, yaw_deg: float, seed: int = 4) -> nonlinear_error.Point:
    """An estimate with every quantity different from zero."""
    rng = np.random.default_rng(seed)
    return nonlinear_error.Point(
        rotation=matrix_from_euler(*np.deg2rad([roll_deg, pitch_deg, yaw_deg])),
        velocity=rng.normal(0, 2, 3),
        rate_reading=rng.normal(0, 0.3, 3),
        force_reading=rng.normal(0, 10, 3),
        accel_bias=rng.normal(0, 0.01, 3),
        gyro_bias=rng.normal(0, 0.01, 3),
        gravity_t=np.array([0.0, 0.0, GRAVITY]),
        earth_rate_t=EARTH,
    )


def by_hand(p: nonlinear_error.Point) -> tuple[Array, Array]:
    """Eqs. 9 and 10 at the same place."""
    rate = p.rate_reading - p.gyro_bias
    F = error_model.f_full(p.rotation, p.velocity, rate, p.gravity_t, p.earth_rate_t)
    return F, error_model.g_full(p.rotation, p.velocity)


@pytest.mark.parametrize("attitude_deg", ATTITUDES_DEG)
def test_blocks_equal_the_complex_step(attitude_deg: tuple[float, float, float]) -> None:
    """Every entry of F and G (E8) to 1e-12: an imaginary step has no cancellation to allow for."""
    p = point(*attitude_deg)
    F, G = by_hand(p)
    F_step, G_step = nonlinear_error.differentiate(p)
    np.testing.assert_allclose(F, F_step, atol=1e-12)
    np.testing.assert_allclose(G, G_step, atol=1e-12)


@pytest.mark.parametrize("attitude_deg", ATTITUDES_DEG)
def test_blocks_equal_central_differences(attitude_deg: tuple[float, float, float]) -> None:
    """The same with real steps both ways, to 1e-6: guards the complex arithmetic of the oracle itself."""
    p = point(*attitude_deg)
    F, G = by_hand(p)
    step = 1e-5
    for column in range(20):
        error = np.zeros(20)
        error[column] = step
        slope = (
            nonlinear_error.error_rate(p, error, np.zeros(17))
            - nonlinear_error.error_rate(p, -error, np.zeros(17))
        ) / (2 * step)
        np.testing.assert_allclose(slope, F[:, column], atol=1e-6)
    for column in range(17):
        noise = np.zeros(17)
        noise[column] = step
        slope = (
            nonlinear_error.error_rate(p, np.zeros(20), noise)
            - nonlinear_error.error_rate(p, np.zeros(20), -noise)
        ) / (2 * step)
        np.testing.assert_allclose(slope, G[:, column], atol=1e-6)


def test_the_opposite_sign_of_the_error_is_told_apart() -> None:
    """A check that cannot fail proves nothing: F of the estimate-minus-truth convention is rejected."""
    p = point(*ATTITUDES_DEG[0])
    F, _ = by_hand(p)
    F_step, _ = nonlinear_error.differentiate(p)
    wrong = F.copy()
    wrong[error_model.V, error_model.RHO] *= -1
    assert np.abs(wrong - F_step).max() > 1


def test_two_integrated_motions_separate_as_the_transition_says() -> None:
    """Two runs of the differential equation that differ slightly part by Φ δx, over 2 s of a constant reading."""
    rate, force = np.array([0.01, -0.02, 0.05]), np.array([0.2, 0.1, -9.7])
    q0, v0 = quaternion_from_euler(0.1, 0.2, 0.3), np.array([2.0, 0.1, -0.1])
    rng = np.random.default_rng(9)
    error = np.concatenate([rng.normal(0, 1e-3, 3), rng.normal(0, 1e-6, 3), rng.normal(0, 1e-5, 3)])
    times = np.linspace(0.0, 2.0, 201)

    def integrated(position: Array, q: Array, v: Array) -> mechanisation.Motion:
        return mechanisation.integrate(
            (position, q, v), lambda _: rate, lambda _: force, GRAVITY, EARTH, times
        )

    low = integrated(np.zeros(3), q0, v0)
    half = np.concatenate([[1.0], error[3:6] / 2])

    high = integrated(error[:3], quaternion_product(half, q0), v0 + error[6:9])
    Phi = np.eye(9)
    for k in range(200):
        middle = [
            error_model.f_ins(
                matrix_from_quaternion(low.quaternion[j]),
                low.velocity[j],
                rate,
                np.array([0, 0, GRAVITY]),
                EARTH,
            )[:9, :9]
            for j in (k, k + 1)
        ]
        step = (middle[0] + middle[1]) / 2 * 0.01
        Phi = (np.eye(9) + step + step @ step / 2) @ Phi
    predicted = Phi @ error
    rho = log_rotation(
        matrix_from_quaternion(high.quaternion[-1]) @ matrix_from_quaternion(low.quaternion[-1]).T
    )
    actual = np.concatenate([high.position[-1] - low.position[-1], rho, high.velocity[-1] - low.velocity[-1]])
    np.testing.assert_allclose(actual, predicted, atol=1e-8)


@pytest.mark.parametrize("latitude_deg", [32.8, -45.0])
def test_rest_on_a_turning_earth_is_rest(latitude_deg: float) -> None:
    """Hand-worked: a gyro that reads Earth rate and an accelerometer that reads −g describe a vehicle that stays."""
    q = quaternion_from_euler(0.3, -0.4, 2.0)
    R = matrix_from_quaternion(q)
    earth = mechanisation.earth_rate_tangent(np.deg2rad(latitude_deg))
    rate, force = R.T @ earth, R.T @ np.array([0, 0, -GRAVITY])
    end = mechanisation.integrate(
        (np.zeros(3), q, np.zeros(3)), lambda _: rate, lambda _: force, GRAVITY, earth, np.array([0.0, 100.0])
    )
    assert np.abs(end.position[-1]).max() < 1e-8
    assert np.abs(end.quaternion[-1] - q).max() < 1e-10


@pytest.mark.parametrize(("latitude_deg", "east_mps"), [(32.8, 1.5801e-3), (-45.0, -2.0625e-3)])
def test_coriolis_turns_a_free_body_to_the_right_in_the_north(latitude_deg: float, east_mps: float) -> None:
    """Hand-worked: after 10 s at 2 m/s to the north, by 2 Ω sin φ v t to the east; in the south to the west."""
    speed, seconds = 2.0, 10.0
    q = np.array([1.0, 0.0, 0.0, 0.0])
    earth = mechanisation.earth_rate_tangent(np.deg2rad(latitude_deg))
    # Fixed in the tangent frame: the gyro reads Earth rate, the accelerometer only weight.
    end = mechanisation.integrate(
        (np.zeros(3), q, np.array([speed, 0.0, 0.0])),
        lambda _: earth,
        lambda _: np.array([0.0, 0.0, -GRAVITY]),
        GRAVITY,
        earth,
        np.array([0.0, seconds]),
    )
    assert end.velocity[-1, 1] == pytest.approx(east_mps, rel=1e-3)


def test_steady_turn_closes_its_circle() -> None:
    """Hand-worked: yaw rate r at speed u needs the specific force u r to starboard and closes after 2π/r."""
    speed, rate = 2.0, 0.1
    end = mechanisation.integrate(
        (np.zeros(3), np.array([1.0, 0, 0, 0]), np.array([speed, 0, 0])),
        lambda _: np.array([0, 0, rate]),
        lambda _: np.array([0, speed * rate, -GRAVITY]),
        GRAVITY,
        np.zeros(3),
        np.array([0.0, np.pi / rate, 2 * np.pi / rate]),
    )
    np.testing.assert_allclose(end.position[1], [0, 2 * speed / rate, 0], atol=1e-8)
    np.testing.assert_allclose(end.position[2], [0, 0, 0], atol=1e-8)


def test_rotations_agree_with_each_other() -> None:
    """Euler angles by matrices and by quaternions are one rotation; logarithm undoes the exponential."""
    angles = (0.3, -1.2, 2.5)
    np.testing.assert_allclose(
        matrix_from_quaternion(quaternion_from_euler(*angles)), matrix_from_euler(*angles), atol=1e-15
    )
    vector = np.array([0.5, -1.0, 2.0])
    np.testing.assert_allclose(log_rotation(exp_rotation(vector)), vector, atol=1e-13)
    # Yaw of 90° turns the bow to the east.
    np.testing.assert_allclose(matrix_from_euler(0, 0, np.pi / 2) @ [1, 0, 0], [0, 1, 0], atol=1e-15)
