"""A first case of a vehicle without inertial readings: they are made from its attitude."""

import numpy as np

from bottomlock.errors import DataError
from bottomlock.recordings.attitude_motion import inertial_readings
from bottomlock.recordings.axes import from_angles
from bottomlock.replay.init.dvl_part import DvlPart
from bottomlock.replay.init.found import Found
from bottomlock.replay.init.guess import Guess
from bottomlock.replay.init.imu_part import ImuPart
from bottomlock.replay.init.other_parts import angles_of
from bottomlock.replay.motion.ping_noise import PingNoise
from bottomlock.replay.vehicle_motion import vehicle_motion
from bottomlock.support.rising import rising

FEWEST = 50
"""Attitudes that make a motion."""


def imu_of_attitude(attitudes: list[Found]) -> ImuPart | None:
    """Turns of the attitude with the most rows, in place of an IMU for the guesses of other streams; None for too few.

    The frames of the angles are taken to be north-east-down and forward-starboard-down: there are no gyros that tell.
    """
    if not attitudes:
        return None
    found = max(attitudes, key=lambda one: one.table.frame.height)
    times = found.times.time_ns
    assert times is not None  # the caller's choice
    rpy, _ = angles_of(found)
    rows = np.flatnonzero(np.isfinite(rpy).all(axis=1) & rising(times))
    if len(rows) < FEWEST:
        return None
    time_ns, attitude = times[rows], from_angles(*rpy[rows].T)
    still = np.zeros((len(rows), 3))
    readings = inertial_readings(time_ns, attitude, still, latitude_rad=0.0)
    return ImuPart(
        found=found, time_ns=time_ns, rows=rows, force_s_mps2=still, omega_s_radps=readings.omega_p_radps,
        force=Guess("m/s2", ""), omega=Guess("rad/s", ""), increments=False, axes=np.eye(3), axes_why="",
        axes_known=True, rate_hz=1e9 / float(np.median(np.diff(time_ns))), made=True,
    )  # fmt: skip


def noise_of_pings(dvl: DvlPart) -> PingNoise | None:
    """Noise of a velocity by its changes alone, those of the vehicle left out; None for too few pings."""
    try:
        motion = vehicle_motion(dvl.time_ns, dvl.velocity_p_mps)
    except DataError:
        return None
    return PingNoise(motion.white_sd_mps, 0.0, motion.pings)
