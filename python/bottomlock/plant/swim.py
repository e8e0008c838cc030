"""Integrate a mission: one vehicle, controlled on the truth, from its trim to the end."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeAlias

import numpy as np

from bottomlock.errors import ScenarioError
from bottomlock.plant import model
from bottomlock.plant.control import Segment
from bottomlock.plant.hovering_vehicle import AnyVehicle
from bottomlock.plant.maths import SCALAR, FloatArray, IntArray, Maths, Number
from bottomlock.plant.mission import Mission
from bottomlock.plant.model import Derivative, Error, Row
from bottomlock.plant.path import guide_rows, next_segment
from bottomlock.plant.trim import check_stability, start_state
from bottomlock.plant.vehicle import Vehicle
from bottomlock.truth import sample_times_ns

Step: TypeAlias = Callable[
    [list[Number], list[Number], Row[Number], Row[Number], Segment[Number], Error[Number]],
    tuple[list[Number], list[Number]],
]
"""A step: (state, its derivative, rows at half and full step, segment, error) -> the next state and its derivative."""


def stepper(rates: Derivative[Number], maths: Maths[Number], step_s: float) -> Step[Number]:
    """Build one Runge-Kutta step of fourth order, whose attitude is renewed from the angular rates.

    Between steps the rates are interpolated by cubic Hermite polynomials, and the attitude must be their integral, or
    an ideal gyro would not return it. The rotation vector over a step is h (w0 + w1) / 2 + h² (w0' - w1') / 12, the
    integral of the cubic, plus the coning term h² w0 x w1 / 12. The quaternion by Runge-Kutta, within step⁵ of unit
    length and normalised, serves the derivative at the end.

    Source: Iserles and Norsett 1999, fourth-order Magnus expansion.
    """
    half, sixth, twelfth = 0.5 * step_s, step_s / 6.0, step_s * step_s / 12.0
    sqrt, cos, sin = maths.sqrt, maths.cos, maths.sin

    def step(
        state: list[Number],
        first: list[Number],
        middle: Row[Number],
        end: Row[Number],
        segment: Segment[Number],
        error: Error[Number],
    ) -> tuple[list[Number], list[Number]]:
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
        last = rates(after, end, segment, error)
        (q0, q1, q2, q3), (p0, r0, y0), (p1, r1, y1) = state[3:7], state[10:13], after[10:13]
        a = half * (p0 + p1) + twelfth * (first[10] - last[10] + r0 * y1 - y0 * r1)
        b = half * (r0 + r1) + twelfth * (first[11] - last[11] + y0 * p1 - p0 * y1)
        c = half * (y0 + y1) + twelfth * (first[12] - last[12] + p0 * r1 - r0 * p1)
        angle = sqrt(a * a + b * b + c * c + 1e-300)
        scale = sin(0.5 * angle) / angle
        e0, e1, e2, e3 = cos(0.5 * angle), scale * a, scale * b, scale * c
        after[3:7] = [
            q0 * e0 - q1 * e1 - q2 * e2 - q3 * e3, q0 * e1 + q1 * e0 + q2 * e3 - q3 * e2,
            q0 * e2 - q1 * e3 + q2 * e0 + q3 * e1, q0 * e3 + q1 * e2 - q2 * e1 + q3 * e0,
        ]  # fmt: skip
        return after, last

    return step


def sampled(states: FloatArray, derivatives: FloatArray, step_s: float, parts: int) -> FloatArray:
    """States at equal fractions of each step by cubic Hermite interpolation, from (steps + 1, ..., size).

    Returns (steps parts + 1, ..., size), both ends included, quaternions normalised. The error is step⁴ / 384 times the
    fourth derivative, of the order of the integration itself.
    """
    x = (np.arange(parts) / parts).reshape((1, parts) + (1,) * (states.ndim - 1))
    rise = x * x * (3.0 - 2.0 * x)
    leave = step_s * x * (1.0 - x) ** 2
    arrive = -step_s * x * x * (1.0 - x)
    start, end = states[:-1, None], states[1:, None]
    between = start + rise * (end - start) + leave * derivatives[:-1, None] + arrive * derivatives[1:, None]
    every = np.concatenate([between.reshape(-1, *states.shape[1:]), states[-1:]])
    every[..., model.ATTITUDE] /= np.linalg.norm(every[..., model.ATTITUDE], axis=-1, keepdims=True)
    return every


TICK_S = 0.2
"""Interval at which guidance selects the path segment; it does not depend on the integration step."""

NO_ERROR = (0.0,) * 9


SAMPLES_PER_STEP = 5
FASTEST_IN_A_STEP = 1.6
"""Largest product of a step and the fastest mode. RK4 is stable to 2.8; the packaged vehicles have 1.55 at 50 Hz."""


def samples_and_steps(vehicle: AnyVehicle, gravity_mps2: float, imu_rate_hz: float) -> tuple[int, int]:
    """IMU samples that a step spans, five at most, and steps that a sample spans where one step would be too long.

    Raises:
        ScenarioError: as `check_stability`.
    """
    longest = FASTEST_IN_A_STEP / check_stability(vehicle, gravity_mps2) * imu_rate_hz
    return max(1, min(SAMPLES_PER_STEP, math.floor(longest))), math.ceil(1.0 / longest)


def steps_per_tick(step_s: float) -> int:
    """Steps between two ticks."""
    return max(1, round(TICK_S / step_s))


class Integration(Generic[Number]):
    """The equations of motion over a mission, tick by tick: of one vehicle (floats), or of many (arrays).

    Attributes:
        state: the present state, in the layout of `model`.
        slope: its derivative; empty where it must be computed, as after a jump of the navigation error.
        step: how many steps are done, of `steps`.
    """

    def __init__(
        self,
        vehicle: AnyVehicle,
        mission: Mission,
        maths: Maths[Number],
        state: list[Number],
        *,
        gravity_mps2: float,
        step_s: float,
        steps: int,
    ) -> None:
        self.state: list[Number] = state
        self.slope: list[Number] = []
        self.step, self.steps, self._per_tick = 0, steps, steps_per_tick(step_s)
        times = 0.5 * step_s * np.arange(2 * steps + 1, dtype=np.float64)
        self._rows: list[list[Any]] = mission.timetable(times).tolist()
        self._rates: Derivative[Number] = model.derivative(vehicle, mission, maths, gravity_mps2)
        self._advance: Step[Number] = stepper(self._rates, maths, step_s)

    def tick(
        self, segment: Segment[Number], error: Error[Number]
    ) -> tuple[list[list[Number]], list[list[Number]]]:
        """Integrate to the next tick; states and derivatives at the joints of the steps, from the present one on."""
        slope = self.slope or self._rates(self.state, self._rows[2 * self.step], segment, error)
        states, slopes = [self.state], [slope]
        for step in range(self.step, min(self.step + self._per_tick, self.steps)):
            middle, end = self._rows[2 * step + 1 : 2 * step + 3]
            state, slope = self._advance(states[-1], slopes[-1], middle, end, segment, error)
            states.append(state)
            slopes.append(slope)
        self.state, self.slope = states[-1], slopes[-1]
        self.step += len(states) - 1
        return states, slopes


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


def swim(
    vehicle: AnyVehicle,
    mission: Mission,
    *,
    gravity_mps2: float,
    imu_rate_hz: float = 150.0,
    finer: int = 1,
) -> StateHistory:
    """Integrate the equations of motion over a mission and sample them at the IMU's rate.

    RK4 steps are those of `samples_and_steps`, each divided into `finer`. Between steps the states are interpolated by
    cubic Hermite polynomials, and the accelerations follow from the equations of motion at the interpolated states.

    Raises:
        ScenarioError: as `check_stability` and `check_mission`.
    """
    check_mission(vehicle, mission)
    samples_per_step, steps_per_sample = samples_and_steps(vehicle, gravity_mps2, imu_rate_hz)
    steps_per_sample *= finer
    step_s = samples_per_step / (steps_per_sample * imu_rate_hz)
    count = round(mission.duration_s * imu_rate_hz)
    steps = -(-count * steps_per_sample // samples_per_step)
    start = start_state(vehicle, mission, gravity_mps2)
    run = Integration(vehicle, mission, SCALAR, start, gravity_mps2=gravity_mps2, step_s=step_s, steps=steps)
    guides, index = guide_rows(mission.segments), 0
    states: list[list[float]] = []
    slopes: list[list[float]] = []
    indices: list[int] = []
    while run.step < steps:
        index = next_segment(guides, index, run.state[0], run.state[1])
        joints, rates = run.tick(guides[index], NO_ERROR)
        states += joints[:-1]
        slopes += rates[:-1]
        indices += [index] * (len(joints) - 1)
    states.append(run.state)
    slopes.append(run.slope)
    indices.append(index)
    every = sampled(np.array(states), np.array(slopes), step_s, samples_per_step)
    samples = every[::steps_per_sample][: count + 1]
    inputs = mission.timetable(np.arange(count + 1) / imu_rate_hz)
    acceleration, through_water = model.motion_through_water(vehicle, gravity_mps2)(samples, inputs)
    return StateHistory(
        time_ns=sample_times_ns(count / imu_rate_hz, imu_rate_hz),
        state=samples,
        acceleration=acceleration,
        velocity_through_water_p_mps=through_water,
        segment=np.repeat(np.array(indices), samples_per_step)[::steps_per_sample][: count + 1],
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
