"""Mounting of the DVL: misalignment, lever arm, scale and clock offset, from its velocity and other recordings.

The fit is that of a replay (`recordings.rig_fit`), against the reference's velocity where there is one, else against
the IMU. A parameter that the motion does not excite keeps the spread of its wide prior and is not observable.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline, Slerp

from bottomlock.audit.imu_alignment import ImuAlignment, align_imu
from bottomlock.audit.logs import Reference
from bottomlock.audit.robust import LEAST_BLOCKS, Array
from bottomlock.recordings.rig_fit import LOOSE, PARTS, Match, Recorded
from bottomlock.recordings.rig_search import MIRROR, fit_anyhow
from bottomlock.recordings.rig_tracked import Tracked
from bottomlock.recordings.streams import Inertial

BY_VELOCITY, BY_IMU = "velocity and attitude beside the log", "IMU and attitude beside the log"
"""Sources of a mounting."""
REACH_S = 3.0
"""Clock offsets are searched within ± this."""
LEAST_PINGS = 50
SLOW_S, STEP_S = 0.3, 0.1
"""Attitude at longer steps is interpolated by a smooth spline, at shorter ones by shortest arcs; to this step."""
CHANGE_S = (0.5, 1.0)
"""A velocity's change is taken over a sample on either side, within these: one of 2 mm/s noise has then a noise of
3 mm/s², less than the acceleration of a slow vehicle."""
WIDE = LOOSE | {"clock": 2.0, "lever": 5.0}
"""1 sigma of every parameter beforehand."""

LIMITS = {"misalignment_rad": np.deg2rad(1.0), "lever_arm_m": 0.3, "clock_offset_s": 0.1, "scale": 0.02}
"""A parameter with a larger standard deviation is not observable; a lever arm or scale may be significant beyond it."""
LEAST_EXPLAINED = 0.5
"""Nothing is observable in a log of whose velocity the other recordings explain a smaller fraction."""
GAIN_SD = 0.05
"""... or of whose changes, often noise for the most part, the response to the IMU is less certain; it is 1 for the same
motion, 0 for another."""


@dataclass(frozen=True, eq=False)
class Mounting:
    """Mounting parameters of the DVL with their standard deviations.

    Attributes:
        source: recordings that it was estimated from.
        rpy_rad: (3,) roll, pitch, yaw from DVL axes to platform axes.
        misalignment_sd_rad: (3,) about the platform's x, y, z.
        lever_arm_p_m, lever_arm_sd_m: (3,) from the reference's point to the DVL.
        clock_offset_s, clock_offset_sd_s: reference time minus DVL time of the same instant.
        scale, scale_sd: the DVL reads (1 + scale) times the velocity.
        mirrored: the DVL's velocity fits only with its y axis reversed: the frame is left-handed.
        residual_mps: (3,) robust sigma per axis.
        explained: fraction of the mean square of the velocity (or of its changes) that the fit explains, 0 to 1.
        instants: number of pings or windows.
        blocks: number of independent blocks behind the standard deviations.
        rate_rms_radps: (3,) RMS angular rate of the platform.
        imu: alignment of the IMU with the attitude, or None.
    """

    source: str
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
    blocks: int
    rate_rms_radps: Array
    imu: ImuAlignment | None = None

    @property
    def of_changes(self) -> bool:
        """From changes of the velocity against the IMU, else from the velocity itself."""
        return self.source == BY_IMU

    @property
    def follows(self) -> bool:
        """The other recordings explain enough of the velocity for the parameters to be observable."""
        certain = self.scale_sd < GAIN_SD if self.of_changes else self.explained > LEAST_EXPLAINED
        return certain and abs(self.scale) < 0.2


def find_mounting(
    time_ns: NDArray[np.int64], velocity_d_mps: Array, reference: Reference, imu: Inertial | None
) -> Mounting | None:
    """Estimates misalignment, lever arm, clock offset and scale of the instrument's velocity (n, 3) at times (n,), ns.

    Uses the reference's velocity where there is one, otherwise the IMU. Returns None without either, or where the
    recordings overlap by fewer than 50 pings.
    """
    aligned = None if imu is None else align_imu(reference, imu)
    motion: Inertial | Tracked | None = tracked(reference)
    offset_s = 0.0
    if motion is None:
        # Only an IMU whose axes agree with those of the attitude.
        usable = aligned is None or np.abs(aligned.matrix - np.eye(3)).max() < 0.2
        motion = imu if usable else None
        offset_s = 0.0 if aligned is None else aligned.offset_s
    if motion is None:
        return None
    reach_ns, stamps = round((REACH_S + 0.5) * 1e9), motion.time_ns - round(offset_s * 1e9)
    inside = (time_ns >= stamps[0] + reach_ns) & (time_ns <= stamps[-1] - reach_ns)
    if inside.sum() < LEAST_PINGS:
        return None
    recorded = Recorded(motion, time_ns[inside], velocity_d_mps[inside])
    offsets_s = offset_s + np.arange(-REACH_S, REACH_S + 0.1, 0.25)
    match = fit_anyhow(recorded, offsets_s, WIDE, around=True)
    return None if match is None else _mounting(match, offset_s, aligned, of_imu=isinstance(motion, Inertial))


def tracked(reference: Reference) -> Tracked | None:
    """The motion of a reference at even times; None for one without a velocity."""
    if reference.velocity_t_mps is None:
        return None
    time_s = np.asarray((reference.time_ns - reference.time_ns[0]) * 1e-9)
    attitudes = Rotation.from_euler("ZYX", reference.rpy_rad[:, ::-1])
    usual_s = float(np.median(np.diff(time_s)))
    at_s = np.arange(0.0, time_s[-1], min(STEP_S, usual_s))
    between = RotationSpline(time_s, attitudes) if usual_s > SLOW_S else Slerp(time_s, attitudes)
    return Tracked(
        reference.time_ns[0] + np.round(at_s * 1e9).astype(np.int64), between(at_s).as_matrix(),
        CubicSpline(time_s, reference.velocity_t_mps)(at_s), float(np.clip(usual_s, *CHANGE_S)),
    )  # fmt: skip


def _mounting(match: Match, offset_s: float, aligned: ImuAlignment | None, *, of_imu: bool) -> Mounting:
    sd = match.sd if match.blocks >= LEAST_BLOCKS else np.full(len(match.sd), np.inf)
    clock_s, scale = float(match.part("clock")[0]) - offset_s, float(match.part("scale")[0])
    mirrored = bool(np.linalg.det(match.turned) < 0.0)
    rotation = Rotation.from_matrix(match.turned @ MIRROR if mirrored else match.turned)
    return Mounting(
        source=BY_IMU if of_imu else BY_VELOCITY,
        rpy_rad=rotation.as_euler("ZYX")[::-1],
        misalignment_sd_rad=sd[PARTS["rotation"]],
        lever_arm_p_m=match.part("lever"),
        lever_arm_sd_m=sd[PARTS["lever"]],
        clock_offset_s=clock_s,
        clock_offset_sd_s=float(sd[PARTS["clock"]][0]) if abs(clock_s) <= REACH_S else np.inf,
        # The fit's factor is that of the velocity, the audit's that of the motion.
        scale=1.0 / (1.0 + scale) - 1.0,
        scale_sd=float(sd[PARTS["scale"]][0]) / (1.0 + scale) ** 2,
        mirrored=mirrored,
        residual_mps=match.residual_mps,
        explained=float(np.clip(match.explained, 0.0, 1.0)),
        instants=match.pings,
        blocks=match.blocks,
        rate_rms_radps=match.rate_rms_radps,
        imu=aligned,
    )
