"""Ranks in exact arithmetic: the rows H(t) Φ(t, t₀) as power series with rational coefficients, eliminated exactly.

For a motion that is analytic over the window, H Φ u = 0 on the window if and only if every coefficient of its power
series at the start gives zero, so the rank of the coefficients is the rank of the window. Motions are sines and cosines
of rational angles from zero, whose series are rational. A quiet leg before has a nilpotent F, hence an exact Φ.

Numbers are integers modulo a prime of 61 bits: the rank modulo a prime never exceeds the rational one, and falls short
only if the prime divides every largest minor, which two primes do not.
"""

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.object_]
Series = list[Matrix]
PRIMES = (2**61 - 1, 2**61 - 31)


class Field:
    """Integers modulo a prime."""

    def __init__(self, prime: int) -> None:
        self.prime = prime

    def number(self, value: Fraction | int) -> int:
        """A rational number."""
        exact = Fraction(value)
        return exact.numerator * pow(exact.denominator, -1, self.prime) % self.prime

    def reduce(self, m: Matrix) -> Matrix:
        """The canonical form of every entry."""
        reduced: Matrix = m % self.prime
        return reduced

    def inverse(self, value: int) -> int:
        """The reciprocal."""
        return pow(int(value), -1, self.prime)

    def matrix(self, rows: Sequence[Sequence[Fraction | int]]) -> Matrix:
        """A matrix from rows."""
        out = np.empty((len(rows), len(rows[0])), dtype=object)
        for i, row in enumerate(rows):
            for j, value in enumerate(row):
                out[i, j] = self.number(value)
        return out

    def zeros(self, rows: int, columns: int) -> Matrix:
        """Nothing but zeros."""
        return self.matrix([[0] * columns] * rows)

    def eye(self, size: int) -> Matrix:
        """The identity."""
        return self.matrix([[int(i == j) for j in range(size)] for i in range(size)])


def product(field: Field, a: Series, b: Series) -> Series:
    """Cauchy's product, to the shorter order."""
    order = min(len(a), len(b))
    out = []
    for k in range(order):
        total = a[0] @ b[k]
        for j in range(1, k + 1):
            total = total + a[j] @ b[k - j]
        out.append(field.reduce(total))
    return out


def derivative(field: Field, a: Series) -> Series:
    """One order is lost."""
    return [field.reduce(a[k + 1] * (k + 1)) for k in range(len(a) - 1)]


def transpose(a: Series) -> Series:
    return [m.T for m in a]


def scalar(field: Field, values: Sequence[Fraction | int], order: int) -> Series:
    """A polynomial as 1 × 1 matrices."""
    padded = [*values, *([0] * order)][: order + 1]
    return [field.matrix([[value]]) for value in padded]


def cosine_and_sine(field: Field, angle: Series) -> tuple[Series, Series]:
    """Of an angle that is zero at the start, from c' = −s θ' and s' = c θ'."""
    assert angle[0][0, 0] == 0
    slope = derivative(field, angle)
    c, s = [field.matrix([[1]])], [field.matrix([[0]])]
    for k in range(len(slope)):
        inverse = field.inverse(field.number(k + 1))
        up = sum((c[j] @ slope[k - j] for j in range(k + 1)), field.zeros(1, 1))
        down = sum((s[j] @ slope[k - j] for j in range(k + 1)), field.zeros(1, 1))
        s.append(field.reduce(up * inverse))
        c.append(field.reduce(-down * inverse))
    return c, s


def sine_of_time(size: Fraction, rate: Fraction, order: int) -> list[Fraction]:
    """Coefficients of size · sin(rate · t)."""
    out, factorial = [], 1
    for k in range(order + 1):
        factorial *= max(k, 1)
        sign = (0, 1, 0, -1)[k % 4]
        out.append(size * sign * rate**k / factorial)
    return out


