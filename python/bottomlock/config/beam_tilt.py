"""The tilt of beams in degrees, as settings files give it."""

from collections.abc import Sequence
from typing import Annotated

from pydantic import AfterValidator, Field

LEAST_TILT_DEG = 2.0
"""Least tilt of the most tilted beam of a DVL; any tilt in radians is less."""


def _not_in_radians(tilt_deg: float) -> float:
    if tilt_deg < LEAST_TILT_DEG:
        raise ValueError(
            f"the beams are tilted by {tilt_deg:g} deg at most, expected {LEAST_TILT_DEG:g} deg or more: "
            "is it in radians?"
        )
    return tilt_deg


def check_tilts(tilts_deg: Sequence[float]) -> None:
    """Rejects three or more beams of which none is tilted enough to be that of a DVL.

    Raises:
        ValueError: naming the greatest tilt and the likely mistake.
    """
    if len(tilts_deg) >= 3:
        _not_in_radians(max(abs(tilt) for tilt in tilts_deg))


BeamTilt = Annotated[float, Field(gt=0, lt=90), AfterValidator(_not_in_radians)]
"""The tilt of every beam of a Janus configuration."""
