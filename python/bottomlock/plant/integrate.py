"""Fourth-order Runge-Kutta steps, and the states between them by cubic Hermite interpolation."""

from collections.abc import Callable

import numpy as np

from bottomlock.plant.guidance import Segment
from bottomlock.plant.maths import FloatArray, Maths, Number
from bottomlock.plant.model import Derivative, Error, Row


def runge_kutta_step(
    rates: Derivative[Number],
    maths: Maths[Number],
    step_s: float,
) -> Callable[
    [list[Number], list[Number], Row[Number], Row[Number], Segment[Number], Error[Number]], list[Number]
]:
    """Build one RK4 step: (state, derivative, rows at half and full step, segment, error) -> next state.

    The quaternion is normalised; RK4 leaves it within step⁵ of unit length.
    """
    half, sixth = 0.5 * step_s, step_s / 6.0
    sqrt = maths.sqrt

    def step(
        state: list[Number],
        first: list[Number],
        middle: Row[Number],
        end: Row[Number],
        segment: Segment[Number],
        error: Error[Number],
    ) -> list[Number]:
        second = rates([x + half * k for x, k in zip(state, first, strict=True)], middle, segment, error)
        third = rates([x + half * k for x, k in zip(state, second, strict=True)], middle, segment, error)
        fourth = rates([x + step_s * k for x, k in zip(state, third, strict=True)], end, segment, error)
        after = [
            x + sixth * (a + 2.0 * (b + c) + d)
            for x, a, b, c, d in zip(state, first, second, third, fourth, strict=True)
        ]
        q0, q1, q2, q3 = after[3:7]
        length = sqrt(q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
        after[3:7] = [q0 / length, q1 / length, q2 / length, q3 / length]
        return after

    return step


def attitude_by_rates(
    maths: Maths[Number], step_s: float
) -> Callable[[list[Number], list[Number], list[Number], list[Number]], None]:
    """Build the attitude update of a step from its angular rates, in place of the Runge-Kutta quaternion.

    Between steps the rates are interpolated by cubic Hermite polynomials, and the attitude must be their integral, or
    an ideal gyro would not return it. The rotation vector over a step is h (w0 + w1) / 2 + h² (w0' - w1') / 12, the
    integral of the cubic, plus the coning term h² w0 x w1 / 12. The function takes state and derivative before and
    after the step, and changes the state after.

    Source: Iserles and Norsett 1999, fourth-order Magnus expansion.
    """
    half, twelfth = 0.5 * step_s, step_s * step_s / 12.0
    sqrt, cos = maths.sqrt, maths.cos
    sin = maths.sin

    def renew(before: list[Number], first: list[Number], after: list[Number], last: list[Number]) -> None:
        q0, q1, q2, q3 = before[3:7]
        p0, r0, y0 = before[10:13]
        p1, r1, y1 = after[10:13]
        a = half * (p0 + p1) + twelfth * (first[10] - last[10] + r0 * y1 - y0 * r1)
        b = half * (r0 + r1) + twelfth * (first[11] - last[11] + y0 * p1 - p0 * y1)
        c = half * (y0 + y1) + twelfth * (first[12] - last[12] + p0 * r1 - r0 * p1)
        angle = sqrt(a * a + b * b + c * c + 1e-300)
        scale = sin(0.5 * angle) / angle
        e0, e1, e2, e3 = cos(0.5 * angle), scale * a, scale * b, scale * c
        after[3] = q0 * e0 - q1 * e1 - q2 * e2 - q3 * e3
        after[4] = q0 * e1 + q1 * e0 + q2 * e3 - q3 * e2
        after[5] = q0 * e2 - q1 * e3 + q2 * e0 + q3 * e1
        after[6] = q0 * e3 + q1 * e2 - q2 * e1 + q3 * e0

    return renew


def hermite(
    before: FloatArray,
    rate_before: FloatArray,
    after: FloatArray,
    rate_after: FloatArray,
    step_s: float,
    parts: int,
) -> FloatArray:
    """Values at equal fractions of each step by cubic Hermite interpolation: (steps, ..., m) -> (steps, parts, ..., m).

    The step's start is included; its end is the next step's start. The error is step⁴ / 384 times the fourth
    derivative, of the order of the integration itself.
    """
    fraction = np.arange(parts) / parts
    x = fraction.reshape((1, parts) + (1,) * (before.ndim - 1))
    rise = x * x * (3.0 - 2.0 * x)
    leave = step_s * x * (1.0 - x) ** 2
    arrive = -step_s * x * x * (1.0 - x)
    start, end = before[:, None], after[:, None]
    return np.asarray(
        start + rise * (end - start) + leave * rate_before[:, None] + arrive * rate_after[:, None]
    )
