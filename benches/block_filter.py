"""The 20-state filter of `docs/equations.md` with its block structure, written for numba: the candidate to beat.

The same mechanisation, error model and update as the product's kernel at every step, first order: Phi = I + F dt with F
averaged over the step, P <- Phi (P + Q/2) Phi' + Q/2, and a row per beam. Frames, units and the order of the states are
the product's.
"""

from __future__ import annotations

import numba
import numpy as np

_fast = numba.njit(fastmath=True, inline="always")


@_fast
def _cross(a, b, out):
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@_fast
def _rotation(q, m):
    w, x, y, z = q[0], q[1], q[2], q[3]
    m[0, 0] = 1 - 2 * (y * y + z * z)
    m[0, 1] = 2 * (x * y - w * z)
    m[0, 2] = 2 * (x * z + w * y)
    m[1, 0] = 2 * (x * y + w * z)
    m[1, 1] = 1 - 2 * (x * x + z * z)
    m[1, 2] = 2 * (y * z - w * x)
    m[2, 0] = 2 * (x * z - w * y)
    m[2, 1] = 2 * (y * z + w * x)
    m[2, 2] = 1 - 2 * (x * x + y * y)


@_fast
def _product(a, b, out):
    w = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3]
    x = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2]
    y = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1]
    z = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]
    out[0], out[1], out[2], out[3] = w, x, y, z


@_fast
def _normalise(q):
    factor = 1 / np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    for k in range(4):
        q[k] *= factor


@_fast
def _exponential(vector, q):
    angle = np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    factor = 0.5 if angle < 1e-8 else np.sin(0.5 * angle) / angle
    q[0] = np.cos(0.5 * angle)
    for k in range(3):
        q[1 + k] = vector[k] * factor


@_fast
def _coefficients(m, v, rate, earth, gravity, c):
    """R v, R, R'[g x] + [v x] R'[w x], rate + R' w and v, one after the other in c (27)."""
    for i in range(3):
        c[i] = m[i, 0] * v[0] + m[i, 1] * v[1] + m[i, 2] * v[2]
        for j in range(3):
            c[3 + 3 * i + j] = m[i, j]
        c[21 + i] = rate[i] + m[0, i] * earth[0] + m[1, i] * earth[1] + m[2, i] * earth[2]
        c[24 + i] = v[i]
    for j in range(3):
        # Columns of [g x] and [w x], turned into the platform frame.
        if j == 0:
            g0, g1, g2 = 0.0, gravity, 0.0
            e0, e1, e2 = 0.0, earth[2], -earth[1]
        elif j == 1:
            g0, g1, g2 = -gravity, 0.0, 0.0
            e0, e1, e2 = -earth[2], 0.0, earth[0]
        else:
            g0, g1, g2 = 0.0, 0.0, 0.0
            e0, e1, e2 = earth[1], -earth[0], 0.0
        w0 = m[0, 0] * e0 + m[1, 0] * e1 + m[2, 0] * e2
        w1 = m[0, 1] * e0 + m[1, 1] * e1 + m[2, 1] * e2
        w2 = m[0, 2] * e0 + m[1, 2] * e1 + m[2, 2] * e2
        c[12 + j] = m[0, 0] * g0 + m[1, 0] * g1 + m[2, 0] * g2 + v[1] * w2 - v[2] * w1
        c[15 + j] = m[0, 1] * g0 + m[1, 1] * g1 + m[2, 1] * g2 + v[2] * w0 - v[0] * w2
        c[18 + j] = m[0, 2] * g0 + m[1, 2] * g1 + m[2, 2] * g2 + v[0] * w1 - v[1] * w0


@_fast
def _add_half_noise(p, c, noise, half):
    """P + G Q G' dt/2; the gyro's noise enters velocity through [v x]."""
    gyro = noise[1] * half
    v0, v1, v2 = c[24], c[25], c[26]
    lever = ((0.0, -v2, v1), (v2, 0.0, -v0), (-v1, v0, 0.0))
    for i in range(3):
        p[3 + i, 3 + i] += gyro
        p[6 + i, 6 + i] += noise[0] * half
        p[9 + i, 9 + i] += noise[2] * half
        p[12 + i, 12 + i] += noise[3] * half
        for j in range(3):
            own = lever[i][0] * lever[j][0] + lever[i][1] * lever[j][1] + lever[i][2] * lever[j][2]
            p[6 + i, 6 + j] += own * gyro
            across = lever[i][0] * c[3 + 3 * j] + lever[i][1] * c[4 + 3 * j] + lever[i][2] * c[5 + 3 * j]
            p[6 + i, 3 + j] += across * gyro
            p[3 + j, 6 + i] += across * gyro
    for i in range(15, 19):
        p[i, i] += noise[4] * half
    p[19, 19] += noise[5] * half


