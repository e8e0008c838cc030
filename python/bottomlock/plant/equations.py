"""The equations of motion on components: velocity, attitude and actuators to the acceleration.

M nu_r' + C_RB(nu_r) nu_r + C_A(nu_r) nu_r + D(nu_r) nu_r + g(eta) = tau (Fossen 2021, for an irrotational current),
in the platform frame with its origin at the centre of buoyancy. The Earth's rotation is neglected in the forces; it
enters the ideal sensors (`simulation.analytic.ideal_inertial_readings`). M_RB and M_A: Fossen 2021, chapters 3 and 6.

Fin i stands at r_i = (x, R cos a, R sin a), a from starboard towards down; its normal is n_i = (0, -sin a, cos a). A
positive deflection turns the leading edge towards n_i and pushes the fin along n_i, so equal deflections roll the
vehicle to starboard.

Every term of the hull opposes the local velocity, so that each dissipates energy in any state.
"""

import math
from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np
from scipy.integrate import trapezoid

from bottomlock.plant.hovering_vehicle import AnyVehicle, HoveringVehicle
from bottomlock.plant.maths import FloatArray, Four, Maths, Number, Six, Three
from bottomlock.plant.vehicle import Hull, Vehicle
from bottomlock.recordings.rotation import skew

Forces: TypeAlias = Callable[[Six[Number], Sequence[Number]], Six[Number]]
"""Force and moment (X, Y, Z, K, M, N), N and N m, from nu relative to the water (m/s, rad/s) and the actuators."""

STRIPS = 6


def centre_of_gravity_p_m(vehicle: AnyVehicle) -> FloatArray:
    """r_g from the centre of buoyancy, platform frame, m."""
    body = vehicle.rigid_body
    return np.array([body.centre_of_gravity_x, body.centre_of_gravity_y, body.centre_of_gravity_z])


def rigid_body_mass_matrix(vehicle: AnyVehicle) -> FloatArray:
    """M_RB about the centre of buoyancy, shape (6, 6); Fossen 2021, chapter 3."""
    body = vehicle.rigid_body
    coupling = body.mass * skew(centre_of_gravity_p_m(vehicle))
    inertia = np.diag([body.inertia_xx, body.inertia_yy, body.inertia_zz])
    return np.block([[body.mass * np.eye(3), -coupling], [coupling, inertia]])


def added_mass_matrix(vehicle: AnyVehicle) -> FloatArray:
    """M_A, shape (6, 6), symmetric, of a body with two planes of symmetry; Fossen 2021, chapter 6."""
    added = vehicle.added_mass
    matrix = -np.diag([added.x_udot, added.y_vdot, added.z_wdot, added.k_pdot, added.m_qdot, added.n_rdot])
    matrix[1, 5] = matrix[5, 1] = -added.y_rdot
    matrix[2, 4] = matrix[4, 2] = -added.z_qdot
    return matrix


def myring_radius_m(hull: Hull, from_nose_m: FloatArray) -> FloatArray:
    """Hull radius at stations aft of the nose tip, m.

    Myring 1976 as Prestero 2001, Eqs. 2.1 and 2.2, without his offsets: nose and tail are whole.
    """
    nose, tail, length, diameter = hull.nose_length, hull.tail_length, hull.length, hull.diameter
    x = np.asarray(from_nose_m, dtype=np.float64)
    fore = np.clip((x - nose) / nose, -1.0, 0.0)
    nose_radius = 0.5 * diameter * (1.0 - fore**2) ** (1.0 / hull.nose_exponent)
    aft = np.clip(x - (length - tail), 0.0, tail)
    slope = np.tan(hull.tail_angle)
    tail_radius = (
        0.5 * diameter
        - (1.5 * diameter / tail**2 - slope / tail) * aft**2
        + (diameter / tail**3 - slope / tail**2) * aft**3
    )
    inside = (x >= 0.0) & (x <= length)
    return np.where(inside, np.maximum(np.where(x < nose, nose_radius, tail_radius), 0.0), 0.0)


def cross_flow_strips(vehicle: Vehicle, count: int = STRIPS) -> list[tuple[float, float]]:
    """Gauss-Legendre strips along the hull: (station x m, drag weight rho/2 Cd d dx in kg/m).

    The weights contain the hull's diameter along Myring's shape, scaled so that the total is that of the exact plan
    area.
    """
    hull = vehicle.hull
    nodes, weights = np.polynomial.legendre.leggauss(count)
    from_nose = 0.5 * hull.length * (nodes + 1.0)
    widths = 0.5 * hull.length * weights * 2.0 * myring_radius_m(hull, from_nose)
    fine = np.linspace(0.0, hull.length, 4001)
    plan_area = float(trapezoid(2.0 * myring_radius_m(hull, fine), fine))
    widths *= plan_area / float(widths.sum())
    drag = 0.5 * vehicle.water.density * hull.cross_flow_drag * widths
    stations = hull.centre_of_buoyancy_from_nose - from_nose
    return [(float(x), float(k)) for x, k in zip(stations, drag, strict=True)]


