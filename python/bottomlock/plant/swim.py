"""Integrate a mission: one vehicle, controlled on the truth, from its trim to the end."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bottomlock.errors import ScenarioError
from bottomlock.plant import model
from bottomlock.plant.hovering_vehicle import AnyVehicle
from bottomlock.plant.integrate import attitude_by_rates, hermite, runge_kutta_step
from bottomlock.plant.maths import SCALAR, FloatArray, IntArray
from bottomlock.plant.mission import Mission
from bottomlock.plant.path import guide_rows, passed
from bottomlock.plant.trim import start_state
from bottomlock.plant.vehicle import Vehicle

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
            (
                f"speed {mission.speed_mps:g} m/s is outside the vehicle's {limits.min_speed:g} to "
                f"{limits.max_speed:g} m/s"
            ),
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
