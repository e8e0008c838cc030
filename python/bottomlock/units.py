"""Human units of the TOML files to SI; one name per unit, no default."""

import math

STANDARD_GRAVITY_MPS2 = 9.80665
DEGREES_PER_RADIAN = 180.0 / math.pi
_SECONDS_PER_HOUR = 3600.0


def rad_from_deg(angle_deg: float) -> float:
    """Degrees to radians.

    >>> round(rad_from_deg(180.0), 6)
    3.141593
    """
    return math.radians(angle_deg)


def radps_from_deg_per_h(rate_deg_per_h: float) -> float:
    """Degrees per hour to rad/s."""
    return math.radians(rate_deg_per_h) / _SECONDS_PER_HOUR


def mps2_from_mg(acceleration_mg: float) -> float:
    """Milli-g to m/s² (standard gravity).

    >>> mps2_from_mg(1000.0)
    9.80665
    """
    return acceleration_mg * 1e-3 * STANDARD_GRAVITY_MPS2


def per_rt_s_from_per_rt_h(density: float) -> float:
    """A random walk per root hour to one per root second.

    >>> per_rt_s_from_per_rt_h(0.072)
    0.0012
    """
    return density / math.sqrt(_SECONDS_PER_HOUR)


def per_rt_h_from_per_rt_s(density: float) -> float:
    """A random walk per root second to one per root hour.

    >>> per_rt_h_from_per_rt_s(0.0012)
    0.072
    """
    return density * math.sqrt(_SECONDS_PER_HOUR)


def fraction_from_percent(part_percent: float) -> float:
    """Percent to a plain fraction."""
    return part_percent * 1e-2


def ns_from_s(time_s: float) -> int:
    """Seconds to integer nanoseconds, rounded.

    >>> ns_from_s(1.9e-9), ns_from_s(-1.9e-9)
    (2, -2)
    """
    return round(time_s * 1e9)