def hull_wrench(vehicle: Vehicle, maths: Maths[Number]) -> Callable[[Six[Number]], Six[Number]]:
    """Build the hull's damping (X, Y, Z, K, M, N), N and N m, from nu relative to the water (m/s, rad/s).

    Source: axial drag, Prestero 2001, Eq. 4.5; body lift, Eqs. 4.33 to 4.36, with the inflow at the centre of pressure;
    cross-flow drag by strips, Eq. 4.8 and MSS crossFlowDrag.m, with the resultant cross flow.
    """
    hull = vehicle.hull
    axial, lift, arm, roll = hull.axial_drag, hull.lift, hull.centre_of_pressure_x, hull.roll_drag
    pitch_drag, yaw_drag = hull.pitch_drag, hull.yaw_drag
    strips, sqrt = cross_flow_strips(vehicle), maths.sqrt

    def wrench(nu: Six[Number]) -> Six[Number]:
        u, v, w, p, q, r = nu
        ahead = abs(u)
        side = -lift * ahead * (v + arm * r)
        heave = -lift * ahead * (w - arm * q)
        yaw = arm * side - yaw_drag * abs(r) * r
        pitch = -arm * heave - pitch_drag * abs(q) * q
        for x, k in strips:
            across = v + x * r
            down = w - x * q
            pull = k * sqrt(across * across + down * down)
            across = pull * across
            down = pull * down
            side = side - across
            heave = heave - down
            yaw = yaw - x * across
            pitch = pitch + x * down
        return -axial * ahead * u, side, heave, -roll * abs(p) * p, pitch, yaw

    return wrench


def lift_and_drag(vehicle: Vehicle, maths: Maths[Number]) -> Callable[[Number], tuple[Number, Number]]:
    """Build C_L and C_D of one fin as functions of its angle of attack, rad.

    Below stall the lift is linear and the drag the usual polar; past it the fin is a flat plate (C_L = 2
    |sin a| sin a cos a, C_D = 2 sin² a). The two blend smoothly over the stall width: Beard and McLain 2012
    as in MSS coeffLiftDrag.m, here with the plate's drag and a tanh for the blend.
    """
    fins = vehicle.fins
    slope, base, stall = fins.lift_slope, fins.zero_lift_drag, fins.stall_angle
    induced = 1.0 / (math.pi * fins.oswald_efficiency * fins.aspect_ratio)
    sharpness = 1.0 / fins.stall_width
    sin, cos, tanh = maths.sin, maths.cos, maths.tanh

    def coefficients(angle: Number) -> tuple[Number, Number]:
        stalled = 0.5 + 0.5 * tanh(sharpness * (abs(angle) - stall))
        attached = 1.0 - stalled
        sine = sin(angle)
        plate = 2.0 * abs(sine) * stalled
        linear = slope * angle
        lift = attached * linear + plate * sine * cos(angle)
        drag = base + attached * induced * linear * linear + plate * abs(sine)
        return lift, drag

    return coefficients


def fin_wrench(vehicle: Vehicle, maths: Maths[Number]) -> Forces[Number]:
    """Build the force and moment of all fins; the actuators begin with their deflections (rad).

    Each fin sees the inflow at its own centre (Prestero 2001, Eq. 4.40, all terms kept), so fins damp yaw, pitch and
    roll by themselves.
    """
    fins = vehicle.fins
    x, radius = fins.position_x, fins.centre_radius
    pressure_area = 0.5 * vehicle.water.density * fins.area
    normals = [(math.cos(a), math.sin(a)) for a in fins.azimuth]
    coefficients = lift_and_drag(vehicle, maths)
    sqrt, atan2 = maths.sqrt, maths.atan2

    def wrench(nu: Six[Number], actuators: Sequence[Number]) -> Six[Number]:
        u, v, w, p, q, r = nu
        sway = v + x * r
        heave = w - x * q
        spin = radius * p
        total_x = total_y = total_z = total_k = total_m = total_n = 0.0 * u
        for (c, s), deflection in zip(normals, actuators[:4], strict=True):
            axial = u + radius * (s * q - c * r)
            normal = c * heave - s * sway + spin
            speed = sqrt(axial * axial + normal * normal)
            lift, drag = coefficients(atan2(normal, axial) - deflection)
            scale = pressure_area * speed
            thrust = scale * (lift * normal - drag * axial)
            push = -scale * (lift * axial + drag * normal)
            total_x = total_x + thrust
            total_y = total_y - s * push
            total_z = total_z + c * push
            total_k = total_k + radius * push
            total_m = total_m + radius * s * thrust - x * c * push
            total_n = total_n - radius * c * thrust - x * s * push
        return total_x, total_y, total_z, total_k, total_m, total_n

    return wrench


