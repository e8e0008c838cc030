"""Rows of every sensor of the 20-state filter as power series with exact coefficients (Tal et al. 2017, Eq. 22).

Errors are true minus estimate, R = Exp([ρ×]) R̂, and a bias error −δb_g is an error of the rate, so that
δω_tp = −δb_g − Rᵀ [ω_ie×] ρ; every row below is the derivative of its reading by these.
"""

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from tests.oracle.observability_series import (
    Field,
    Matrix,
    Motion,
    Series,
    add,
    constant,
    cross,
    crosses,
    derivative,
    product,
    rotation_and_velocity,
    transpose,
)

ZERO = (Fraction(0),) * 3


class Rows:
    """Coefficients of rows along a motion; each method gives those of one sensor, to order `order`."""

    def __init__(self, field: Field, motion: Motion, earth_rate_t: Sequence[Fraction], order: int) -> None:
        self.field, self.order = field, order
        self.R, self.v = rotation_and_velocity(field, motion, order + 2)
        to_body = transpose(self.R)
        self.spin = product(field, to_body, derivative(field, self.R))  # [ω_tp×]
        earth = constant(field, field.matrix([[x] for x in earth_rate_t]), order + 2)
        # −δω_tp by ρ
        self.rate_by_tilt = product(field, to_body, crosses(field, earth))

    def _column(self, vector: Sequence[Fraction]) -> Series:
        return constant(self.field, self.field.matrix([[x] for x in vector]), self.order + 2)

    def _rows(self, count: int, blocks: dict[int, Series]) -> Series:
        out = []
        for k in range(self.order + 1):
            m = self.field.zeros(count, 20)
            for column, series in blocks.items():
                m[:, column : column + series[k].shape[1]] = self.field.reduce(series[k])
            out.append(m)
        return out

    def _fixed(self, m: Matrix) -> Series:
        return constant(self.field, m, self.order + 2)

    def beam(self, number: int, direction: Sequence[Fraction], lever: Sequence[Fraction] = ZERO) -> Series:
        """bᵀ(v + ω_tp × l)(1 + s) + bias; beams count from 0."""
        b = self.field.matrix([list(direction)])
        by_rate = self._fixed(self.field.reduce(b @ cross(self.field.matrix([[x] for x in lever]))))  # bᵀ[l×]
        blocks = {
            3: product(self.field, by_rate, self.rate_by_tilt),
            6: self._fixed(b),
            12: by_rate,
            19: product(self.field, self._fixed(b), self.v),
        }
        if number < 4:
            blocks[15 + number] = self._fixed(self.field.eye(1))
        return self._rows(1, blocks)

    def depth(self, lever: Sequence[Fraction] = ZERO) -> Series:
        """Third component of r + R l."""
        arm = product(self.field, self.R, self._column(lever))
        tilt = [self.field.reduce(-cross(m))[2:3] for m in arm]
        return self._rows(1, {0: self._fixed(self.field.matrix([[0, 0, 1]])), 3: tilt})

    def attitude(self) -> Series:
        """ρ itself."""
        return self._rows(3, {3: self._fixed(self.field.eye(3))})

    def heading(self) -> Series:
        """With level wings (cos ψ tan θ, sin ψ tan θ, 1), here times cos θ, which is never 0: R's third column."""
        return self._rows(1, {3: [m[:, 2:3].T for m in self.R]})

    def gps_position(self, lever: Sequence[Fraction] = ZERO) -> Series:
        """Position of the antenna: r + R l."""
        arm = product(self.field, self.R, self._column(lever))
        return self._rows(3, {0: self._fixed(self.field.eye(3)), 3: [-cross(m) for m in arm]})

    def gps_velocity(self, lever: Sequence[Fraction] = ZERO) -> Series:
        """R (v + ω_tp × l): its rate's error comes through R [l×]."""
        arm = self._column(lever)
        antenna = product(
            self.field, self.R, add(self.field, (1, self.v), (1, product(self.field, self.spin, arm)))
        )
        by_rate = product(self.field, self.R, crosses(self.field, arm))
        tilt = add(
            self.field,
            (1, product(self.field, by_rate, self.rate_by_tilt)),
            (-1, crosses(self.field, antenna)),
        )
        return self._rows(3, {3: tilt, 6: self.R, 12: by_rate})


def stacked(field: Field, *sensors: Series) -> Series:
    """Rows of several sensors, one below the other."""
    return [field.reduce(np.vstack(parts)) for parts in zip(*sensors, strict=True)]