def dip_of_time(size: Fraction, rate: Fraction, order: int) -> list[Fraction]:
    """Coefficients of size · (1 − cos(rate · t))."""
    out, factorial = [], 1
    for k in range(order + 1):
        factorial *= max(k, 1)
        sign = (0, 0, 1, 0)[k % 4] - (1 if k % 4 == 0 and k > 0 else 0)
        out.append(size * sign * rate**k / factorial)
    return out


def rotation(field: Field, yaw: Series, pitch: Series) -> Series:
    """Platform to tangent, z-y-x with level wings."""
    cy, sy = cosine_and_sine(field, yaw)
    cp, sp = cosine_and_sine(field, pitch)
    about_z, about_y = [], []
    for k in range(len(cy)):
        one = field.number(int(k == 0))
        z, y = field.zeros(3, 3), field.zeros(3, 3)
        z[0, 0] = z[1, 1] = cy[k][0, 0]
        z[0, 1], z[1, 0], z[2, 2] = -sy[k][0, 0], sy[k][0, 0], one
        y[0, 0] = y[2, 2] = cp[k][0, 0]
        y[0, 2], y[2, 0], y[1, 1] = sp[k][0, 0], -sp[k][0, 0], one
        about_z.append(field.reduce(z))
        about_y.append(field.reduce(y))
    return product(field, about_z, about_y)


def cross(a: Matrix) -> Matrix:
    """[a×] of a 3 × 1 column."""
    x, y, z = a[0, 0], a[1, 0], a[2, 0]
    return np.array([[0 * x, -z, y], [z, 0 * x, -x], [-y, x, 0 * x]], dtype=object)


def crosses(field: Field, a: Series) -> Series:
    return [field.reduce(cross(m)) for m in a]


def constant(field: Field, m: Matrix, order: int) -> Series:
    return [m, *(field.zeros(*m.shape) for _ in range(order))]


def add(field: Field, *terms: tuple[int, Series]) -> Series:
    order = min(len(series) for _, series in terms)
    return [field.reduce(sum(sign * series[k] for sign, series in terms)) for k in range(order)]


def assemble(
    field: Field, states: int, order: int, blocks: dict[tuple[int, int], tuple[int, Series]]
) -> Series:
    """A matrix series from signed blocks at (row, column)."""
    out = [field.zeros(states, states) for _ in range(order)]
    for (row, column), (sign, series) in blocks.items():
        for k in range(order):
            m = series[k]
            out[k][row : row + m.shape[0], column : column + m.shape[1]] = field.reduce(sign * m)
    return out


def transition(field: Field, f: Series, order: int) -> Series:
    """Φ from Φ' = F Φ: (k + 1) Φ_{k+1} = Σ F_j Φ_{k−j}."""
    phi = [field.eye(f[0].shape[0])]
    for k in range(order):
        total = sum((f[j] @ phi[k - j] for j in range(min(k + 1, len(f)))), field.zeros(*f[0].shape))
        phi.append(field.reduce(field.reduce(total) * field.inverse(field.number(k + 1))))
    return phi


def value_at(field: Field, series: Series, time: Fraction) -> Matrix:
    """A polynomial's value; the series must have ended, or the value would be a truncation."""
    assert all(not field.reduce(m).any() for m in series[-2:]), "the series does not end"
    total, power, t = field.zeros(*series[0].shape), field.number(1), field.number(time)
    for m in series:
        total = field.reduce(total + m * power)
        power = power * t % field.prime
    return total


def rank(field: Field, rows: Matrix) -> int:
    """Gauss' elimination without rounding."""
    m = field.reduce(rows.copy())
    done = 0
    for column in range(m.shape[1]):
        lead = next((k for k in range(done, len(m)) if m[k, column] != 0), None)
        if lead is None:
            continue
        m[[done, lead]] = m[[lead, done]]
        m[done] = field.reduce(m[done] * field.inverse(m[done, column]))
        for k in range(done + 1, len(m)):
            if m[k, column] != 0:
                m[k] = field.reduce(m[k] - m[k, column] * m[done])
        done += 1
    return done