def propeller_wrench(vehicle: Vehicle) -> Callable[[Number, Number], tuple[Number, Number]]:
    """Build net thrust X (N) and roll moment K (N m) from speed u (m/s) and shaft n (rev/s).

    T = rho D⁴ (K_T0 n|n| + K_T1 |n| V_a / D), V_a = (1 - w) u, and the hull gets (1 - t) T. The torque has the same
    form with D⁵, opposite to the rotation (linear in the advance number, as MSS remus100.m). A stopped shaft gives
    neither.
    """
    prop = vehicle.propeller
    density, diameter = vehicle.water.density, prop.diameter
    advance = (1.0 - prop.wake_fraction) / diameter
    thrust = density * diameter**4 * (1.0 - prop.thrust_deduction)
    thrust_0, thrust_1 = thrust * prop.thrust_at_rest, thrust * prop.thrust_slope * advance
    torque = -prop.rotation * density * diameter**5
    torque_0, torque_1 = torque * prop.torque_at_rest, torque * prop.torque_slope * advance

    def wrench(u: Number, shaft: Number) -> tuple[Number, Number]:
        size = abs(shaft)
        return size * (thrust_0 * shaft + thrust_1 * u), size * (torque_0 * shaft + torque_1 * u)

    return wrench


def swimming_wrench(vehicle: Vehicle, maths: Maths[Number]) -> Forces[Number]:
    """Build hull, fins and propeller together; the actuators begin with the fins (rad) and the shaft (rev/s)."""
    hull, fins, propeller = hull_wrench(vehicle, maths), fin_wrench(vehicle, maths), propeller_wrench(vehicle)

    def wrench(nu: Six[Number], actuators: Sequence[Number]) -> Six[Number]:
        hull_x, hull_y, hull_z, hull_k, hull_m, hull_n = hull(nu)
        fin_x, fin_y, fin_z, fin_k, fin_m, fin_n = fins(nu, actuators)
        thrust, torque = propeller(nu[0], actuators[4])
        return (
            hull_x + fin_x + thrust, hull_y + fin_y, hull_z + fin_z,
            hull_k + fin_k + torque, hull_m + fin_m, hull_n + fin_n,
        )  # fmt: skip

    return wrench


def thruster_wrench(vehicle: HoveringVehicle) -> Forces[Number]:
    """Build damping and thrust; the actuators begin with the thrusts (N).

    Each axis is damped by itself, linear and quadratic (von Benzon et al. 2022); the thrust is that at rest.
    """
    drag, rows = vehicle.damping.axes(), vehicle.thrusters.wrenches().tolist()
    count = len(rows[0])

    def wrench(nu: Six[Number], actuators: Sequence[Number]) -> Six[Number]:
        thrusts = actuators[:count]
        x, y, z, k, m, n = [
            sum(part * thrust for part, thrust in zip(row, thrusts, strict=True))
            - (linear + quadratic * abs(rate)) * rate
            for row, (linear, quadratic), rate in zip(rows, drag, nu, strict=True)
        ]
        return x, y, z, k, m, n

    return wrench


def to_platform(
    q0: Number, q1: Number, q2: Number, q3: Number, n: Number, e: Number, d: Number
) -> Three[Number]:
    """Rotate a tangent-frame vector to the platform frame: R' a, with the quaternion of platform to tangent."""
    # a - 2 q0 (q x a) + 2 q x (q x a), the transpose of the usual two cross products
    x = 2.0 * (q2 * d - q3 * e)
    y = 2.0 * (q3 * n - q1 * d)
    z = 2.0 * (q1 * e - q2 * n)
    return n - q0 * x + q2 * z - q3 * y, e - q0 * y + q3 * x - q1 * z, d - q0 * z + q1 * y - q2 * x


def to_tangent(
    q0: Number, q1: Number, q2: Number, q3: Number, a: Number, b: Number, c: Number
) -> Three[Number]:
    """Rotate a platform-frame vector to the tangent frame: R a."""
    x = 2.0 * (q2 * c - q3 * b)
    y = 2.0 * (q3 * a - q1 * c)
    z = 2.0 * (q1 * b - q2 * a)
    return a + q0 * x + q2 * z - q3 * y, b + q0 * y + q3 * x - q1 * z, c + q0 * z + q1 * y - q2 * x


