"""Environment of the other aiding sensors: GPS reception at the surface, magnetic field, pressure."""

import math
from dataclasses import dataclass
from importlib import import_module

import numpy as np
from numpy.typing import NDArray

from bottomlock import units
from bottomlock.config.sensors import Depth, Gps, Magnetometer
from bottomlock.errors import ScenarioError
from bottomlock.libraries import install
from bottomlock.plant.maths import FloatArray, IntArray
from bottomlock.recordings.rotation import matrices

BoolArray = NDArray[np.bool_]


class GpsReception:
    """GPS reception: a fix once the antenna has been above water for the acquisition time.

    Called with consecutive blocks of truth; a vehicle that starts at the surface has a fix from the start.
    """

    def __init__(self, gps: Gps) -> None:
        self._antenna_depth_m, self._acquire_ns = gps.antenna_depth_m, round(gps.acquire_s * 1e9)
        self._last_under_ns: IntArray | None = None

    def received(self, time_ns: IntArray, depth_m: FloatArray, epochs_ns: IntArray) -> BoolArray:
        """(runs, epochs): true where a fix is received; depths (runs, samples), m, at times (samples,), ns."""
        up = depth_m <= self._antenna_depth_m
        if self._last_under_ns is None:
            self._last_under_ns = np.full(len(depth_m), np.iinfo(np.int64).min // 2)
        # the time of the last sample under water, carried forward
        under = np.maximum(np.where(up, np.iinfo(np.int64).min // 2, time_ns), self._last_under_ns[:, None])
        last_under = np.maximum.accumulate(under, axis=1)
        self._last_under_ns = last_under[:, -1]
        nearest = np.minimum(np.searchsorted(time_ns, epochs_ns), len(time_ns) - 1)
        fixed: BoolArray = up[:, nearest] & (epochs_ns - last_under[:, nearest] >= self._acquire_ns)
        return fixed


@dataclass(frozen=True)
class MagneticField:
    """Magnetic field at a position: declination and inclination (rad), strength (nT)."""

    declination_rad: float
    inclination_rad: float
    strength_nt: float

    @property
    def vector_t_nt(self) -> FloatArray:
        """Field vector in the tangent frame (north, east, down), nT."""
        level = self.strength_nt * math.cos(self.inclination_rad)
        down = self.strength_nt * math.sin(self.inclination_rad)
        return np.array(
            [level * math.cos(self.declination_rad), level * math.sin(self.declination_rad), down]
        )


def world_magnetic_model(
    latitude_rad: float, longitude_rad: float, decimal_year: float, *, height_m: float = 0.0
) -> MagneticField:
    """The World Magnetic Model by the `pygeomag` package (extra `magnetic`).

    Raises:
        ScenarioError: where the package is not installed, or the date is outside the model's validity.
    """
    try:
        geomag = import_module("pygeomag")
    except ImportError as error:
        raise ScenarioError(
            f"the World Magnetic Model needs the package pygeomag: {install('magnetic')}, or "
            "give the declination itself",
            place="magnetometer",
        ) from error
    try:
        found = geomag.GeoMag(base_year=decimal_year).calculate(
            glat=math.degrees(latitude_rad),
            glon=math.degrees(longitude_rad),
            alt=height_m / 1000.0,
            time=decimal_year,
        )
    except ValueError as error:
        raise ScenarioError(
            f"the World Magnetic Model is not valid in {decimal_year:g}: {error}", place="magnetometer"
        ) from error
    return MagneticField(math.radians(found.d), math.radians(found.i), float(found.f))


def magnetic_heading_error_rad(
    field: MagneticField, compass: Magnetometer, attitude_t_p: FloatArray
) -> FloatArray:
    """Heading of a levelled magnetometer minus the true heading, rad, at attitudes (..., 4) -> (...).

    The field in the platform frame is distorted by soft and hard iron and levelled with the true roll and pitch; its
    horizontal component is taken as magnetic north, and the assumed declination is added.
    """
    rotation = matrices(attitude_t_p)
    soft, hard = np.array(compass.soft_iron), np.array(compass.hard_iron_nt)
    field_p = np.einsum("...ji,j->...i", rotation, field.vector_t_nt)
    measured_p = field_p @ soft.T + hard
    measured_t = np.einsum("...ij,...j->...i", rotation, measured_p)
    # in the tangent frame an undisturbed field points to the declination; the difference is heading error
    assumed_deg = compass.assumed_declination_deg
    assumed_rad = field.declination_rad if assumed_deg is None else units.rad_from_deg(assumed_deg)
    deviation = np.arctan2(measured_t[..., 1], measured_t[..., 0]) - assumed_rad
    return np.asarray(-(deviation - 2.0 * np.pi * np.round(deviation / (2.0 * np.pi))))


def depth_error_m(sensor: Depth, depth_m: FloatArray, gravity_mps2: float) -> FloatArray:
    """Measured depth minus true depth below mean sea level, m: by density, tide and barometer."""
    assumed = sensor.water_density_kg_per_m3
    column = np.asarray(depth_m) + sensor.tide_m
    density = sensor.true_density_kg_per_m3 or assumed
    pressure_pa = density * gravity_mps2 * column + sensor.barometric_offset_pa
    return np.asarray(pressure_pa / (assumed * gravity_mps2) - np.asarray(depth_m))
