"""Integrate a mission: one vehicle, controlled on the truth, from its trim to the end."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from bottomlock.errors import ScenarioError
from bottomlock.plant import model
from bottomlock.plant.guidance import Segment
from bottomlock.plant.hovering_vehicle import AnyVehicle
from bottomlock.plant.maths import SCALAR, FloatArray, IntArray, Maths, Number
from bottomlock.plant.mission import Mission
from bottomlock.plant.model import Derivative, Error, Row
from bottomlock.plant.path import guide_rows, passed
from bottomlock.plant.trim import start_state
from bottomlock.plant.vehicle import Vehicle


def runge_kutta_step(
    rates: Derivative[Number], maths: Maths[Number], step_s: float
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


TICK_S = 0.2
"""Interval at which guidance selects the path segment; it does not depend on the integration step."""

NO_ERROR = (0.0,) * 9


@dataclass(frozen=True)
class StateHistory:
    """A vehicle's whole state at the sample times.

    Attributes:
        time_ns: (N,).
        state: (N, size) in the layout of `model`.
        acceleration: (N, 6) nu', m/s² and rad/s².
        velocity_through_water_p_mps: (N, 3) velocity relative to the water, platform frame.
        segment: (N,) index of the path segment in use.
    """

    time_ns: IntArray
    state: FloatArray
    acceleration: FloatArray
    velocity_through_water_p_mps: FloatArray
    segment: IntArray


def next_segment(rows: Sequence[Sequence[float]], index: int, north_m: float, east_m: float) -> int:
    """Index of the segment to follow: advances past every joint that lies behind the vehicle."""
    while index < len(rows) - 1 and passed(rows[index], north_m, east_m):
        index += 1
    return index


def sample_times_ns(duration_s: float, imu_rate_hz: float) -> IntArray:
    """Sample times from 0 to the duration, both included: round(k 1e9 / rate), int64 ns."""
    count = round(duration_s * imu_rate_hz) + 1
    times: IntArray = np.rint(np.arange(count) * (1e9 / imu_rate_hz)).astype(np.int64)
    return times


def swim(
    vehicle: AnyVehicle,
    mission: Mission,
    *,
    gravity_mps2: float,
    imu_rate_hz: float = 150.0,
    samples_per_step: int = 5,
    steps_per_sample: int = 1,
) -> StateHistory:
    """Integrate the equations of motion over a mission and sample them at the IMU's rate.

    One RK4 step spans `samples_per_step` samples (1/30 s at 150 Hz); for finer steps a sample spans
    `steps_per_sample` steps. Between steps the states are interpolated by cubic Hermite polynomials, and the
    accelerations follow from the equations of motion at the interpolated states.

    Raises:
        ScenarioError: as `check_mission`.
    """
    check_mission(vehicle, mission)
    step_s = samples_per_step / (steps_per_sample * imu_rate_hz)
    count = round(mission.duration_s * imu_rate_hz)
    steps = -(-count * steps_per_sample // samples_per_step)
    ticks = max(1, round(TICK_S / step_s))
    table = mission.timetable(0.5 * step_s * np.arange(2 * steps + 1, dtype=np.float64))
    rows = table.tolist()
    rates = model.derivative(vehicle, mission, SCALAR, gravity_mps2)
    advance = runge_kutta_step(rates, SCALAR, step_s)
    renew_attitude = attitude_by_rates(SCALAR, step_s)
    state = start_state(vehicle, mission, gravity_mps2)
    guides = guide_rows(mission.segments)
    index = next_segment(guides, 0, state[0], state[1])
    segment = guides[index]
    first = rates(state, rows[0], segment, NO_ERROR)
    states, derivatives, indices = [state], [first], [index]
    for number in range(steps):
        middle, end = rows[2 * number + 1], rows[2 * number + 2]
        before, state = state, advance(state, first, middle, end, segment, NO_ERROR)
        last = rates(state, end, segment, NO_ERROR)
        renew_attitude(before, first, state, last)
        first = last
        if (number + 1) % ticks == 0:
            index = next_segment(guides, index, state[0], state[1])
            segment = guides[index]
        states.append(state)
        derivatives.append(last)
        indices.append(index)
    every = _dense(np.array(states), np.array(derivatives), step_s, samples_per_step, steps_per_sample)
    chosen = np.repeat(np.array(indices), samples_per_step)[::steps_per_sample]
    return _history(vehicle, mission, every[: count + 1], chosen[: count + 1], imu_rate_hz, gravity_mps2)


def _dense(states: FloatArray, derivatives: FloatArray, step_s: float, parts: int, stride: int) -> FloatArray:
    between = hermite(states[:-1], derivatives[:-1], states[1:], derivatives[1:], step_s, parts)
    every = np.concatenate([between.reshape(-1, states.shape[1]), states[-1:]])[::stride]
    every[:, model.ATTITUDE] /= np.linalg.norm(every[:, model.ATTITUDE], axis=1, keepdims=True)
    return every


def _history(
    vehicle: AnyVehicle,
    mission: Mission,
    states: FloatArray,
    indices: IntArray,
    imu_rate_hz: float,
    gravity_mps2: float,
) -> StateHistory:
    rows = mission.timetable(np.arange(len(states)) / imu_rate_hz)
    return StateHistory(
        time_ns=sample_times_ns(mission.duration_s, imu_rate_hz)[: len(states)],
        state=states,
        acceleration=model.accelerations(vehicle, gravity_mps2)(states, rows),
        velocity_through_water_p_mps=model.velocity_through_water_p(states, rows),
        segment=indices,
    )


def check_mission(vehicle: AnyVehicle, mission: Mission) -> None:
    """Check that a mission stays within the vehicle's limits of speed and depth, and asks of it what it has.

    Raises:
        ScenarioError: naming the mission, the value outside the limits, and the limits.
    """
    finned = isinstance(vehicle, Vehicle)
    if finned and mission.heading_rad is not None:
        raise ScenarioError(
            f"is given, but vehicle {vehicle.name} has fins and points along its path",
            place=f"mission {mission.name}",
            key="heading_deg",
            expected="a vehicle with thrusters",
        )
    if not finned and mission.stuck is not None:
        raise ScenarioError(
            f"is given, but vehicle {vehicle.name} has no fins",
            place=f"mission {mission.name}",
            key="stuck_fin",
        )
    limits = vehicle.limits
    if not limits.min_speed <= mission.speed_mps <= limits.max_speed:
        raise ScenarioError(
            f"speed {mission.speed_mps:g} m/s is outside the vehicle's {limits.min_speed:g} to "
            f"{limits.max_speed:g} m/s",
            place=f"mission {mission.name}",
        )
    depth, _ = mission.depth.at(np.linspace(0.0, mission.duration_s, 1001))
    for value in (float(depth.min()), float(depth.max())):
        if not 0.0 <= value <= limits.max_depth:
            raise ScenarioError(
                f"depth {value:.1f} m is outside 0 to {limits.max_depth:g} m", place=f"mission {mission.name}"
            )
    if mission.duration_s <= 0.0:
        raise ScenarioError(
            f"duration must be positive, got {mission.duration_s:g} s", place=f"mission {mission.name}"
        )
