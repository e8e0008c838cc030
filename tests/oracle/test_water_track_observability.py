"""What water track leaves open: docs/observability.md, by symbols for any motion and by exact ranks for some."""

import itertools
from fractions import Fraction
from functools import cache

import numpy as np
import pytest
import sympy as sp

from tests.oracle.observability_rows import ZERO, Rows, stacked
from tests.oracle.observability_series import (
    PRIMES,
    Field,
    Matrix,
    Motion,
    dip_of_time,
    filter_system,
    observability_rows,
    rank,
    sine_of_time,
)
from tests.oracle.rotations import exp_rotation, matrix_from_euler
from tests.oracle.water_track_rows import (
    CURRENT,
    STATES,
    WaterSystem,
    lifted,
    water_beam,
    water_system,
    widened,
)

Q = Fraction
GRAVITY, ORDER = Q(157, 16), 20
C_T = (Q(1, 4), Q(-3, 16), Q(0))
STEADY = Q(0)
# 2 · 8² + 31² = 33²: unit vectors with rational components, 20.05° from the vertical.
DIRECTIONS = [(Q(8 * x, 33), Q(8 * y, 33), Q(31, 33)) for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
LEVERS = [(Q(1, 2), Q(k, 8), Q(1, 4)) for k in range(4)]
SPEEDING = [[Q(2), Q(0), Q(0)], [Q(1, 20), Q(1, 30), Q(0)], [Q(0), Q(0), Q(1, 90)]]
MOTIONS: dict[str, Motion] = {
    "hover": ([Q(0)], [Q(0)], [[Q(0)] * 3]),
    "straight": ([Q(0)], [Q(0)], [[Q(2), Q(0), Q(0)]]),
    "yaw turn": ([Q(0), Q(1, 16)], [Q(0)], [[Q(2), Q(0), Q(0)]]),
    "figure eight": (sine_of_time(Q(5, 2), Q(1, 8), ORDER + 6), [Q(0)], [[Q(2), Q(0), Q(0)]]),
    "dive and turn": ([Q(0), Q(1, 16)], dip_of_time(Q(-1, 4), Q(1, 8), ORDER + 6), SPEEDING),
}
RICH = "dive and turn"
VELOCITY, TILT = 6, 3
# Without the DVL's own errors: position, tilt, velocity, inertial biases, current.
WITHOUT_DVL = [*range(15), CURRENT, CURRENT + 1]


def unit(*places: int) -> list[int]:
    """A direction with ones at some states."""
    return [int(k in places) for k in range(STATES)]


def shifts(field: Field) -> Matrix:
    """(v_t, c) → (v_t + δ, c + δ), north and east; platform axes are the tangent ones at the start."""
    return field.matrix([unit(VELOCITY + k, CURRENT + k) for k in range(2)])


@cache
def system_of(name: str, prime: int | None, *, yaw_drift: bool = True, per_time: Q = STEADY) -> WaterSystem:
    return water_system(
        Field(prime), MOTIONS[name], C_T, GRAVITY, ORDER, yaw_drift=yaw_drift, per_time=per_time
    )


@cache
def water_rows(name: str, prime: int | None, *, yaw_drift: bool = True, per_time: Q = STEADY) -> Matrix:
    """(order + 1, 6, 22): four beams of the water, depth and heading."""
    field, system = Field(prime), system_of(name, prime, yaw_drift=yaw_drift, per_time=per_time)
    beams = [water_beam(field, system, k, DIRECTIONS[k], LEVERS[k]) for k in range(4)]
    along_v = Rows(field, system.over_ground, ZERO, ORDER)
    others = [widened(field, rows) for rows in (along_v.depth(), along_v.heading())]
    return observability_rows(field, system.f, stacked(field, *beams, *others), ORDER).reshape(-1, 6, STATES)


@cache
def bottom_rows(name: str, prime: int | None) -> Matrix:
    """(order + 1, 4, 20): four beams of the bottom, along u."""
    field = Field(prime)
    f = filter_system(field, MOTIONS[name], GRAVITY, ZERO, ORDER)
    along_u = Rows(field, MOTIONS[name], ZERO, ORDER)
    beams = [along_u.beam(k, DIRECTIONS[k], LEVERS[k]) for k in range(4)]
    return observability_rows(field, f, stacked(field, *beams), ORDER).reshape(-1, 4, 20)


MASKS = [mask for count in range(1, 5) for mask in itertools.combinations(range(4), count)]


@pytest.mark.parametrize("name", MOTIONS)
def test_water_shows_what_the_bottom_would_along_u(name: str) -> None:
    """Every mask, with beam biases, scale factor and lever arms: the rank is that of bottom beams along u = v − Rᵀc.

    Two of the 22 directions more than of the 20 are open, and those two are the shift.
    """
    for mask, prime in itertools.product(MASKS, PRIMES):
        field = Field(prime)
        water = water_rows(name, prime)[:, list(mask)].reshape(-1, STATES)
        bottom = bottom_rows(name, prime)[:, list(mask)].reshape(-1, 20)
        assert rank(field, water) == rank(field, bottom), mask
        assert rank(field, water[: -4 * len(mask)]) == rank(field, water), "the order is too low"
        assert not field.reduce(water @ shifts(field).T).any()


@pytest.mark.parametrize("name", MOTIONS)
def test_the_rows_are_those_of_the_bottom_in_other_coordinates(name: str) -> None:
    """H Φ of the water on a lifted direction is H Φ of the bottom along u, coefficient by coefficient."""
    field = Field(PRIMES[0])
    water, bottom = water_rows(name, PRIMES[0])[:, :4], bottom_rows(name, PRIMES[0])
    basis = lifted(field, system_of(name, PRIMES[0]), field.eye(20))
    np.testing.assert_array_equal(field.reduce(water.reshape(-1, STATES) @ basis.T), bottom.reshape(-1, 20))


@pytest.mark.first_cases(1)
@pytest.mark.parametrize(
    ("sensors", "open_places"),
    [
        ([4, 5], [(0,), (1,)]),
        ([], [(0,), (1,), (2,), (5,)]),
        ([4], [(0,), (1,), (5,)]),
        ([5], [(0,), (1,), (2,)]),
    ],
    ids=["depth and heading", "water alone", "depth", "heading"],
)
def test_exactly_the_shift_position_and_yaw(sensors: list[int], open_places: list[tuple[int, ...]]) -> None:
    """A motion that turns, dives and changes its speed: this list is open and nothing else, over fractions too."""
    for prime in (PRIMES[0], None):
        field = Field(prime)
        rows = water_rows(RICH, prime)[: ORDER + 1 if prime else 9, [0, 1, 2, 3, *sensors]].reshape(
            -1, STATES
        )
        claimed = np.vstack([field.matrix([unit(*places) for places in open_places]), shifts(field)])
        assert not field.reduce(rows @ claimed.T).any()
        assert rank(field, claimed) == len(claimed)
        assert rank(field, rows[:, WITHOUT_DVL]) == len(WITHOUT_DVL) - len(claimed)


def test_a_bottom_ping_closes_it() -> None:
    """One ping of the bottom's beams at the start: no shift is left, and all but position and yaw is seen."""
    field = Field(PRIMES[0])
    rows = water_rows(RICH, PRIMES[0])[:, :4].reshape(-1, STATES)
    bottom = Rows(field, system_of(RICH, PRIMES[0]).over_ground, ZERO, ORDER)
    ping = np.vstack([widened(field, bottom.beam(k, DIRECTIONS[k]))[0] for k in range(4)])
    assert field.reduce(ping @ shifts(field).T).any()
    assert rank(field, np.vstack([rows, ping])[:, WITHOUT_DVL]) == len(WITHOUT_DVL) - 4


@pytest.mark.parametrize("name", MOTIONS)
def test_what_the_filter_neglects_of_the_current_shows_nothing_more(name: str) -> None:
    """The filter neglects that the estimated north drifts with the gyro bias: the shift is as open as before."""
    field = Field(PRIMES[0])
    exact, filters = (
        water_rows(name, PRIMES[0], yaw_drift=drift)[:, :4].reshape(-1, STATES) for drift in (True, False)
    )
    assert (exact != filters).any()
    assert not field.reduce(filters @ shifts(field).T).any()
    assert rank(field, filters) == rank(field, exact)


def test_a_current_that_returns_to_its_mean_shows_the_shift_by_its_prior_alone() -> None:
    """With 1/τ in the dynamics the two ranks more are formal: δ − δ exp(−t/τ) is what the water says of it."""
    field = Field(PRIMES[0])
    rows = water_rows(RICH, PRIMES[0], per_time=Q(1, 1800))[:, :4].reshape(-1, STATES)
    assert rank(field, rows[:, WITHOUT_DVL]) == len(WITHOUT_DVL) - 4


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


t, g = sp.symbols("t g", positive=True)
DOWN = sp.Matrix([0, 0, 1])


def cross(a: sp.Matrix) -> sp.Matrix:
    """[a×]."""
    return sp.Matrix([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def any_attitude() -> sp.Matrix:
    """Platform to tangent, of yaw, pitch and roll that are any functions of time."""
    yaw, pitch, roll = (sp.Function(name)(t) for name in ("psi", "theta", "phi"))
    about_z = sp.Matrix([[sp.cos(yaw), -sp.sin(yaw), 0], [sp.sin(yaw), sp.cos(yaw), 0], [0, 0, 1]])
    about_y = sp.Matrix([[sp.cos(pitch), 0, sp.sin(pitch)], [0, 1, 0], [-sp.sin(pitch), 0, sp.cos(pitch)]])
    about_x = sp.Matrix([[1, 0, 0], [0, sp.cos(roll), -sp.sin(roll)], [0, sp.sin(roll), sp.cos(roll)]])
    return about_z * about_y * about_x


@pytest.mark.long
def test_the_error_through_the_water_moves_as_that_over_ground_for_any_motion() -> None:
    """By symbols: δu = δv + Rᵀ(ρ_h × c) − Rᵀδc obeys the equation of δv with u in place of v."""
    R = any_attitude()
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