def observability_rows(
    field: Field, f: Series, h: Series, order: int, before: Matrix | None = None
) -> Matrix:
    """Coefficients of H Φ up to `order`, times the Φ of what came before, stacked."""
    images = product(field, h[: order + 1], transition(field, f, order))
    stacked = np.vstack(images)
    return stacked if before is None else field.reduce(stacked @ before)


Motion = tuple[list[Fraction], list[Fraction], list[list[Fraction]]]
"""Coefficients of yaw, of pitch and of the body velocity (each a list of 3 per order)."""


def paper_system(
    field: Field, motion: Motion, gravity: Fraction, order: int, *, sign: int
) -> tuple[Series, Series, Series]:
    """F of Eq. 4 of Klein & Diamant 2015 (15 states), H of Eq. 10 with `sign`, and H of Eq. 13."""
    R, v = rotation_and_velocity(field, motion, order + 2)
    v_t = product(field, R, v)
    g = constant(field, field.matrix([[0], [0], [gravity]]), order + 2)
    f_t = add(field, (1, derivative(field, v_t)), (-1, g))
    n = order + 1
    eye = constant(field, field.eye(3), n)
    F = assemble(
        field, 15, n,
        {(0, 3): (1, eye), (3, 6): (-1, crosses(field, f_t)), (3, 9): (1, R), (6, 12): (1, R)},
    )  # fmt: skip
    to_body = transpose(R)
    turned = product(field, to_body, crosses(field, v_t))
    H_dvl, H_ps = [], []
    for k in range(n):
        m = field.zeros(3, 15)
        m[:, 3:6], m[:, 6:9] = to_body[k], field.reduce(sign * turned[k])
        H_dvl.append(m)
        p = field.zeros(1, 15)
        p[0, 2] = field.number(int(k == 0))
        H_ps.append(p)
    return F, H_dvl, H_ps


def rotation_and_velocity(field: Field, motion: Motion, order: int) -> tuple[Series, Series]:
    yaw, pitch, velocity = motion
    R = rotation(field, scalar(field, yaw, order), scalar(field, pitch, order))
    padded = [*velocity, *([[Fraction(0)] * 3] * order)][: order + 1]
    return R, [field.matrix([[x] for x in row]) for row in padded]


def filter_system(
    field: Field, motion: Motion, gravity: Fraction, earth_rate_t: Sequence[Fraction], order: int
) -> Series:
    """F of Eqs. 4 and 9 of Tal et al. 2017 (20 states)."""
    R, v = rotation_and_velocity(field, motion, order + 2)
    to_body = transpose(R)
    spin = product(field, to_body, derivative(field, R))  # [ω_tp×]
    n = order + 1
    earth = constant(field, field.matrix([[x] for x in earth_rate_t]), order + 2)
    earth_cross = crosses(field, earth)
    earth_body = crosses(field, product(field, to_body, earth))
    gravity_cross = crosses(field, constant(field, field.matrix([[0], [0], [gravity]]), order + 2))
    v_cross = crosses(field, v)
    eye = constant(field, field.eye(3), n)
    return assemble(
        field, 20, n,
        {
            (0, 3): (-1, crosses(field, product(field, R, v))),
            (0, 6): (1, R),
            (3, 3): (-1, earth_cross),
            (3, 12): (-1, R),
            (6, 3): (
                1,
                add(
                    field,
                    (1, product(field, to_body, gravity_cross)),
                    (1, product(field, v_cross, product(field, to_body, earth_cross))),
                ),
            ),
            # ω_ip + Rᵀω_ie = ω_tp + 2 Rᵀω_ie
            (6, 6): (-1, add(field, (1, spin), (2, earth_body))),
            (6, 9): (-1, eye),
            (6, 12): (-1, v_cross),
        },
    )  # fmt: skip
