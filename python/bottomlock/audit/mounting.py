"""Mounting of the DVL: misalignment, lever arm, scale and clock offset, from its velocity and that of a reference.

The fit is that of a replay (`recordings.rig_fit`). A parameter that the motion does not excite keeps the spread of its
wide prior and is not observable.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline, Slerp

from bottomlock.audit.logs import AXES, BeamLog, Reference
from bottomlock.audit.matrix import find_matrix
from bottomlock.audit.robust import LEAST_BLOCKS, Array
from bottomlock.io.calibrated_file import ANGLES
from bottomlock.kernel import BeamGeometry
from bottomlock.recordings.axes import from_angles, to_angles
from bottomlock.recordings.rig_fit import LOOSE, Match, Recorded
from bottomlock.recordings.rig_motion import Tracked
from bottomlock.recordings.rig_search import MIRROR, fit_anyhow

SOURCE = "velocity and attitude beside the log"
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

LEAST_EXPLAINED = 0.5
"""Nothing is observable in a log of whose velocity the reference explains a smaller fraction."""


@dataclass(frozen=True)
class Part:
    """A parameter of the mounting, and how it is told.

    Attributes:
        what, names: in words, and its components.
        value, sd: attributes of `Mounting`.
        least: smaller departures from what is stated are no finding.
        limit: with a larger standard deviation it is not observable, unless it is significant all the same.
        fault: a larger departure is a fault, a smaller one a warning.
        factor, unit, form: from SI to what is told.
        lacks: motion that shows it.
    """

    what: str
    names: tuple[str, ...]
    value: str
    sd: str
    least: float
    limit: float
    fault: float
    factor: float
    unit: str
    form: str
    lacks: str


DEG = np.rad2deg(1.0)
PARTS = {
    "misalignment": Part(
        "mounting", ANGLES, "rpy_rad", "misalignment_sd_rad", 0.05 / DEG, 1.0 / DEG, 1.0 / DEG, DEG, "deg", "+.2f",
        "speed across these axes",
    ),
    "lever_arm": Part(
        "lever arm", AXES, "lever_arm_p_m", "lever_arm_sd_m", 0.02, 0.3, np.inf, 1.0, "m", "+.2f", "rotations"
    ),
    "clock_offset": Part(
        "clock offset (reference less DVL)", ("",), "clock_offset_s", "clock_offset_sd_s", 0.02, 0.1, 0.0, 1.0, "s",
        "+.3f", "speed changes",
    ),
    "velocity_scale": Part("scale", ("",), "scale", "scale_sd", 0.002, 0.02, np.inf, 100.0, "%", "+.2f", "speed"),
}  # fmt: skip
"""By the kind of their findings."""


def platform_rows(geometry: BeamGeometry) -> Array:
    """(beams, 3) directions times scale, platform frame."""
    return geometry.sound_speed_scale * np.asarray(geometry.directions_p)


def rows_as_stated(geometry: BeamGeometry, rpy_rad: Array, log: BeamLog) -> tuple[Array, Array]:
    """Stated rows (beams, 3) in the frame of the instrument's velocity, and the roll, pitch, yaw (3,) of that frame.

    An instrument may give its velocity in its own axes, or rotate it to the platform's by a mounting that it has been
    told: the frame is taken in which its own solution has the stated beams.

    Args:
        geometry: in the platform frame.
        rpy_rad: (3,) the mounting that it contains.
        log: the pings.
    """
    in_platform = platform_rows(geometry)
    in_own = from_angles(*rpy_rad).inv().apply(in_platform)
    if not rpy_rad.any() or log.instrument_mps is None or not log.own_frame or log.beams < 3:
        return in_own, rpy_rad
    pings = log.full & log.solved
    found = find_matrix(log.velocity_mps[pings], log.instrument_mps[pings])
    if found is None or not found.observable.all():
        return in_own, rpy_rad
    off = [float(np.linalg.norm(found.rows - rows)) for rows in (in_own, in_platform)]
    return (in_own, rpy_rad) if off[0] <= off[1] else (in_platform, np.zeros(3))


@dataclass(frozen=True, eq=False)
class Mounting:
    """Mounting parameters of the DVL with their standard deviations.

    Attributes:
        rpy_rad: (3,) roll, pitch, yaw from DVL axes to platform axes.
        misalignment_sd_rad: (3,) about the platform's x, y, z.
        lever_arm_p_m, lever_arm_sd_m: (3,) from the reference's point to the DVL.
        clock_offset_s, clock_offset_sd_s: reference time minus DVL time of the same instant.
        scale, scale_sd: the DVL reads (1 + scale) times the velocity.
        mirrored: the DVL's velocity fits only with its y axis reversed: the frame is left-handed.
        residual_mps: (3,) robust sigma per axis.
        explained: fraction of the mean square of the velocity that the fit explains, 0 to 1.
        instants: number of pings.
        blocks: number of independent blocks behind the standard deviations.
        rate_rms_radps: (3,) RMS angular rate of the platform.
    """

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

    def told(self, part: Part) -> tuple[Array, Array]:
        """A parameter and its 1 sigma, (k,) each."""
        return np.atleast_1d(getattr(self, part.value)), np.atleast_1d(getattr(self, part.sd))

    def knows(self, kind: str) -> bool:
        """The parameter of `PARTS` is observable, the velocity followed and of a right-handed frame."""
        usable = self.follows and not self.mirrored
        return usable and bool((self.told(PARTS[kind])[1] < PARTS[kind].limit).all())

    @property
    def follows(self) -> bool:
        """The reference explains enough of the velocity for the parameters to be observable."""
        return self.explained > LEAST_EXPLAINED and abs(self.scale) < 0.2


def find_mounting(time_ns: NDArray[np.int64], velocity_d_mps: Array, reference: Reference) -> Mounting | None:
    """Estimates misalignment, lever arm, clock offset and scale of the instrument's velocity (n, 3) at times (n,), ns.

    Returns None where the recordings overlap by fewer than 50 pings.
    """
    motion, reach_ns = tracked(reference), round((REACH_S + 0.5) * 1e9)
    inside = (time_ns >= motion.time_ns[0] + reach_ns) & (time_ns <= motion.time_ns[-1] - reach_ns)
    if inside.sum() < LEAST_PINGS:
        return None
    recorded = Recorded(motion, time_ns[inside], velocity_d_mps[inside])
    match = fit_anyhow(recorded, np.arange(-REACH_S, REACH_S + 0.1, 0.25), WIDE, around=True)
    return None if match is None else _mounting(match)


def tracked(reference: Reference) -> Tracked:
    """The motion of a reference at even times."""
    time_s, attitudes = (reference.time_ns - reference.time_ns[0]) * 1e-9, reference.attitude
    usual_s = float(np.median(np.diff(time_s)))
    at_s = np.arange(0.0, time_s[-1], min(STEP_S, usual_s))
    between = RotationSpline(time_s, attitudes) if usual_s > SLOW_S else Slerp(time_s, attitudes)
    return Tracked(
        reference.time_ns[0] + np.round(at_s * 1e9).astype(np.int64), between(at_s).as_matrix(),
        CubicSpline(time_s, reference.velocity_t_mps)(at_s), float(np.clip(usual_s, *CHANGE_S)),
    )  # fmt: skip


def _mounting(match: Match) -> Mounting:
    turn_sd, arm_sd, clock_sd, scale_sd = (
        match.part_sd(name) if match.blocks >= LEAST_BLOCKS else np.full(3, np.inf)
        for name in ("rotation", "lever", "clock", "scale")
    )
    clock_s, scale = float(match.part("clock")[0]), float(match.part("scale")[0])
    mirrored = bool(np.linalg.det(match.turned) < 0.0)
    rotation = Rotation.from_matrix(match.turned @ MIRROR if mirrored else match.turned)
    return Mounting(
        rpy_rad=to_angles(rotation),
        misalignment_sd_rad=turn_sd,
        lever_arm_p_m=match.part("lever"),
        lever_arm_sd_m=arm_sd,
        clock_offset_s=clock_s,
        clock_offset_sd_s=float(clock_sd[0]) if abs(clock_s) <= REACH_S else np.inf,
        # The fit's factor is that of the velocity, the audit's that of the motion.
        scale=1.0 / (1.0 + scale) - 1.0,
        scale_sd=float(scale_sd[0]) / (1.0 + scale) ** 2,
        mirrored=mirrored,
        residual_mps=match.residual_mps,
        explained=float(np.clip(match.explained, 0.0, 1.0)),
        instants=match.pings,
        blocks=match.blocks,
        rate_rms_radps=match.rate_rms_radps,
    )
