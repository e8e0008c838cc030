"""How the DVL sits: misalignment, lever arm, scale and clock offset, from its velocity and what was recorded beside it.

With v_n and attitude C of the platform and its rate ω, all at the time t + τ on the reference's clock,

    v_d(t) = (1 + s) R_pdᵀ (Cᵀ v_n + ω × l)                                   (velocity beside the log)
    Δ[C (R_pd v_d / (1 + s) − ω × l)] = ∫ (C (f − b) + g + a) dt               (IMU and attitude beside the log)

where R_pd turns DVL axes to platform axes, l is the lever arm from the reference's point to the DVL, b an
accelerometer bias and a a constant error of level in the tangent frame. The second form lives on accelerations and
turns: what the motion does not excite keeps the spread of its wide prior and is called not observable.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bottomlock.audit.logs import Inertial, Reference
from bottomlock.audit.motion import ImuAlignment, Motion, align_imu, integral
from bottomlock.audit.robust import Array, NonlinearFit, fit_nonlinear, sigma
from bottomlock.statistics.rms import rms

GRAVITY_MPS2 = 9.81
WINDOW_S = 2.0
REACH_S = 3.0
"""Clock offsets are sought this far to either side."""

LIMITS = {"misalignment_rad": np.deg2rad(1.0), "lever_arm_m": 0.3, "clock_offset_s": 0.1, "scale": 0.02}
"""A quantity with a larger standard deviation is not observable in this log."""
LEAST_EXPLAINED = 0.5
"""Nothing is observable in a log whose velocity follows its neighbours less than this."""


@dataclass(frozen=True, eq=False)
class Mounting:
    """How the DVL sits, each with its standard deviation.

    Attributes:
        way: what it was found from.
        rpy_rad: (3,) roll, pitch, yaw that turn DVL axes to platform axes.
        misalignment_sd_rad: (3,) about the platform's x, y, z.
        lever_arm_p_m, lever_arm_sd_m: (3,) from the reference's point to the DVL.
        clock_offset_s, clock_offset_sd_s: reference time minus DVL time of the same instant.
        scale, scale_sd: the DVL reads (1 + scale) times the velocity.
        mirrored: the DVL's velocity fits only with its y axis turned round: the frame is left-handed.
        residual_mps: (3,) robust sigma per axis.
        explained: part of the robust variance of the velocity (or of its changes) that the fit explains, 0 to 1.
        instants: how many pings or windows went in.
        rate_rms_radps: (3,) how much the platform turned.
        imu: how the IMU's turns compare with the attitude's, or None.
    """

    way: str
    rpy_rad: Array
    misalignment_sd_rad: Array
    lever_arm_p_m: Array
    lever_arm_sd_m: Array
    clock_offset_s: float
    clock_offset_sd_s: float
    scale: float
    scale_sd: float
    mirrored: bool
    residual_mps: Array
    explained: float
    instants: int
    rate_rms_radps: Array
    imu: ImuAlignment | None = None

    @property
    def follows(self) -> bool:
        """The velocity follows what was recorded beside it well enough to say anything."""
        return self.explained > LEAST_EXPLAINED and abs(self.scale) < 0.2


MIRROR = np.diag([1.0, -1.0, 1.0])
_TURNS = [
    Rotation.from_euler("ZX", [yaw, roll], degrees=True)
    for yaw, roll in itertools.product(range(0, 360, 15), (0.0, 180.0))
]


def find_mounting(
    time_ns: NDArray[np.int64], velocity_d_mps: Array, reference: Reference, imu: Inertial | None
) -> Mounting | None:
    """Misalignment, lever arm, clock offset and scale of the instrument's velocity (n, 3) at times (n,) int64.

    Uses the velocity beside the attitude where the reference has one, else the IMU. None where neither is there or the
    recordings overlap by fewer than 50 pings.
    """
    if reference.velocity_t_mps is None and imu is None:
        return None
    zero = int(time_ns[0])
    time_s = np.asarray((time_ns - zero) * 1e-9)
    aligned = None if imu is None else align_imu(reference, imu)
    offset = 0.0 if aligned is None else aligned.offset_s
    # Axes of the gyro are only trusted where they are those of the attitude.
    usable = imu if aligned is None or np.abs(aligned.matrix - np.eye(3)).max() < 0.2 else None
    motion = Motion(reference, usable, zero_ns=zero, imu_offset_s=offset)
    inside = motion.within(time_s, REACH_S + 0.5)
    if inside.sum() < 50:
        return None
    time_s, velocity = time_s[inside], velocity_d_mps[inside]
    if reference.velocity_t_mps is not None:
        return _against_velocity(time_s, velocity, motion, aligned)
    if usable is None:
        return None
    return _against_imu(time_s, velocity, motion, usable, zero_ns=zero, offset_s=offset, aligned=aligned)


def _coarse(cost: Callable[[Array, float], float]) -> tuple[Array, float]:
    """Best start over turns about z, a frame upside down, a mirrored one, and clock offsets."""
    offsets = np.arange(-REACH_S, REACH_S + 0.1, 0.25)
    trials = [(turn.as_matrix() @ mirror, 0) for turn in _TURNS for mirror in (np.eye(3), MIRROR)]
    found = [
        (cost(matrix, float(offset)), k, float(offset))
        for k, (matrix, _) in enumerate(trials)
        for offset in offsets
    ]
    proper = min(one for one in found if one[1] % 2 == 0)
    best = min(found)
    # A left-handed frame has to earn it: velocities in a plane fit a mirrored frame as well as one upside down.
    chosen = best if best[0] < 0.8 * proper[0] else proper
    return trials[chosen[1]][0], chosen[2]


def _against_velocity(
    time_s: Array, velocity: Array, motion: Motion, aligned: ImuAlignment | None
) -> Mounting:
    few = slice(None, None, max(1, len(time_s) // 400))
    cache = {
        float(offset): motion.velocity_p_mps(time_s[few] + offset)
        for offset in np.arange(-REACH_S, REACH_S + 0.1, 0.25)
    }

    def cost(matrix: Array, offset: float) -> float:
        return float(np.median(np.linalg.norm(velocity[few] @ matrix.T - cache[offset], axis=1)))

    start, first_offset = _coarse(cost)
    turned = velocity @ start.T

    def residuals(p: Array) -> Array:
        at = time_s + first_offset + p[6]
        model = motion.velocity_p_mps(at) + np.cross(motion.rate_p_radps(at), p[3:6])
        return np.asarray(turned - (1.0 + p[7]) * Rotation.from_rotvec(p[:3]).inv().apply(model))

    scale = np.array([0.01] * 3 + [0.1] * 3 + [0.05, 0.01])
    prior = np.array([1.0] * 3 + [5.0] * 3 + [2.0, 0.3])
    fit = fit_nonlinear(residuals, np.zeros(8), scale=scale, prior_sd=prior)
    rate = motion.rate_p_radps(time_s + first_offset)
    return _mounting(
        "velocity and attitude beside the log", fit, start, first_offset, rate, velocity, aligned
    )


def _mounting(
    way: str,
    fit: NonlinearFit,
    start: Array,
    offset: float,
    rate: Array,
    signal: Array,
    aligned: ImuAlignment | None,
) -> Mounting:
    sd = np.sqrt(np.diag(fit.cov))
    left = np.array([sigma(column) for column in fit.residuals.T])
    there = np.array([sigma(column) for column in signal.T])
    mirrored = bool(np.linalg.det(start) < 0.0)
    proper = start @ MIRROR if mirrored else start
    turn = Rotation.from_rotvec(fit.parameters[:3]) * Rotation.from_matrix(proper)
    return Mounting(
        way=way,
        rpy_rad=turn.as_euler("ZYX")[::-1],
        misalignment_sd_rad=sd[:3],
        lever_arm_p_m=fit.parameters[3:6],
        lever_arm_sd_m=sd[3:6],
        clock_offset_s=float(offset + fit.parameters[6]),
        clock_offset_sd_s=float(sd[6]),
        scale=float(fit.parameters[7]),
        scale_sd=float(sd[7]),
        mirrored=mirrored,
        residual_mps=left,
        explained=float(np.clip(1.0 - np.sum(left**2) / max(float(np.sum(there**2)), 1e-12), 0.0, 1.0)),
        instants=len(signal),
        rate_rms_radps=rms(rate, axis=0),
        imu=aligned,
    )


def _against_imu(
    time_s: Array, velocity: Array, motion: Motion, imu: Inertial,
    *, zero_ns: int, offset_s: float, aligned: ImuAlignment | None,
) -> Mounting | None:  # fmt: skip
    own_s = np.asarray((imu.time_ns - zero_ns) * 1e-9) - offset_s
    turn = motion.attitude(own_s).as_matrix()
    pull = np.array([0.0, 0.0, GRAVITY_MPS2])
    gained = integral(np.einsum("nij,nj->ni", turn, imu.force_p_mps2) + pull, own_s)
    leaned = integral(turn, own_s)

    usual = float(np.median(np.diff(time_s)))
    stride, hop = max(1, round(WINDOW_S / usual)), max(1, round(0.5 * WINDOW_S / usual))
    first = np.arange(0, len(time_s) - stride, hop)
    # A window over a gap would rest on the IMU alone for too long.
    first = first[time_s[first + stride] - time_s[first] < 1.5 * stride * usual]
    if len(first) < 25:
        return None
    last = first + stride

    def integrated(series: Array, at: Array) -> Array:
        flat = series.reshape(len(series), -1)
        return np.stack([np.interp(at, own_s, column) for column in flat.T], axis=1).reshape(
            -1, *series.shape[1:]
        )

    def windows(offset: float) -> tuple[Array, Array, Array, Array, Array, Array]:
        a, b = time_s[first] + offset, time_s[last] + offset
        change = integrated(gained, b) - integrated(gained, a)
        lean = integrated(leaned, b) - integrated(leaned, a)
        return change, lean, motion.attitude(a).as_matrix(), motion.attitude(b).as_matrix(), a, b

    known = {float(offset): windows(float(offset)) for offset in np.arange(-REACH_S, REACH_S + 0.1, 0.25)}
    span = (time_s[last] - time_s[first])[:, None]

    def cost(matrix: Array, offset: float) -> float:
        change, lean, C_a, C_b, _, _ = known[offset]
        v = velocity @ matrix.T
        gap = np.einsum("nij,nj->ni", C_b, v[last]) - np.einsum("nij,nj->ni", C_a, v[first]) - change
        X = lean.reshape(-1, 3)
        bias = np.linalg.lstsq(X, gap.ravel(), rcond=None)[0]
        return float(np.median(np.linalg.norm(gap - (X @ bias).reshape(-1, 3), axis=1)))

    start, first_offset = _coarse(cost)
    turned = velocity @ start.T

    def residuals(p: Array) -> Array:
        change, lean, C_a, C_b, a, b = windows(first_offset + p[6])
        v = Rotation.from_rotvec(p[:3]).apply(turned) / (1.0 + p[7])
        v_a = v[first] - np.cross(motion.rate_p_radps(a), p[3:6])
        v_b = v[last] - np.cross(motion.rate_p_radps(b), p[3:6])
        gap = np.einsum("nij,nj->ni", C_b, v_b) - np.einsum("nij,nj->ni", C_a, v_a) - change
        level = np.concatenate([p[11:13], [0.0]])
        gap = gap + np.einsum("nij,j->ni", lean, p[8:11]) - level * span
        # In the DVL's own scale: else a larger scale would pay by shrinking the DVL's noise.
        return np.asarray((1.0 + p[7]) * gap)

    scale = np.array([0.01] * 3 + [0.1] * 3 + [0.05, 0.01] + [0.01] * 5)
    prior = np.array([1.0] * 3 + [5.0] * 3 + [2.0, 0.3] + [0.3] * 3 + [0.1] * 2)
    fit = fit_nonlinear(residuals, np.zeros(13), scale=scale, prior_sd=prior)
    rate = motion.rate_p_radps(time_s + first_offset)
    return _mounting(
        "IMU and attitude beside the log",
        fit,
        start,
        first_offset,
        rate,
        velocity[last] - velocity[first],
        aligned,
    )