def coriolis_wrench(vehicle: AnyVehicle) -> Callable[[Six[Number]], Six[Number]]:
    """Build C(nu_r) nu_r of body and added mass, N and N m, from nu relative to the water (m/s, rad/s).

    With linear and angular momentum (l, h) = M nu_r it is (omega x l, omega x h + v x l).

    Source: Fossen 2021, Theorem 3.2, as MSS m2c.m.
    """
    times_mass = linear_map(rigid_body_mass_matrix(vehicle) + added_mass_matrix(vehicle))

    def wrench(nu: Six[Number]) -> Six[Number]:
        u, v, w, p, q, r = nu
        lx, ly, lz, hx, hy, hz = times_mass(nu)
        return (
            q * lz - r * ly, r * lx - p * lz, p * ly - q * lx,
            q * hz - r * hy + v * lz - w * ly, r * hx - p * hz + w * lx - u * lz, p * hy - q * hx + u * ly - v * lx,
        )  # fmt: skip

    return wrench


def linear_map(matrix: FloatArray) -> Callable[[Six[Number]], Six[Number]]:
    """Build the product of a matrix (6, 6) with six components."""
    rows = [tuple(float(value) for value in row) for row in matrix]

    def product(six: Six[Number]) -> Six[Number]:
        u, v, w, p, q, r = six
        x, y, z, k, m, n = [a * u + b * v + c * w + d * p + e * q + f * r for a, b, c, d, e, f in rows]
        return x, y, z, k, m, n

    return product


def restoring_wrench(vehicle: AnyVehicle, gravity_mps2: float) -> Callable[[Four[Number]], Six[Number]]:
    """Build -g(eta): force and moment (N, N m) of weight and buoyancy, from the attitude quaternion."""
    body = vehicle.rigid_body
    xg, yg, zg = (float(value) for value in centre_of_gravity_p_m(vehicle))
    weight = body.mass * gravity_mps2
    surplus = weight - vehicle.water.density * body.displaced_volume * gravity_mps2

    def wrench(attitude: Four[Number]) -> Six[Number]:
        q0, q1, q2, q3 = attitude
        down_x, down_y = 2.0 * (q1 * q3 - q0 * q2), 2.0 * (q2 * q3 + q0 * q1)
        down_z = 1.0 - 2.0 * (q1 * q1 + q2 * q2)
        return (
            surplus * down_x, surplus * down_y, surplus * down_z,
            weight * (yg * down_z - zg * down_y),
            weight * (zg * down_x - xg * down_z),
            weight * (xg * down_y - yg * down_x),
        )  # fmt: skip

    return wrench


def acceleration(
    vehicle: AnyVehicle, gravity_mps2: float, maths: Maths[Number]
) -> Callable[[Four[Number], Six[Number], Sequence[Number], Three[Number], Three[Number]], Six[Number]]:
    """Build nu' (m/s², rad/s²) as a function of the whole mechanical state.

    The function takes the attitude quaternion (scalar first, platform to tangent), nu over ground (m/s, rad/s), the
    actuators (fin deflections in rad and shaft speed in rev/s, or thrusts in N; what follows them is not used), and the
    velocity and acceleration of the current at the vehicle (tangent frame, m/s and m/s²; the acceleration is the rate
    of change along the vehicle's path).
    """
    mass = rigid_body_mass_matrix(vehicle) + added_mass_matrix(vehicle)
    over_mass = linear_map(np.asarray(np.linalg.inv(mass), dtype=np.float64))
    forces: Forces[Number]
    forces = swimming_wrench(vehicle, maths) if isinstance(vehicle, Vehicle) else thruster_wrench(vehicle)
    coriolis, restoring = coriolis_wrench(vehicle), restoring_wrench(vehicle, gravity_mps2)

    def nu_dot(
        attitude: Four[Number],
        nu: Six[Number],
        actuators: Sequence[Number],
        current_velocity_n: Three[Number],
        current_accel_n: Three[Number],
    ) -> Six[Number]:
        u, v, w, p, q, r = nu
        uc, vc, wc = to_platform(*attitude, *current_velocity_n)
        relative = (u - uc, v - vc, w - wc, p, q, r)
        x, y, z, k, m, n = forces(relative, actuators)
        c_x, c_y, c_z, c_k, c_m, c_n = coriolis(relative)
        g_x, g_y, g_z, g_k, g_m, g_n = restoring(attitude)
        ud, vd, wd, pd, qd, rd = over_mass(
            (x - c_x + g_x, y - c_y + g_y, z - c_z + g_z, k - c_k + g_k, m - c_m + g_m, n - c_n + g_n)
        )
        ax, ay, az = to_platform(*attitude, *current_accel_n)
        # the current in the platform frame changes as the vehicle rotates: d(R' c)/dt = R' c' - omega x R' c
        return (
            ud + ax - (q * wc - r * vc),
            vd + ay - (r * uc - p * wc),
            wd + az - (p * vc - q * uc),
            pd,
            qd,
            rd,
        )

    return nu_dot
