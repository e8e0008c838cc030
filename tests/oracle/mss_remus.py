"""REMUS 100 as the Marine Systems Simulator has it (remus100.m, revision of 2026-10-07), as an oracle.

Written anew from the model's formulas and numbers: a spheroid with Lamb's added masses, lift and drag of a wing in the
vertical plane, cross-flow drag of a cylinder in 20 strips, linear damping, fins of constant lift slope and a propeller
with linear K_T and K_Q. No added-mass coupling of sway, heave and yaw (no Munk moment). Still water, Euler angles.
It imports nothing from the package.

State: (u, v, w, p, q, r, x, y, z, roll, pitch, yaw), m, rad, s. Positive rudder turns to starboard, positive stern
plane pitches down.
"""

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DENSITY = 1026.0
LATITUDE_DEG = 63.446827
LENGTH, DIAMETER = 1.6, 0.19
SEMI_A, SEMI_B = 1.0096 * LENGTH / 2, 1.0096 * DIAMETER / 2  # scaled by the model for a mass of 31.9 kg
GRAVITY_ARM = 0.02
ROLL_ADDED = 0.3
AXIAL_DRAG = 0.42
PROPELLER_DIAMETER, THRUST_DEDUCTION, ADVANCE = 0.14, 0.1, 0.944
THRUST_0, THRUST_1, TORQUE_0, TORQUE_1, ADVANCE_1 = 0.4566, 0.1798, 0.0700, 0.0312, 0.6632
FIN_PAIR_AREA, RUDDER_SLOPE, STERN_SLOPE = 2 * 0.00665, 0.5, 0.7
SURGE_TIME, SWAY_TIME, YAW_TIME, ROLL_DAMPING, PITCH_DAMPING = 20.0, 20.0, 1.0, 0.3, 0.8
OSWALD = 0.3
STRIPS = 20
MUNK_MOMENT = False  # the model sets the coupling to zero; a test puts it back to see what it does
MAX_RUDDER_RAD, MAX_RPM = math.radians(20.0), 1525.0
# Drag of a smooth cylinder against Reynolds number (DNV-RP-C205, as digitised in cylinderDrag.m), and its reduction at
# the hull's slenderness below and above the drag crisis, interpolated from the same file.
REYNOLDS = (
    *(1.021e4, 1.493e5, 2.147e5, 2.309e5, 2.716e5, 2.971e5, 3.253e5, 3.619e5, 4.098e5, 4.753e5),
    *(5.247e5, 5.789e5, 6.383e5, 7.440e5, 8.532e5, 1.0687e6, 1.3934e6),
)
CYLINDER = (
    *(1.2077, 1.2115, 1.2117, 1.2011, 1.1692, 1.1116, 1.0093, 0.8941, 0.7086, 0.5315),
    *(0.4079, 0.3268, 0.2842, 0.2971, 0.3228, 0.3891, 0.4703),
)
SLENDER_LOW = 0.62 + (LENGTH / DIAMETER - 5) * (0.68 - 0.62) / 5
SLENDER_HIGH = 0.80 + (LENGTH / DIAMETER - 5) * (0.82 - 0.80) / 5


def gravity_mps2() -> float:
    """Somigliana's gravity at the model's latitude."""
    sine2 = math.sin(math.radians(LATITUDE_DEG)) ** 2
    return 9.7803253359 * (1 + 0.001931850400 * sine2) / math.sqrt(1 - 0.006694384442 * sine2)


def _cross(a: Array) -> Array:
    x, y, z = a
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _shift() -> Array:
    shift = np.eye(6)
    shift[:3, 3:] = _cross(np.array([0.0, 0.0, GRAVITY_ARM])).T
    return shift


def rigid_body() -> tuple[float, Array]:
    """Mass (kg) and inertia about the centre of gravity (kg m²) of the spheroid."""
    mass = 4 / 3 * math.pi * DENSITY * SEMI_A * SEMI_B**2
    across = 0.2 * mass * (SEMI_A**2 + SEMI_B**2)
    return mass, np.diag([0.4 * mass * SEMI_B**2, across, across])


