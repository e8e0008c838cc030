"""The beams of a DVL as a scenario and a geometry file state them."""

from typing import Annotated, Any, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from bottomlock import units
from bottomlock.config.section import Mounting, Section, Vector, shown
from bottomlock.kernel import BeamGeometry, Configuration, KernelError
from bottomlock.kernel.models import Positive, Real

LEAST_TILT_DEG = 2.0
"""Least tilt of the most tilted beam of a DVL; any tilt in radians is less."""


def _not_in_radians(tilt_deg: float) -> float:
    if tilt_deg < LEAST_TILT_DEG:
        raise ValueError(
            f"the beams are tilted by {tilt_deg:g} deg at most, expected {LEAST_TILT_DEG:g} deg or more: "
            "is it in radians?"
        )
    return tilt_deg


BeamTilt = Annotated[Real, Field(gt=0, lt=90), AfterValidator(_not_in_radians)]
"""The tilt of every beam of a Janus configuration."""


class BeamDirections(Section):
    """Directions and places of the beams, in the instrument's axes."""

    configuration: Configuration = "x"
    """beams in an x (azimuths 45, 135, 225, 315 deg), in a + (0, 90, 180, 270), by angles, or by directions"""
    tilt_deg: Annotated[BeamTilt | None, shown(range="≥ 2.0, < 90.0", example=20.0)] = None
    """tilt of every beam from the vertical; needed for x and +"""
    tilts_deg: Annotated[
        tuple[Annotated[Real, Field(gt=-90, lt=90)], ...] | None,
        shown(example=[22.5, 22.5, 22.5, 22.5]),
    ] = None
    """tilt of each beam; needed for angles"""
    azimuths_deg: Annotated[
        tuple[Annotated[Real, Field(ge=-360, le=360)], ...] | None,
        shown(example=[135.0, -135.0, -45.0, 45.0]),
    ] = None
    """azimuth of each beam from forward to starboard; needed for angles"""
    directions: Annotated[
        tuple[Vector, ...] | None,
        shown(unit="1", example=[[0.342, 0.0, 0.94], [-0.171, 0.296, 0.94], [-0.171, -0.296, 0.94]]),
    ] = None
    """unit vector of each beam, instrument axes, pointing away from it; needed for directions"""
    lever_arms_m: Annotated[
        tuple[Vector, ...] | None,
        shown(example=[[0.4, 0.0, 0.1], [0.4, 0.0, 0.1], [0.4, 0.0, 0.1], [0.4, 0.0, 0.1]]),
    ] = None
    """position of each transducer from the IMU, platform axes; none: at the IMU"""

    @property
    def beams(self) -> int:
        """Number of beams."""
        by_beam = {"angles": self.azimuths_deg, "directions": self.directions}.get(self.configuration)
        return 4 if self.configuration in {"x", "+"} else len(by_beam or ())

    @model_validator(mode="after")
    def _is_complete(self) -> Self:
        if self.configuration in {"x", "+"} and self.tilt_deg is None:
            raise ValueError(f"configuration '{self.configuration}' needs tilt_deg")
        if self.configuration == "angles":
            tilts_deg = self.tilts_deg or ()
            if not tilts_deg or len(self.azimuths_deg or ()) != len(tilts_deg):
                raise ValueError("configuration 'angles' needs azimuths_deg and tilts_deg of the same length")
            if len(tilts_deg) >= 3:
                _not_in_radians(max(abs(tilt) for tilt in tilts_deg))
        if self.configuration == "directions" and not self.directions:
            raise ValueError("configuration 'directions' needs directions, one unit vector per beam")
        if self.lever_arms_m is not None and len(self.lever_arms_m) != self.beams:
            raise ValueError(
                f"lever_arms_m has {len(self.lever_arms_m)} entries, expected {self.beams}, one per beam"
            )
        return self


class BeamLayout(Mounting, BeamDirections):
    """Directions, places and mounting of the beams, and the scale of their readings."""

    sound_speed_scale: Annotated[Positive, shown(unit="1")] = 1.0
    """factor of the readings, for instance true over assumed speed of sound"""

    def geometry(self, scale: float = 1.0) -> BeamGeometry:
        """The beams; `scale` is a factor of the readings beside that of the sound's speed.

        Raises:
            KernelError: for directions that are not unit vectors, and three or more beams in a plane or on a line: a
                slip in an azimuth, not an instrument.
        """
        common: dict[str, Any] = {
            "lever_arms_p_m": self.lever_arms_m, "mounting_rpy_rad": self.mounting_rpy_rad,
            "sound_speed_scale": self.sound_speed_scale * scale,
        }  # fmt: skip
        if self.configuration == "directions":
            geometry = BeamGeometry(self.directions or (), **common)
        elif self.configuration == "angles":
            tilts_rad, azimuths_rad = np.deg2rad(self.tilts_deg or ()), np.deg2rad(self.azimuths_deg or ())
            geometry = BeamGeometry.from_angles(tilts_rad, azimuths_rad, **common)
        else:
            tilt_rad = units.rad_from_deg(self.tilt_deg or 0.0)
            geometry = BeamGeometry.janus(tilt_rad, configuration=self.configuration, **common)
        if geometry.beams >= 3 and geometry.rank < 3:
            raise KernelError(
                f"the {geometry.beams} beams see only {geometry.rank} directions",
                expected="3: check azimuths and tilts",
            )
        return geometry
