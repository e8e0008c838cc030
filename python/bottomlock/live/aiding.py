"""Measurements beside pings and attitudes, as the navigator takes them."""

from collections.abc import Sequence

import numpy as np

from bottomlock import units
from bottomlock.kernel import Navigator, Report
from bottomlock.live.navigator_config import NavigatorConfig
from bottomlock.live.sections import OriginSection
from bottomlock.recordings.geodesy import Place, tangent_from_geodetic
from bottomlock.recordings.readings import (
    AcousticPositionReading,
    AidingReading,
    DepthReading,
    EffortReading,
    GpsReading,
    ThrustReading,
    WaterReading,
)


def push(
    navigator: Navigator, config: NavigatorConfig, time_ns: int, reading: AidingReading
) -> Sequence[Report]:
    """The navigator's reports of a measurement; none where the configuration has no section for it.

    Raises:
        KernelError: for one that is older than the horizon.
    """
    if isinstance(reading, DepthReading) and config.depth is not None:
        return navigator.push_depth(time_ns, reading.depth_m, sd_m=config.depth.sd_m)
    if isinstance(reading, GpsReading) and config.gps is not None:
        assert config.origin is not None  # validated
        position_t_m = _tangent(reading, config.origin)
        return navigator.push_position(time_ns, position_t_m, position_sd_m=config.gps.position_sd_m)
    if isinstance(reading, AcousticPositionReading) and config.acoustic_position is not None:
        return navigator.push_acoustic_position(
            time_ns=time_ns, position_t_m=reading.position_t_m, sd_m=reading.sd_m
        )
    if isinstance(reading, ThrustReading) and config.thrust is not None:
        return navigator.push_thrust(time_ns, reading.revolutions_hz, sd_mps=config.thrust.noise_mps)
    if isinstance(reading, EffortReading) and config.effort is not None:
        return navigator.push_effort(time_ns, reading.force_p_n, sd_n=config.effort.noise_n)
    if isinstance(reading, WaterReading) and config.water_track is not None:
        return navigator.push_water_track(
            time_ns, reading.velocity_mps, reading.valid, sd_mps=reading.sd_mps, range_m=reading.range_m
        )
    return ()


def _tangent(reading: GpsReading, origin: OriginSection) -> np.ndarray:
    """(3,) north, east, down from the origin, m."""
    assert origin.longitude_deg is not None  # validated
    home = Place(
        units.rad_from_deg(origin.latitude_deg), units.rad_from_deg(origin.longitude_deg), origin.height_m
    )
    latitude, longitude = units.rad_from_deg(reading.latitude_deg), units.rad_from_deg(reading.longitude_deg)
    return tangent_from_geodetic(latitude, longitude, reading.height_m, home)
