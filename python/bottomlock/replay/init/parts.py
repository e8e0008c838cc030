"""The streams that a first case uses."""

from dataclasses import dataclass

from bottomlock.replay.init.dvl_part import DvlPart
from bottomlock.replay.init.found import Found
from bottomlock.replay.init.imu_part import ImuPart
from bottomlock.replay.init.other_parts import AttitudePart, DepthPart


@dataclass(eq=False)
class Parts:
    """The streams that a case uses."""

    imu: ImuPart
    dvl: DvlPart
    attitude: AttitudePart | None
    depth: DepthPart | None
    gps: Found | None
    reference: Found | None
    unused: list[Found]