def mass_matrices() -> tuple[Array, Array]:
    """Rigid-body and added mass about the centre of buoyancy."""
    mass, inertia = rigid_body()
    at_cg = np.zeros((6, 6))
    at_cg[:3, :3], at_cg[3:, 3:] = mass * np.eye(3), inertia
    e2 = 1 - (SEMI_B / SEMI_A) ** 2
    e = math.sqrt(e2)
    log = math.log((1 + e) / (1 - e))
    along = 2 * (1 - e2) / e**3 * (0.5 * log - e)
    across = 1 / e2 - (1 - e2) / (2 * e**3) * log
    difference = across - along
    turn = e2**2 * difference / ((2 - e2) * (2 * e2 - (2 - e2) * difference))
    k1, k2 = along / (2 - along), across / (2 - across)
    added = np.diag(
        [
            k1 * mass,
            k2 * mass,
            k2 * mass,
            ROLL_ADDED * inertia[0, 0],
            turn * inertia[1, 1],
            turn * inertia[1, 1],
        ]
    )
    return _shift().T @ at_cg @ _shift(), added


def propeller(speed_mps: float, rpm: float) -> tuple[float, float]:
    """Thrust (N) and torque (N m) of the propeller alone; the model takes a tenth of the torque."""
    n = float(np.clip(rpm, -MAX_RPM, MAX_RPM)) / 60
    thrust, torque = THRUST_0 * abs(n) * n, TORQUE_0 * abs(n) * n
    if n > 0:
        inflow = ADVANCE * speed_mps / PROPELLER_DIAMETER * n
        thrust += (THRUST_1 - THRUST_0) / ADVANCE_1 * inflow
        torque += (TORQUE_1 - TORQUE_0) / ADVANCE_1 * inflow
    return DENSITY * PROPELLER_DIAMETER**4 * thrust, DENSITY * PROPELLER_DIAMETER**5 * torque


def _hull(nu: Array) -> Array:
    """Lift and drag in the vertical plane, and cross-flow drag by strips."""
    u, v, w, _, q, r = nu
    speed2, angle = float(u * u + v * v + w * w), math.atan2(w, u)
    plan = 0.7 * LENGTH * DIAMETER
    aspect = DIAMETER**2 / plan
    lift = math.pi * aspect / (1 + math.sqrt(1 + (aspect / 2) ** 2)) * angle
    # the parasitic drag is referred to the frontal area of the scaled spheroid
    drag = AXIAL_DRAG * math.pi * SEMI_B**2 / plan + lift**2 / (math.pi * OSWALD * aspect)
    pressure = 0.5 * DENSITY * speed2 * plan
    sine, cosine = math.sin(angle), math.cos(angle)
    force = np.zeros(6)
    force[0] = pressure * (lift * sine - drag * cosine)
    force[2] = pressure * (-lift * cosine - drag * sine)
    reynolds = math.hypot(v, w) * LENGTH * 1e6
    slender = SLENDER_LOW if reynolds < 2e5 else SLENDER_HIGH
    k = 0.5 * DENSITY * DIAMETER * slender * float(np.interp(reynolds, REYNOLDS, CYLINDER)) * LENGTH / STRIPS
    x = LENGTH * ((np.arange(STRIPS) + 0.5) / STRIPS - 0.5)
    across, down = v + x * r, w + x * q  # the model's own sign of x q
    across, down = k * np.abs(across) * across, k * np.abs(down) * down
    force[1] -= across.sum()
    force[2] -= down.sum()
    force[4] -= (x * down).sum()
    force[5] -= (x * across).sum()
    return force


