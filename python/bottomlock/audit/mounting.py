"""Mounting of the DVL: misalignment, lever arm, scale and clock offset, from its velocity and that of a reference.

The fit is that of a replay (`recordings.rig_fit`). A parameter that the motion does not excite keeps the spread of its
wide prior and is not observable.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bottomlock.audit.logs import AXES, Array
from bottomlock.audit.robust import LEAST_BLOCKS
from bottomlock.io.calibrated_file import ANGLES
from bottomlock.recordings.axes import to_angles
from bottomlock.recordings.rig_fit import LOOSE, Recorded
from bottomlock.recordings.rig_motion import Tracked
from bottomlock.recordings.rig_search import MIRROR, fit_anyhow

SOURCE = "velocity and attitude beside the log"
REACH_S = 3.0
"""Clock offsets are searched within ± this."""
LEAST_PINGS = 50
WIDE = LOOSE | {"clock": 2.0, "lever": 5.0}
"""1 sigma of every parameter beforehand."""

LEAST_EXPLAINED = 0.5
"""Nothing is observable in a log of whose velocity the reference explains a smaller fraction."""


@dataclass(frozen=True)
class Part:
    """A parameter of the mounting, and how it is told.

    Attributes:
        what, names: in words, and its components.
        least: smaller departures from what is stated are no finding.
        limit: with a larger standard deviation it is not observable, unless it is significant all the same.
        fault: a larger departure is a fault, a smaller one a warning.
        factor, unit, form: from SI to what is told.
        lacks: motion that shows it.
    """

    what: str
    names: tuple[str, ...]
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
        "mounting", ANGLES, 0.05 / DEG, 1.0 / DEG, 1.0 / DEG, DEG, "deg", "+.2f",
        "speed across these axes",
    ),
    "lever_arm": Part(
        "lever arm", AXES, 0.02, 0.3, np.inf, 1.0, "m", "+.2f", "rotations"
    ),
    "clock_offset": Part(
        "clock offset (reference less DVL)", ("",), 0.02, 0.1, 0.0, 1.0, "s",
        "+.3f", "speed changes",
    ),
    "velocity_scale": Part("scale", ("",), 0.002, 0.02, np.inf, 100.0, "%", "+.2f", "speed"),
}  # fmt: skip
"""By the kind of their findings."""


@dataclass(frozen=True, eq=False)
class Mounting:
    """Mounting parameters of the DVL and their 1 sigma, (k,) for each kind of `PARTS`.

    Attributes:
        values: roll, pitch, yaw from DVL axes to platform axes, rad; from the reference's point to the DVL, m;
            reference time minus DVL time of the same instant, s; what the DVL reads too much, relative.
        sds: of these; of the angles about the platform's x, y, z.
        mirrored: the DVL's velocity fits only with its y axis reversed: the frame is left-handed.
        residual_mps: (3,) robust sigma per axis.
        explained: fraction of the mean square of the velocity that the fit explains, 0 to 1.
        instants: number of pings.
        blocks: number of independent blocks behind the standard deviations.
        rate_rms_radps: (3,) RMS angular rate of the platform.
    """

    values: Mapping[str, Array]
    sds: Mapping[str, Array]
    mirrored: bool
    residual_mps: Array
    explained: float
    instants: int
    blocks: int
    rate_rms_radps: Array

    def knows(self, kind: str) -> bool:
        """The parameter of `PARTS` is observable, the velocity followed and of a right-handed frame."""
        usable = self.follows and not self.mirrored
        return usable and bool((self.sds[kind] < PARTS[kind].limit).all())

    @property
    def follows(self) -> bool:
        """The reference explains enough of the velocity for the parameters to be observable."""
        return self.explained > LEAST_EXPLAINED and bool(abs(self.values["velocity_scale"][0]) < 0.2)


def find_mounting(time_ns: NDArray[np.int64], velocity_d_mps: Array, motion: Tracked) -> Mounting | None:
    """Estimates misalignment, lever arm, clock offset and scale of the instrument's velocity (n, 3) at times (n,), ns.

    Returns None where the recordings overlap by fewer than 50 pings.
    """
    reach_ns = round((REACH_S + 0.5) * 1e9)
    inside = (time_ns >= motion.time_ns[0] + reach_ns) & (time_ns <= motion.time_ns[-1] - reach_ns)
    if inside.sum() < LEAST_PINGS:
        return None
    recorded = Recorded(motion, time_ns[inside], velocity_d_mps[inside])
    match = fit_anyhow(recorded, np.arange(-REACH_S, REACH_S + 0.1, 0.25), WIDE, around=True)
    if match is None:
        return None
    names = dict(zip(PARTS, ("rotation", "lever", "clock", "scale"), strict=True))
    values, sds = ({kind: of(name) for kind, name in names.items()} for of in (match.part, match.part_sd))
    mirrored, factor = bool(np.linalg.det(match.turned) < 0.0), 1.0 + values["velocity_scale"]
    values["misalignment"] = to_angles(
        Rotation.from_matrix(match.turned @ MIRROR if mirrored else match.turned)
    )
    # The fit's factor is that of the velocity, the audit's that of the motion.
    values["velocity_scale"], sds["velocity_scale"] = 1.0 / factor - 1.0, sds["velocity_scale"] / factor**2
    if match.blocks < LEAST_BLOCKS:
        sds = {kind: np.full(len(sd), np.inf) for kind, sd in sds.items()}
    if abs(values["clock_offset"][0]) > REACH_S:
        sds["clock_offset"] = np.array([np.inf])
    explained = float(np.clip(match.explained, 0.0, 1.0))
    return Mounting(
        values, sds, mirrored, match.residual_mps, explained, match.pings, match.blocks, match.rate_rms_radps
    )
