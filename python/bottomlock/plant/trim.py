"""Steady straight flight: the trim, its stability, and the state that a mission starts in."""

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import numpy as np
from scipy.optimize import root

from bottomlock.errors import ScenarioError
from bottomlock.plant import model
from bottomlock.plant.control import fin_mixing
from bottomlock.plant.equations import acceleration, added_mass_matrix, rigid_body_mass_matrix
from bottomlock.plant.hovering_vehicle import AnyVehicle, HoveringVehicle
from bottomlock.plant.maths import ARRAY, SCALAR, FloatArray
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
    mixing = fin_mixing(vehicle)

    def unpack(x: FloatArray) -> Trim:
        sway, heave, pitch, roll_fin, pitch_fin, yaw_fin, shaft = (float(value) for value in x)
        surge = math.sqrt(max(speed_mps**2 - sway**2 - heave**2, 0.0))
        fin1, fin2, fin3, fin4 = (float(angle) for angle in mixing @ (roll_fin, pitch_fin, yaw_fin))
        modes, fins = (roll_fin, pitch_fin, yaw_fin), (fin1, fin2, fin3, fin4)
        return Trim(speed_mps, pitch, (surge, sway, heave), modes, fins, shaft)

    def residual(x: FloatArray) -> FloatArray:
        guess = unpack(x)
        u, v, w = guess.velocity_p_mps
        attitude = (math.cos(0.5 * guess.pitch_rad), 0.0, math.sin(0.5 * guess.pitch_rad), 0.0)
        zero = (0.0, 0.0, 0.0)
        actuators = (*guess.fins_rad, guess.shaft_rps)
        rates = nu_dot(attitude, (u, v, w, 0.0, 0.0, 0.0), actuators, zero, zero)
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


def start_state(vehicle: AnyVehicle, mission: Mission, gravity_mps2: float) -> list[float]:
    """Initial state in the layout of `model`: steady on the first segment, with the course along it.

    A stuck fin is where it is stuck.
    """
    first = mission.segments[0]
    depth, _ = mission.depth.at(np.array([0.0]))
    row = mission.timetable(np.array([0.0]))[0]
    current = np.array([row[0] + row[4] * depth[0], row[1] + row[5] * depth[0]])
    ground = mission.speed_mps * np.array([math.cos(first.heading_rad), math.sin(first.heading_rad)])
    if not isinstance(vehicle, Vehicle):
        heading = first.heading_rad if mission.heading_rad is None else mission.heading_rad
        own = hovering_start(vehicle, heading, ground, current, gravity_mps2)
        return [first.north_m, first.east_m, float(depth[0]), *own]
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
    fins = list(steady.fins_rad)
    if mission.stuck is not None:
        fins[mission.stuck.fin - 1] = mission.stuck.angle_rad
    return [
        first.north_m, first.east_m, float(depth[0]), *attitude, *velocity, 0.0, 0.0, 0.0,
        *fins, steady.shaft_rps,
        roll_i, 0.0, pitch_i, 0.0, yaw_i, 0.0, speed_i, 0.0, math.atan2(aside, ahead), depth_i,
    ]  # fmt: skip


def hovering_start(
    vehicle: HoveringVehicle, heading_rad: float, ground: FloatArray, current: FloatArray, gravity_mps2: float
) -> list[float]:
    """Initial state after the position of a vehicle with thrusters: level, on its heading, forces in balance.

    Velocity over ground and of the current in the tangent frame, (2,), m/s.

    Raises:
        ScenarioError: where the balance needs more than the controllers' or the thrusters' limits.
    """
    cosine, sine = math.cos(heading_rad), math.sin(heading_rad)
    attitude = (math.cos(0.5 * heading_rad), 0.0, 0.0, math.sin(0.5 * heading_rad))
    ahead, aside = cosine * ground[0] + sine * ground[1], cosine * ground[1] - sine * ground[0]
    nu = (float(ahead), float(aside), 0.0, 0.0, 0.0, 0.0)
    wrenches = vehicle.thrusters.wrenches()
    unpushed = acceleration(vehicle, gravity_mps2, SCALAR)(
        attitude, nu, [0.0] * wrenches.shape[1], (float(current[0]), float(current[1]), 0.0), (0.0, 0.0, 0.0)
    )
    needed = -(rigid_body_mass_matrix(vehicle) + added_mass_matrix(vehicle)) @ np.array(unpushed)
    thrusts = np.linalg.pinv(wrenches) @ needed
    axes = vehicle.autopilot.axes()
    beyond = any(abs(force) > gains.limit for force, gains in zip(needed, axes, strict=True))
    if beyond or np.abs(thrusts).max() > vehicle.thrusters.max_thrust:
        raise ScenarioError(
            f"{math.hypot(*ground - current):.2f} m/s through the water on a heading of "
            f"{math.degrees(heading_rad):.0f} deg needs {math.hypot(needed[0], needed[1]):.0f} "
            f"N level and {abs(needed[2]):.0f} N upright, more than controllers or thrusters "
            "give",
            place=f"vehicle {vehicle.name}",
            expected="a slower mission or a weaker current",
        )
    integrals = [float(force) / gains.integral for force, gains in zip(needed, axes, strict=True)]
    return [*attitude, *nu, *thrusts.tolist(), *integrals]


