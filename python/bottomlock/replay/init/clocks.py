"""The clocks of a first case: which streams share one, and what brings the others to the IMU's."""

import numpy as np

from bottomlock.recordings.rig_fit import Recorded
from bottomlock.recordings.rig_search import search_offset
from bottomlock.recordings.streams import Inertial, Integers
from bottomlock.replay.init.dvl_part import ENOUGH_PINGS, DvlPart
from bottomlock.replay.init.found import Found
from bottomlock.replay.init.guess import Offset
from bottomlock.replay.init.imu_part import ImuPart

ENOUGH, ALMOST = 0.3, 0.6
"""Streams that overlap by the first fraction of the shorter one are taken to share a clock; by the second, where one is
moved by a time zone."""
LEAST_S = 60.0
"""Least overlap of two recordings that the motion brings together."""
Span = tuple[int, int]


def clock_offset(found: Found, imu: ImuPart, dvl: DvlPart) -> Offset:
    """The offset of a stream's clock: that of the IMU, of the DVL, another time zone, or unknown."""
    assert found.times.time_ns is not None  # chosen so
    ours, theirs = _span(imu.time_ns), _span(found.times.time_ns)
    if _overlap(ours, theirs) > ENOUGH:
        return Offset()
    if dvl.offset.seconds and _overlap((dvl.first_ns, dvl.last_ns), theirs) > ENOUGH:
        return Offset(dvl.offset.seconds, "it shares the DVL's clock", known=dvl.offset.known)
    return _by_time_zone(ours, theirs) or Offset(
        (ours[0] - theirs[0]) * 1e-9, "its clock has nothing in common with the IMU's: both are taken to begin "
        "together",
        known=False,
    )  # fmt: skip


def dvl_offset(dvl: DvlPart, imu: ImuPart) -> Offset:
    """The offset of a DVL's clock to the IMU's: none where they run together, another time zone, or by the motion."""
    ours, theirs = _span(imu.time_ns), (dvl.first_ns, dvl.last_ns)
    if _overlap(ours, theirs) > ENOUGH:
        return Offset()
    zone = _by_time_zone(ours, theirs)
    if zone is not None:
        return zone
    starts_s = (ours[0] - theirs[0]) * 1e-9
    imu_s, dvl_s = ((last - first) * 1e-9 for first, last in (ours, theirs))
    least_s = min(LEAST_S, 0.5 * min(imu_s, dvl_s))
    if len(dvl.time_ns) > ENOUGH_PINGS:
        inertial = Inertial(imu.time_ns, imu.force_p_mps2, imu.omega_p_radps)
        begun = Recorded(inertial, dvl.time_ns + round(starts_s * 1e9), dvl.velocity_p_mps)
        found = search_offset(begun, least_s - dvl_s, imu_s - least_s)
        if found is not None and found.clear:
            return Offset(
                starts_s + found.offset_s,
                f"the DVL's velocity follows the IMU's best there, {found.gain:.1f} times better than at other offsets "
                f"(next best {found.second:.1f})",
            )
    return Offset(
        starts_s,
        "the clocks have nothing in common, and the motion does not tell the offset: both files are taken to begin "
        "together",
        known=False,
    )


def _span(time_ns: Integers) -> Span:
    return int(time_ns[0]), int(time_ns[-1])


def _overlap(a: Span, b: Span) -> float:
    """Part of the shorter one that both have."""
    shorter = max(min(a[1] - a[0], b[1] - b[0]), 1)
    return (min(a[1], b[1]) - max(a[0], b[0])) / shorter


def _by_time_zone(ours: Span, theirs: Span) -> Offset | None:
    """The first half hours by which another clock overlaps; None for none."""
    for hours in np.arange(-14.0, 14.5, 0.5).tolist():
        shift = round(hours * 3600e9)
        if hours and _overlap(ours, (theirs[0] + shift, theirs[1] + shift)) > ALMOST:
            return Offset(
                shift * 1e-9, f"the files overlap when its clock is moved by {hours:g} h, a time zone"
            )
    return None
