"""Rows and dynamics of water track as power series with exact coefficients: the filter's 20 states and a current.

Errors are true minus estimate, R = Exp([ρ×]) R̂ and, of the current, c = Exp([ρ_D e_D×]) ĉ + δc. A beam that the water
returned reads bᵀ(v − Rᵀc + ω × l)(1 + s) + bias; with u = v − Rᵀc its derivative is that of a bottom beam along u, the
tilt through Rᵀ(ρ_h × c), ρ_h the horizontal part, and −Rᵀδc.
"""

from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

from tests.oracle.observability_rows import ZERO, Rows
from tests.oracle.observability_series import (
    Field,
    Matrix,
    Motion,
    Series,
    add,
    constant,
    cross,
    filter_system,
    product,
    rotation_and_velocity,
    transpose,
)

STATES, CURRENT = 22, 20


class WaterSystem(NamedTuple):
    """F (22 states), and what rows need: the motion through the water and the current."""

    f: Series
    through_water: Motion
    over_ground: Motion
    current_t: Matrix
    order: int


def over_ground(through_water: Motion, current_t: Sequence[Fraction], order: int) -> Motion:
    """The motion with v = u + Rᵀc."""
    field = Field()
    R, u = rotation_and_velocity(field, through_water, order)
    c = constant(field, field.matrix([[x] for x in current_t]), order)
    v = add(field, (1, u), (1, product(field, transpose(R), c)))
    yaw, pitch, _ = through_water
    return yaw, pitch, [[m[k, 0] for k in range(3)] for m in v]


def water_system(
    field: Field,
    through_water: Motion,
    current_t: Sequence[Fraction],
    gravity: Fraction,
    order: int,
    *,
    yaw_drift: bool = True,
    per_time: Fraction = Fraction(0),
) -> WaterSystem:
    """The 20 states along v on an Earth at rest, and a steady current.

    Args:
        field: the numbers.
        through_water: yaw, pitch and u in platform axes.
        current_t: north, east and zero.
        gravity: its size.
        order: of the series.
        yaw_drift: δc' = (R δb_g)_D e_D × c, what c' = 0 says; without it zero, as the filter has it.
        per_time: 1/τ in δc' = −δc/τ.
    """
    motion = over_ground(through_water, current_t, order + 4)
    small = filter_system(field, motion, gravity, ZERO, order)
    R, _ = rotation_and_velocity(field, motion, order + 2)
    c = field.matrix([[x] for x in current_t])
    across = field.matrix([[-current_t[1]], [current_t[0]]])
    f = []
    for k, m in enumerate(small):
        wide = field.zeros(STATES, STATES)
        wide[:20, :20] = m
        if yaw_drift:
            wide[CURRENT:, 12:15] = field.reduce(across @ R[k][2:3])
        if k == 0:
            wide[CURRENT:, CURRENT:] = field.reduce(field.eye(2) * field.number(-per_time))
        f.append(wide)
    return WaterSystem(f, through_water, motion, c, order)


def water_beam(
    field: Field,
    system: WaterSystem,
    number: int,
    direction: Sequence[Fraction],
    lever: Sequence[Fraction] = ZERO,
) -> Series:
    """The row of a beam; beams count from 0."""
    along_u = Rows(field, system.through_water, ZERO, system.order)
    rows = along_u.beam(number, direction, lever)
    turned = product(
        field, constant(field, field.matrix([list(direction)]), system.order + 2), transpose(along_u.R)
    )
    out = []
    for k in range(system.order + 1):
        wide = field.zeros(1, STATES)
        wide[:, :20] = rows[k]
        # bᵀRᵀ(ρ × c) = −bᵀRᵀ[c×]ρ without its third column.
        by_tilt = field.reduce(-turned[k] @ cross(system.current_t))
        wide[:, 3:5] = field.reduce(wide[:, 3:5] + by_tilt[:, :2])
        wide[:, CURRENT:] = field.reduce(-turned[k][:, :2])
        out.append(wide)
    return out


def lifted(field: Field, system: WaterSystem, along_u: Matrix) -> Matrix:
    """Directions (n, 20) at the start, of δu in place of δv, as (n, 22) directions with δc = 0: δv = δu − Rᵀ(ρ_h × c).

    R is the identity there.
    """
    out = field.zeros(len(along_u), STATES)
    out[:, :20] = along_u
    tilt = along_u[:, 3:6].copy()
    tilt[:, 2] = field.number(0)
    out[:, 6:9] = field.reduce(out[:, 6:9] - cross_rows(tilt, system.current_t))
    return out


def cross_rows(rows: Matrix, column: Matrix) -> Matrix:
    crossed: Matrix = (-cross(column) @ rows.T).T
    return crossed


def widened(field: Field, rows: Series) -> Series:
    """Rows of a sensor that the current does not reach."""
    out = []
    for m in rows:
        wide = field.zeros(len(m), STATES)
        wide[:, :20] = m
        out.append(wide)
    return out
