"""The prior of the velocity in a first case of a vehicle whose accelerometers say less than its habits."""

import numpy as np

from bottomlock.errors import DataError
from bottomlock.replay.init.parts import Parts
from bottomlock.replay.init.text import Section
from bottomlock.replay.vehicle_motion import vehicle_motion

OUTAGE_S = 60.0
"""Time without the bottom over which the accelerometers are compared with the vehicle."""


def motion_section(parts: Parts) -> list[Section]:
    """`[filter.motion]` where the accelerometers drift further in a minute than the vehicle changes its velocity.

    Without inertial readings a replay measures the same by itself.
    """
    if parts.imu.made or parts.pings is None:
        return []
    drift_mps = parts.pings.force_mps_rts * np.sqrt(OUTAGE_S)
    try:
        motion = vehicle_motion(parts.dvl.time_ns, parts.dvl.velocity_p_mps)
    except DataError:
        return []
    change_mps = float(np.sqrt((motion.fluctuation_sd_mps**2).sum()))
    if drift_mps <= change_mps:
        return []
    section = Section("filter.motion")
    section.say(
        f"the accelerometers drift by {drift_mps:.2g} m/s in a minute, the vehicle changes its velocity by "
        f"{change_mps:.2g} m/s: without the bottom the velocity goes back to its mean (docs/no_imu.md)"
    )
    prior = motion.prior
    section.put("mean_sd_mps", rounded(prior.mean_sd_mps), "the size of the speed")
    section.put(
        "change_sd_mps", rounded(prior.change_sd_mps), f"on {motion.pings} pings with a whole velocity"
    )
    section.put("change_time_s", rounded(prior.change_time_s))
    return [section]


def rounded(values: object) -> list[float]:
    """Two digits."""
    return [float(f"{value:.2g}") for value in np.asarray(values, dtype=np.float64)]