def _controls(nu: Array, rudder_rad: float, stern_rad: float, rpm: float) -> Array:
    u, v, w = nu[:3]
    thrust, torque = propeller(float(np.linalg.norm(nu[:3])), rpm)
    limit = MAX_RUDDER_RAD
    rudder, stern = float(np.clip(rudder_rad, -limit, limit)), float(np.clip(stern_rad, -limit, limit))
    side = 0.5 * DENSITY * (u * u + v * v) * FIN_PAIR_AREA * RUDDER_SLOPE
    down = 0.5 * DENSITY * (u * u + w * w) * FIN_PAIR_AREA * STERN_SLOPE
    force = np.zeros(6)
    force[0] = (1 - THRUST_DEDUCTION) * thrust - side * rudder**2 - down * stern**2
    force[1], force[2], force[3] = -side * rudder, -down * stern, torque / 10
    force[4], force[5] = -SEMI_A * down * stern, SEMI_A * side * rudder
    return force


def rates(state: Array, rudder_rad: float, stern_rad: float, rpm: float) -> Array:
    """Derivative of the state, shape (12,)."""
    nu, (roll, pitch, yaw) = state[:6], state[9:]
    mass, inertia = rigid_body()
    rigid, added = mass_matrices()
    total = rigid + added
    spin = _cross(nu[3:])
    coriolis_cg = np.zeros((6, 6))
    coriolis_cg[:3, :3], coriolis_cg[3:, 3:] = mass * spin, -_cross(inertia @ nu[3:])
    coriolis = _shift().T @ coriolis_cg @ _shift()
    momentum = added @ nu
    coriolis_added = np.zeros((6, 6))
    coriolis_added[:3, 3:] = coriolis_added[3:, :3] = -_cross(momentum[:3])
    coriolis_added[3:, 3:] = -_cross(momentum[3:])
    if not MUNK_MOMENT:
        for row, column in ((4, 2), (4, 0), (5, 0), (5, 1)):
            coriolis_added[row, column] = coriolis_added[column, row] = 0.0
    weight = mass * gravity_mps2()
    stiffness = weight * GRAVITY_ARM
    own = np.diag(total)
    damping = own * np.array([1 / SURGE_TIME, 1 / SWAY_TIME, 1 / SWAY_TIME, 0.0, 0.0, 1 / YAW_TIME])
    damping[0] *= math.exp(-3 * float(np.linalg.norm(nu[:3])))
    damping[3] = 2 * ROLL_DAMPING * math.sqrt(stiffness * own[3])
    damping[4] = 2 * PITCH_DAMPING * math.sqrt(stiffness * own[4])
    sr, cr, sp, cp = math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch)
    sy, cy = math.sin(yaw), math.cos(yaw)
    force = _hull(nu) + _controls(nu, rudder_rad, stern_rad, rpm)
    force -= (coriolis + coriolis_added) @ nu + damping * nu
    force[3] -= stiffness * cp * sr
    force[4] -= stiffness * sp
    attitude = np.array(
        [
            [cy * cp, -sy * cr + cy * sp * sr, sy * sr + cy * cr * sp],
            [sy * cp, cy * cr + sr * sp * sy, -cy * sr + sp * sy * cr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    p, q, r = nu[3:]
    euler = [p + (q * sr + r * cr) * sp / cp, q * cr - r * sr, (q * sr + r * cr) / cp]
    return np.concatenate([np.linalg.solve(total, force), attitude @ nu[:3], euler])


def step(state: Array, rudder_rad: float, stern_rad: float, rpm: float, step_s: float) -> Array:
    """One step of RK4 with the controls held."""

    def at(x: Array) -> Array:
        return rates(x, rudder_rad, stern_rad, rpm)

    k1 = at(state)
    k2 = at(state + 0.5 * step_s * k1)
    k3 = at(state + 0.5 * step_s * k2)
    k4 = at(state + step_s * k3)
    return state + step_s / 6 * (k1 + 2 * (k2 + k3) + k4)


def held(
    speed_mps: float,
    rudder_rad: float,
    rpm: float,
    duration_s: float,
    stern_rad: float = 0.0,
    step_s: float = 0.05,
) -> Array:
    """State after a time with rudder, stern plane and shaft held, from level flight at a speed."""
    state = np.zeros(12)
    state[0] = speed_mps
    for _ in range(round(duration_s / step_s)):
        state = step(state, rudder_rad, stern_rad, rpm, step_s)
    return state
