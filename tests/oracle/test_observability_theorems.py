"""By symbols: errata E10 and E12, directions that no window shows and the sign of H; the error through the water."""

import numpy as np
import pytest
import sympy as sp

from tests.oracle.rotations import exp_rotation, matrix_from_euler, skew

t, g = sp.symbols("t g", positive=True)
DOWN = sp.Matrix([0, 0, 1])


def cross(a: sp.Matrix) -> sp.Matrix:
    """[a×]."""
    return sp.Matrix([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def turn(yaw: sp.Expr) -> sp.Matrix:
    """Body to tangent after a turn in yaw."""
    return sp.Matrix([[sp.cos(yaw), -sp.sin(yaw), 0], [sp.sin(yaw), sp.cos(yaw), 0], [0, 0, 1]])


def attitude(yaw: str, pitch: str, roll: str) -> sp.Matrix:
    """Platform to tangent, by three angles that are any functions of time."""
    a, b, c = (sp.Function(name)(t) for name in (yaw, pitch, roll))
    about_y = sp.Matrix([[sp.cos(b), 0, sp.sin(b)], [0, 1, 0], [-sp.sin(b), 0, sp.cos(b)]])
    about_x = sp.Matrix([[1, 0, 0], [0, sp.cos(c), -sp.sin(c)], [0, sp.sin(c), sp.cos(c)]])
    return turn(a) * about_y * about_x


def residuals(
    T: sp.Matrix, v_t: sp.Matrix, error: tuple[sp.Matrix, ...], sign: int
) -> tuple[sp.Matrix, sp.Matrix, sp.Matrix]:
    """What Eq. 4 of the 2015 paper leaves of a claimed solution, and what the DVL reads of it."""
    velocity, tilt, accel_bias, gyro_bias = error
    force = v_t.diff(t) - g * DOWN
    in_velocity = velocity.diff(t) - (-cross(force) * tilt + T * accel_bias)
    in_tilt = tilt.diff(t) - T * gyro_bias
    reading = T.T * velocity + sign * T.T * cross(v_t) * tilt
    return tuple(part.applyfunc(sp.simplify) for part in (in_velocity, in_tilt, reading))


@pytest.mark.parametrize("sign", [1, -1])
def test_a_motion_constant_in_the_body_hides_three_directions(sign: int) -> None:
    """Any velocity in the body, any yaw rate: e is free, and zero reading follows for all times."""
    rate = sp.symbols("omega", nonzero=True)
    v, e = sp.Matrix(sp.symbols("v1:4")), sp.Matrix(sp.symbols("e1:4"))
    omega, T = rate * DOWN, turn(rate * t)
    force = omega.cross(v) - g * DOWN
    d = -sign * v.cross(e)
    # The body's velocity error d is at rest: 0 = −ω × d − f × e + b_a.
    accel_bias = omega.cross(d) + force.cross(e)
    error = (T * d, T * e, accel_bias, omega.cross(e))
    assert all(part == sp.zeros(3, 1) for part in residuals(T, T * v, error, sign))


def test_a_surging_vehicle_that_only_yaws_hides_a_fourth() -> None:
    """Any yaw history: gyro bias z is undone by accelerometer bias y; the printed sign reads it."""
    yaw = sp.Function("psi")(t)
    speed, bias = sp.symbols("v beta", nonzero=True)
    T = turn(yaw)
    error = (
        T * sp.Matrix([0, bias * speed * t, 0]),
        sp.Matrix([0, 0, bias * t]),
        sp.Matrix([0, bias * speed, 0]),
        sp.Matrix([0, 0, bias]),
    )
    v_t = T * sp.Matrix([speed, 0, 0])
    assert all(part == sp.zeros(3, 1) for part in residuals(T, v_t, error, 1))
    printed = residuals(T, v_t, error, -1)[2]
    assert printed == sp.Matrix([0, 2 * bias * speed * t, 0])


def test_heading_is_hidden_whatever_the_motion() -> None:
    """Any attitude and any velocity: a turn of the whole past about the vertical is not read; printed H reads it."""
    v_t = sp.Matrix([sp.Function(name)(t) for name in ("p", "q", "r")])
    T = attitude("a", "b", "c")
    error = (DOWN.cross(v_t), DOWN, sp.zeros(3, 1), sp.zeros(3, 1))
    in_velocity, in_tilt, reading = residuals(T, v_t, error, 1)
    assert in_velocity == in_tilt == reading == sp.zeros(3, 1)
    printed = residuals(turn(sp.Function("a")(t)), v_t, error, -1)[2]
    assert printed != sp.zeros(3, 1)


def test_the_sign_of_the_reading_by_complex_step() -> None:
    """Erratum E12: with T = Exp([ε×]) T̂, as Eq. 4 has it, the reading changes by +Tᵀ(v×)ε."""
    T_hat, v = matrix_from_euler(0.1, -0.4, 2.0), np.array([3.0, -1.0, 0.5])
    derivative = np.empty((3, 3))
    for k in range(3):
        step = np.zeros(3, dtype=complex)
        step[k] = 1e-30j
        derivative[:, k] = ((exp_rotation(step) @ T_hat).T @ v).imag / 1e-30
    np.testing.assert_allclose(derivative, T_hat.T @ skew(v), rtol=0.0, atol=1e-14)


def test_the_sign_of_the_dynamics_by_complex_step() -> None:
    """The same T = Exp([ε×]) T̂ gives the −(f×)ε of Eq. 4, so both signs belong to one definition."""
    T_hat, f_b = matrix_from_euler(0.1, -0.4, 2.0), np.array([0.3, 0.2, -9.0])
    derivative = np.empty((3, 3))
    for k in range(3):
        step = np.zeros(3, dtype=complex)
        step[k] = 1e-30j
        derivative[:, k] = (exp_rotation(step) @ T_hat @ f_b).imag / 1e-30
    np.testing.assert_allclose(derivative, -skew(T_hat @ f_b), rtol=0.0, atol=1e-13)


def test_the_row_is_the_derivative_of_the_reading() -> None:
    """By complex step, also on end: ρ, δv and δc through R = Exp([ρ×]) R̂ and c = Exp([ρ_D e_D×]) ĉ + δc."""
    c, v, b = np.array([0.25, -0.1875, 0.0]), np.array([2.0, -0.3, 0.1]), np.array([0.24, -0.24, 0.94])
    for pitch in (0.3, -0.5 * np.pi, 0.5 * np.pi - 1e-9):
        R = matrix_from_euler(0.2, pitch, 1.1)
        found = np.empty(8)
        for k in range(8):
            error = np.zeros(8, dtype=complex)
            error[k] = 1e-30j
            tilt, faster, drift = error[:3], error[3:6], np.append(error[6:], 0.0)
            true_c = exp_rotation(np.array([0.0, 0.0, 1.0]) * tilt[2]) @ c + drift
            found[k] = (b @ (v + faster - (exp_rotation(tilt) @ R).T @ true_c)).imag / 1e-30
        by_tilt = np.cross(c, R @ b) * [1.0, 1.0, 0.0]
        np.testing.assert_allclose(found, [*by_tilt, *b, *-(R @ b)[:2]], rtol=0.0, atol=1e-14)


@pytest.mark.long
def test_the_error_through_the_water_moves_as_that_over_ground_for_any_motion() -> None:
    """By symbols: δu = δv + Rᵀ(ρ_h × c) − Rᵀδc obeys the equation of δv with u in place of v."""
    R = attitude("psi", "theta", "phi")
    v, dv, rho = (sp.Matrix([sp.Function(f"{name}{k}")(t) for k in range(3)]) for name in ("v", "dv", "rho"))
    dc = sp.Matrix([sp.Function("dc0")(t), sp.Function("dc1")(t), 0])
    c = sp.Matrix([*sp.symbols("c0 c1"), 0])
    b_a, b_g = (sp.Matrix(sp.symbols(f"{name}0:3")) for name in ("ba", "bg"))
    spin = (R.T * R.diff(t)).applyfunc(sp.simplify)

    def rate(of: sp.Matrix, along: sp.Matrix) -> sp.Matrix:
        return R.T * cross(g * DOWN) * rho - spin * of - b_a - along.cross(b_g)

    rho_rate, level = -R * b_g, sp.Matrix([rho[0], rho[1], 0])
    given = dict(zip(rho.diff(t), rho_rate, strict=True))
    given |= dict(zip(dv.diff(t), rate(dv, v), strict=True))
    given |= dict(zip(dc.diff(t)[:2], (-rho_rate[2] * DOWN.cross(c))[:2], strict=True))
    du = dv + R.T * level.cross(c) - R.T * dc
    left = du.diff(t).subs(given) - rate(du, v - R.T * c)
    assert left.applyfunc(lambda part: sp.simplify(sp.expand(part))) == sp.zeros(3, 1)
