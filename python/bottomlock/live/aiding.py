"""Measurements beside pings and attitudes, as the navigator takes them: a function for each kind of reading."""

from typing import Any

import numpy as np

from bottomlock import units
from bottomlock.geodesy import Place, tangent_from_geodetic
from bottomlock.kernel import Navigator
from bottomlock.live.config import LiveConfig
from bottomlock.live.readings import AcousticPositionReading, AidingReading, DepthReading, GpsReading


def push(navigator: Navigator, config: LiveConfig, time_ns: int, reading: AidingReading) -> list[Any]:
    """The navigator's reports of a measurement; none where the configuration has no section for it.

    Raises:
        KernelError: for one that is older than the horizon.
    """
    if isinstance(reading, DepthReading):
        return [] if config.depth is None else _depth(navigator, config, time_ns, reading)
    if isinstance(reading, GpsReading):
        return [] if config.gps is None else _gps(navigator, config, time_ns, reading)
    return [] if config.acoustic_position is None else _acoustic_position(navigator, time_ns, reading)


def _depth(navigator: Navigator, config: LiveConfig, time_ns: int, reading: DepthReading) -> list[Any]:
    assert config.depth is not None
    return [*navigator.push_depth(time_ns, reading.depth_m, sd_m=config.depth.sd_m)]


def _gps(navigator: Navigator, config: LiveConfig, time_ns: int, reading: GpsReading) -> list[Any]:
    assert config.gps is not None
    position_t_m = tangent_from_geodetic(
        units.rad_from_deg(reading.latitude_deg),
        units.rad_from_deg(reading.longitude_deg),
        reading.height_m,
        _place(config),
    )
    sd_m = config.gps.position_sd_m
    return [*navigator.push_position(time_ns, np.ravel(position_t_m), position_sd_m=sd_m)]


def _place(config: LiveConfig) -> Place:
    """The origin of the tangent frame."""
    origin = config.origin
    assert origin is not None  # validated in LiveConfig
    assert origin.longitude_deg is not None
    return Place(
        units.rad_from_deg(origin.latitude_deg), units.rad_from_deg(origin.longitude_deg), origin.height_m
    )


def _acoustic_position(navigator: Navigator, time_ns: int, reading: AcousticPositionReading) -> list[Any]:
    return [
        *navigator.push_acoustic_position(
            time_ns=time_ns, position_t_m=reading.position_t_m, sd_m=reading.sd_m
        )
    ]