def eigenvalues(
    vehicle: AnyVehicle,
    speed_mps: float,
    gravity_mps2: float,
    *,
    closed_loop: bool,
    heading_rad: float | None = None,
) -> FloatArray:
    """Eigenvalues (1/s) of motion about level flight, by central differences of the equations.

    Closed loop: every state but the distance along the path and the quaternion's length. Open loop: actuators fixed,
    nu, roll and pitch only (heading, position and depth are pure integrators). A vehicle with thrusters may hold a
    heading (rad) across its path.
    """
    mission = replace(straight(speed_mps=speed_mps), heading_rad=heading_rad)
    start = np.array(start_state(vehicle, mission, gravity_mps2))
    rates = model.derivative(vehicle, mission, ARRAY, gravity_mps2)
    row, segment = mission.timetable(np.zeros(1)).T, np.array(guide_rows(mission.segments)[:1]).T
    error = np.zeros((9, 1))
    q0, q1, q2, q3 = start[model.ATTITUDE]
    # columns map a small platform rotation to the change of the quaternion's components
    spin = 0.5 * np.array([[-q1, -q2, -q3], [q0, -q3, q2], [q3, q0, -q1], [-q2, q1, q0]])
    others = [1, 2, *range(7, len(start))] if closed_loop else list(range(7, 13))
    columns = np.zeros((len(start), 3 + len(others)))
    columns[model.ATTITUDE, :3] = spin
    columns[others, range(3, 3 + len(others))] = 1.0
    if not closed_loop:
        columns = np.delete(columns, 2, axis=1)
    back = np.linalg.pinv(columns)
    step = 1e-6
    ahead, behind = (
        np.array(rates(list(start[:, None] + change), list(row), list(segment), tuple(error)))  # type: ignore[arg-type]
        for change in (step * columns, -step * columns)
    )
    values = np.linalg.eigvals(back @ (ahead - behind) / (2.0 * step))
    return np.asarray(values[np.argsort(-values.real)])


@lru_cache(maxsize=8)
def check_stability(vehicle: AnyVehicle, gravity_mps2: float) -> float:
    """Check that a vehicle is stable under its autopilot at its slowest, cruise and fastest speed.

    One with thrusters ahead, and with its heading across the path. Returns the size of the fastest mode, 1/s.

    Raises:
        ScenarioError: with the speed and the growth rate of an unstable mode.
    """
    limits, fastest = vehicle.limits, 0.0
    headings = (None,) if isinstance(vehicle, Vehicle) else (None, 0.5 * math.pi)
    for speed, heading in product(
        sorted({limits.min_speed, limits.cruise_speed, limits.max_speed}), headings
    ):
        modes = eigenvalues(vehicle, speed, gravity_mps2, closed_loop=True, heading_rad=heading)
        fastest_growth = float(modes[0].real)
        if fastest_growth >= 0.0:
            raise ScenarioError(
                f"the trim at {speed:g} m/s is unstable under its autopilot: a disturbance "
                f"grows with {fastest_growth:.3f} 1/s",
                place=f"vehicle {vehicle.name}",
            )
        fastest = max(fastest, float(np.abs(modes).max()))
    return fastest