@_fast
def _propagate(p, b, c, earth, dt):
    """P <- Phi P Phi' through the nine dynamic rows alone; b (9, 20) is room for Phi P, whole rows of it at a time."""
    t0, t1, t2 = c[0] * dt, c[1] * dt, c[2] * dt
    e0, e1, e2 = earth[0] * dt, earth[1] * dt, earth[2] * dt
    s0, s1, s2 = c[21] * dt, c[22] * dt, c[23] * dt
    v0, v1, v2 = c[24] * dt, c[25] * dt, c[26] * dt
    r00, r01, r02 = c[3] * dt, c[4] * dt, c[5] * dt
    r10, r11, r12 = c[6] * dt, c[7] * dt, c[8] * dt
    r20, r21, r22 = c[9] * dt, c[10] * dt, c[11] * dt
    f00, f01, f02 = c[12] * dt, c[13] * dt, c[14] * dt
    f10, f11, f12 = c[15] * dt, c[16] * dt, c[17] * dt
    f20, f21, f22 = c[18] * dt, c[19] * dt, c[20] * dt
    for j in range(20):
        a, d, g = p[3, j], p[4, j], p[5, j]
        u, v, w = p[6, j], p[7, j], p[8, j]
        x, y, z = p[12, j], p[13, j], p[14, j]
        b[0, j] = p[0, j] - (t1 * g - t2 * d) + r00 * u + r01 * v + r02 * w
        b[1, j] = p[1, j] - (t2 * a - t0 * g) + r10 * u + r11 * v + r12 * w
        b[2, j] = p[2, j] - (t0 * d - t1 * a) + r20 * u + r21 * v + r22 * w
        b[3, j] = a - (e1 * g - e2 * d) - (r00 * x + r01 * y + r02 * z)
        b[4, j] = d - (e2 * a - e0 * g) - (r10 * x + r11 * y + r12 * z)
        b[5, j] = g - (e0 * d - e1 * a) - (r20 * x + r21 * y + r22 * z)
        b[6, j] = u + f00 * a + f01 * d + f02 * g - (s1 * w - s2 * v) - dt * p[9, j] - (v1 * z - v2 * y)
        b[7, j] = v + f10 * a + f11 * d + f12 * g - (s2 * u - s0 * w) - dt * p[10, j] - (v2 * x - v0 * z)
        b[8, j] = w + f20 * a + f21 * d + f22 * g - (s0 * v - s1 * u) - dt * p[11, j] - (v0 * y - v1 * x)
    for i in range(9):
        a, d, g = b[i, 3], b[i, 4], b[i, 5]
        u, v, w = b[i, 6], b[i, 7], b[i, 8]
        x, y, z = b[i, 12], b[i, 13], b[i, 14]
        p[i, 0] = b[i, 0] - (t1 * g - t2 * d) + r00 * u + r01 * v + r02 * w
        p[i, 1] = b[i, 1] - (t2 * a - t0 * g) + r10 * u + r11 * v + r12 * w
        p[i, 2] = b[i, 2] - (t0 * d - t1 * a) + r20 * u + r21 * v + r22 * w
        p[i, 3] = a - (e1 * g - e2 * d) - (r00 * x + r01 * y + r02 * z)
        p[i, 4] = d - (e2 * a - e0 * g) - (r10 * x + r11 * y + r12 * z)
        p[i, 5] = g - (e0 * d - e1 * a) - (r20 * x + r21 * y + r22 * z)
        p[i, 6] = u + f00 * a + f01 * d + f02 * g - (s1 * w - s2 * v) - dt * b[i, 9] - (v1 * z - v2 * y)
        p[i, 7] = v + f10 * a + f11 * d + f12 * g - (s2 * u - s0 * w) - dt * b[i, 10] - (v2 * x - v0 * z)
        p[i, 8] = w + f20 * a + f21 * d + f22 * g - (s0 * v - s1 * u) - dt * b[i, 11] - (v0 * y - v1 * x)
        for j in range(9, 20):
            p[i, j] = b[i, j]
            p[j, i] = b[i, j]


