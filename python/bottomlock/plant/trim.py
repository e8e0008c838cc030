"""Steady straight flight: the trim, its stability, and the state a mission starts in."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import root

from bottomlock.errors import ScenarioError
from bottomlock.plant import model
from bottomlock.plant.autopilot import Mixer
from bottomlock.plant.equations import acceleration
from bottomlock.plant.maths import SCALAR, FloatArray
from bottomlock.plant.mission import Mission, straight
from bottomlock.plant.path import guide_rows
from bottomlock.plant.vehicle import Vehicle

_TOLERANCE = 1e-9


@dataclass(frozen=True)
class Trim:
    """Level straight flight at one speed: attitude, velocity, fins and shaft that hold it."""

    speed_mps: float
    pitch_rad: float
    velocity_p_mps: tuple[float, float, float]
    modes_rad: tuple[float, float, float]
    fins_rad: tuple[float, float, float, float]
    shaft_rps: float


def trim(vehicle: Vehicle, speed_mps: float, gravity_mps2: float) -> Trim:
    """Find level straight flight at zero roll.

    Raises:
        ScenarioError: where no equilibrium exists, or it needs more than the limits of fins or shaft.
    """
    nu_dot = acceleration(vehicle, gravity_mps2, SCALAR)
    mixer = Mixer.of(vehicle)

    def unpack(x: FloatArray) -> Trim:
        sway, heave, pitch, roll_fin, pitch_fin, yaw_fin, shaft = (float(value) for value in x)
        surge = math.sqrt(max(speed_mps**2 - sway**2 - heave**2, 0.0))
        fins = mixer.fins_rad(np.array([roll_fin, pitch_fin, yaw_fin]))
        fin1, fin2, fin3, fin4 = (float(angle) for angle in fins)
        return Trim(
            speed_mps,
            pitch,
            (surge, sway, heave),
            (roll_fin, pitch_fin, yaw_fin),
            (fin1, fin2, fin3, fin4),
            shaft,
        )

    def residual(x: FloatArray) -> FloatArray:
        guess = unpack(x)
        u, v, w = guess.velocity_p_mps
        attitude = (math.cos(0.5 * guess.pitch_rad), 0.0, math.sin(0.5 * guess.pitch_rad), 0.0)
        zero = (0.0, 0.0, 0.0)
        rates = nu_dot(attitude, (u, v, w, 0.0, 0.0, 0.0), guess.fins_rad, guess.shaft_rps, zero, zero)
        sink = -math.sin(guess.pitch_rad) * u + math.cos(guess.pitch_rad) * w
        return np.array([*rates, sink])

    shaft_guess = vehicle.autopilot.speed.feed_forward * speed_mps
    solution = root(residual, np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, shaft_guess]), method="hybr", tol=1e-13)
    found = unpack(np.asarray(solution.x))
    where = f"vehicle {vehicle.name}: at {speed_mps:g} m/s"
    if float(np.abs(residual(np.asarray(solution.x))).max()) > _TOLERANCE:
        raise ScenarioError(f"{where} there is no trim: forces do not balance in level flight")
    steepest = max(abs(angle) for angle in found.fins_rad)
    if steepest > vehicle.fin_actuator.max_deflection:
        raise ScenarioError(
            f"{where} the trim needs fins at {math.degrees(steepest):.1f} deg, beyond their limit"
        )
    if not 0.0 < found.shaft_rps <= vehicle.propeller.max_speed:
        raise ScenarioError(
            f"{where} the trim needs the shaft at {60.0 * found.shaft_rps:.0f} rpm, beyond its limit"
        )
    return found


def start_state(vehicle: Vehicle, mission: Mission, gravity_mps2: float) -> list[float]:
    """Initial state (28,): in trim on the first segment, at the crab angle that puts the course along it."""
    first = mission.segments[0]
    depth, _ = mission.depth.at(np.array([0.0]))
    row = mission.timetable(np.array([0.0]))[0]
    current = np.array([row[0] + row[4] * depth[0], row[1] + row[5] * depth[0]])
    ground = mission.speed_mps * np.array([math.cos(first.heading_rad), math.sin(first.heading_rad)])
    through = ground - current
    steady = trim(vehicle, float(np.hypot(*through)), gravity_mps2)
    yaw = math.atan2(float(through[1]), float(through[0]))
    # sideslip of the trim itself (propeller torque) sets the hull slightly off its velocity through the water
    yaw -= math.atan2(steady.velocity_p_mps[1], steady.velocity_p_mps[0])
    half_yaw, half_pitch = 0.5 * yaw, 0.5 * steady.pitch_rad
    attitude = (
        math.cos(half_yaw) * math.cos(half_pitch),
        -math.sin(half_yaw) * math.sin(half_pitch),
        math.cos(half_yaw) * math.sin(half_pitch),
        math.sin(half_yaw) * math.cos(half_pitch),
    )
    to_heading = np.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]])
    ahead, aside = (float(value) for value in to_heading @ ground)
    current_level = to_heading @ current
    u, v, w = steady.velocity_p_mps
    cosine, sine = math.cos(steady.pitch_rad), math.sin(steady.pitch_rad)
    velocity = (
        u + cosine * float(current_level[0]),
        v + float(current_level[1]),
        w + sine * float(current_level[0]),
    )
    limits, pilot, guide = vehicle.limits, vehicle.autopilot, vehicle.guidance
    gauge = min(max(ahead, limits.min_speed), limits.max_speed)
    scale = (limits.cruise_speed / gauge) ** 2
    roll_i, pitch_i, yaw_i = (
        mode / (scale * gains.integral)
        for mode, gains in zip(steady.modes_rad, (pilot.roll, pilot.pitch, pilot.yaw), strict=True)
    )
    speed_i = (steady.shaft_rps - pilot.speed.feed_forward * mission.speed_mps) / pilot.speed.integral
    depth_i = -mission.speed_mps * sine / guide.depth_integral
    return [
        first.north_m, first.east_m, float(depth[0]), *attitude, *velocity, 0.0, 0.0, 0.0,
        *steady.fins_rad, steady.shaft_rps,
        roll_i, 0.0, pitch_i, 0.0, yaw_i, 0.0, speed_i, 0.0, math.atan2(aside, ahead), depth_i,
    ]  # fmt: skip


def eigenvalues(vehicle: Vehicle, speed_mps: float, gravity_mps2: float, *, closed_loop: bool) -> FloatArray:
    """Eigenvalues (1/s) of motion about level flight, by central differences of the equations.

    Closed loop: every state but the distance along the path and the quaternion's length. Open loop: fins and shaft
    fixed, nu, roll and pitch only (heading, position and depth are pure integrators).
    """
    mission = straight(speed_mps=speed_mps)
    start = np.array(start_state(vehicle, mission, gravity_mps2))
    rates = model.derivative(
        vehicle, SCALAR, speed_mps=speed_mps, law="line_of_sight", gravity_mps2=gravity_mps2
    )
    row = [float(value) for value in mission.timetable(np.array([0.0]))[0]]
    segment, error = guide_rows(mission.segments)[0], (0.0,) * 9
    q0, _, q2, _ = start[model.ATTITUDE]
    # columns map a small platform rotation to the change of the quaternion's components, about a pitched attitude
    spin = 0.5 * np.array([[0.0, -q2, 0.0], [q0, 0.0, q2], [0.0, q0, 0.0], [-q2, 0.0, q0]])
    others = [1, 2, *range(7, model.SIZE)] if closed_loop else list(range(7, 13))
    columns = np.zeros((model.SIZE, 3 + len(others)))
    columns[model.ATTITUDE, :3] = spin
    columns[others, range(3, 3 + len(others))] = 1.0
    if not closed_loop:
        columns = np.delete(columns, 2, axis=1)
    back = np.linalg.pinv(columns)
    jacobian = np.empty((columns.shape[1],) * 2)
    step = 1e-6
    for index in range(columns.shape[1]):
        ahead = np.array(rates((start + step * columns[:, index]).tolist(), row, segment, error))
        behind = np.array(rates((start - step * columns[:, index]).tolist(), row, segment, error))
        jacobian[:, index] = back @ (ahead - behind) / (2.0 * step)
    values = np.linalg.eigvals(jacobian)
    return np.asarray(values[np.argsort(-values.real)])


def check_stability(vehicle: Vehicle, gravity_mps2: float) -> None:
    """Check that a vehicle is stable under its autopilot at its slowest, cruise and fastest speed.

    Raises:
        ScenarioError: with the speed and the growth rate of an unstable mode.
    """
    limits = vehicle.limits
    for speed in sorted({limits.min_speed, limits.cruise_speed, limits.max_speed}):
        fastest_growth = float(eigenvalues(vehicle, speed, gravity_mps2, closed_loop=True)[0].real)
        if fastest_growth >= 0.0:
            raise ScenarioError(
                f"vehicle {vehicle.name}: the trim at {speed:g} m/s is unstable under its autopilot: "
                f"a disturbance grows with {fastest_growth:.3f} 1/s"
            )
