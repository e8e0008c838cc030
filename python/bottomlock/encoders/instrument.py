"""What an encoder knows of the instrument beside its pings."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Instrument:
    """The instrument whose records are written.

    Attributes:
        tilt_rad: mean tilt of its beams from the vertical.
        start_ns: when it was switched on, for the formats whose clock counts from there; ns on the pings' clock.
    """

    tilt_rad: float
    start_ns: int = 0
