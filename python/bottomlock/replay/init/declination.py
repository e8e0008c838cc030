"""Declination at the place and time of a first case, by the World Magnetic Model where its package is installed."""

import math
from dataclasses import replace

from bottomlock.errors import ScenarioError
from bottomlock.plant.surroundings import world_magnetic_model
from bottomlock.replay.init.other_parts import AttitudePart
from bottomlock.replay.init.positions import PositionPart
from bottomlock.replay.motion.mounting_yaw import MountingYaw

YEAR_S = 365.2425 * 86_400.0
CLEAR = 9.0
"""Difference of the squares of two departures in sigmas from which a yaw is taken to be true."""


def set_declination(attitude: AttitudePart | None, positions: PositionPart | None) -> None:
    """Adds the declination to the yaw of an attitude, which the case asks about; or notes why it is not known.

    Args:
        attitude: as guessed; its yaw is taken to be magnetic.
        positions: any recorded positions, for the place.
    """
    if attitude is None:
        return
    times = attitude.found.times
    if (
        positions is None
        or not math.isfinite(positions.latitude_rad)
        or not times.epoch
        or times.time_ns is None
    ):
        attitude.declination_why = "is the yaw magnetic? Then yaw_offset_deg is the declination"
        return
    year = 1970.0 + float(times.time_ns[0]) * 1e-9 / YEAR_S
    try:
        field = world_magnetic_model(positions.latitude_rad, positions.longitude_rad, year)
    except ScenarioError as error:
        reason = str(error).removeprefix("magnetometer: ")
        attitude.declination_why = (
            f"is the yaw magnetic? Then yaw_offset_deg is the declination. Not found: {reason}"
        )
        return
    attitude.declination_rad = field.declination_rad
    attitude.declination_why = f"declination of {year:.1f} (World Magnetic Model); 0 where the yaw is true"


def without_declination(attitude: AttitudePart, track: MountingYaw) -> MountingYaw:
    """The track's yaw with the declination taken back, where the track follows positions far better without it.

    A DVL mounted at the very angle of the declination cannot be told from it; the case says what was decided.

    Args:
        attitude: its yaw is taken to be true then.
        track: yaw of the DVL's track with the declination.
    """
    before = replace(track, yaw_rad=track.yaw_rad + attitude.declination_rad)
    if (track.yaw_rad / track.sd_rad) ** 2 - (before.yaw_rad / track.sd_rad) ** 2 < CLEAR:
        return track
    declination_deg = math.degrees(attitude.declination_rad)
    attitude.declination_rad = 0.0
    attitude.declination_why = (
        f"is the yaw true? The track follows the positions without the declination of {declination_deg:+.1f} deg, "
        "which yaw_offset_deg would add"
    )
    return before
