"""The streams that a first case uses."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

from bottomlock.replay.init.dvl_part import DvlPart
from bottomlock.replay.init.found import Found
from bottomlock.replay.init.imu_part import ImuPart
from bottomlock.replay.init.other_parts import AttitudePart, DepthPart
from bottomlock.replay.init.positions import PositionPart
from bottomlock.replay.motion.gyros import GyroMatch
from bottomlock.replay.motion.ping_noise import PingNoise


@dataclass(frozen=True, eq=False)
class Parts:
    """The streams that a case uses, and what they say of one another.

    Attributes:
        imu, dvl, attitude, depth, gps, reference: as guessed, None where absent.
        unused: streams of the files that the case does not name.
        gyros: the gyros against the attitude; None without one.
        pings: the velocity against the accelerometers; None with too few pings.
    """

    imu: ImuPart
    dvl: DvlPart
    attitude: AttitudePart | None
    depth: DepthPart | None
    gps: PositionPart | None
    reference: PositionPart | None
    unused: Sequence[Found] = ()
    gyros: GyroMatch | None = None
    pings: PingNoise | None = None

    @property
    def latitude_rad(self) -> float:
        """Latitude of the first recorded position; NaN without one on the Earth."""
        known = [one.latitude_rad for one in (self.reference, self.gps) if one is not None]
        return next((latitude for latitude in known if isfinite(latitude)), float("nan"))

    @property
    def attitude_of_reference(self) -> bool:
        """Whether the attitude is that of the reference, which must not aid what it judges."""
        return (
            self.attitude is not None
            and self.reference is not None
            and self.attitude.found.table is self.reference.found.table
        )