@_fast
def _update(p, m, r, q, v, biases, directions, reading, variance):
    """One row per beam, all four at once, and the feedback of the error."""
    scale = 1 + biases[10]
    h = np.zeros((4, 20))
    residual = np.empty(4)
    for beam in range(4):
        along = directions[beam, 0] * v[0] + directions[beam, 1] * v[1] + directions[beam, 2] * v[2]
        for k in range(3):
            h[beam, 6 + k] = directions[beam, k] * scale
        h[beam, 15 + beam] = 1.0
        h[beam, 19] = along
        residual[beam] = reading[beam] - along * scale - biases[6 + beam]
    ph = p @ h.T
    s = h @ ph + variance * np.eye(4)
    k = np.linalg.solve(s, ph.T).T
    left = np.eye(20) - k @ h
    p[:] = left @ p @ left.T + variance * (k @ k.T)
    error = k @ residual
    turn, product = np.empty(4), np.empty(4)
    _exponential(error[3:6], turn)
    _product(turn, q, product)
    q[:] = product
    _normalise(q)
    _rotation(q, m)
    r += error[0:3]
    v += error[6:9]
    biases += error[9:20]


@numba.njit(fastmath=True, cache=True)
def run_filter(time_ns, rate, force, ping_ns, beams, directions, q0, v0, p0, noise, earth, gravity, beam_sd):
    """Mechanisation, covariance at every step and four beams at each ping; the covariance (20, 20) at the end."""
    p, room = p0.copy(), np.empty((9, 20))
    r, q, v, m = np.zeros(3), q0.copy(), v0.copy(), np.empty((3, 3))
    biases = np.zeros(11)
    _normalise(q)
    _rotation(q, m)
    w0, w1, f0, f1 = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    c0, c1 = np.empty(27), np.empty(27)
    vector, turn, product, coning = np.empty(3), np.empty(4), np.empty(4), np.empty(3)
    u, u_new, gain, coriolis = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    earth_turn = np.empty(4)
    ping, known = 0, False
    for step in range(1, len(time_ns)):
        dt = (time_ns[step] - time_ns[step - 1]) * 1e-9
        for k in range(3):
            f0[k] = force[step - 1, k] - biases[k]
            w0[k] = rate[step - 1, k] - biases[3 + k]
            f1[k] = force[step, k] - biases[k]
            w1[k] = rate[step, k] - biases[3 + k]
        if not known:
            _coefficients(m, v, w0, earth, gravity, c0)
            known = True
        # Strapdown: mean rate with coning, force by the trapezoid in the tangent frame.
        _cross(w0, w1, coning)
        for k in range(3):
            vector[k] = 0.5 * dt * (w0[k] + w1[k]) + dt * dt / 12 * coning[k]
            u[k] = m[k, 0] * v[0] + m[k, 1] * v[1] + m[k, 2] * v[2]
            gain[k] = 0.5 * dt * (m[k, 0] * f0[0] + m[k, 1] * f0[1] + m[k, 2] * f0[2])
            earth_turn[1 + k] = -0.5 * dt * earth[k]
        earth_turn[0] = 1.0
        _exponential(vector, turn)
        _product(q, turn, product)
        _product(earth_turn, product, q)
        _normalise(q)
        _rotation(q, m)
        for k in range(3):
            gain[k] += 0.5 * dt * (m[k, 0] * f1[0] + m[k, 1] * f1[1] + m[k, 2] * f1[2])
        gain[2] += gravity * dt
        for k in range(3):
            u_new[k] = u[k] + 0.5 * gain[k]
        _cross(earth, u_new, coriolis)
        for k in range(3):
            u_new[k] = u[k] + gain[k] - 2 * dt * coriolis[k]
            r[k] += 0.5 * dt * (u[k] + u_new[k])
        for k in range(3):
            v[k] = m[0, k] * u_new[0] + m[1, k] * u_new[1] + m[2, k] * u_new[2]
        # Covariance with the mean coefficients of the step.
        _coefficients(m, v, w1, earth, gravity, c1)
        for k in range(27):
            c0[k] = 0.5 * (c0[k] + c1[k])
        _add_half_noise(p, c0, noise, 0.5 * dt)
        _propagate(p, room, c0, earth, dt)
        _add_half_noise(p, c0, noise, 0.5 * dt)
        for k in range(27):
            c0[k] = c1[k]
        if ping < len(ping_ns) and ping_ns[ping] == time_ns[step]:
            _update(p, m, r, q, v, biases, directions, beams[ping], beam_sd * beam_sd)
            ping += 1
            known = False
    return p
