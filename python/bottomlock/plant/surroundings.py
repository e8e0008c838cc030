"""What the other aiding sensors meet: the surface, the Earth's magnetic field, the sea above."""

import math
from dataclasses import dataclass
from importlib import import_module

import numpy as np
from numpy.typing import NDArray

from bottomlock.errors import ScenarioError
from bottomlock.plant.lanes import FloatArray, IntArray
from bottomlock.plant.matrices import rotation_t_p

BoolArray = NDArray[np.bool_]


class GpsReception:
    """Where GPS is heard: once the antenna has been above water for the time that a fix takes.

    Fed stretches of truth in order; a vehicle that begins at the surface has its fix already.
    """

    def __init__(self, antenna_depth_m: float = 0.3, acquire_s: float = 5.0) -> None:
        if not acquire_s >= 0.0:
            raise ScenarioError(f"gps: acquire_s is {acquire_s:g}, expected >= 0 s")
        self._antenna_depth_m, self._acquire_ns = antenna_depth_m, round(acquire_s * 1e9)
        self._last_under_ns: IntArray | None = None

    def heard(self, time_ns: IntArray, depth_m: FloatArray, epochs_ns: IntArray) -> BoolArray:
        """(runs, epochs): true where a fix is heard; depths (runs, samples) at times (samples,)."""
        up = depth_m <= self._antenna_depth_m
        if self._last_under_ns is None:
            self._last_under_ns = np.full(len(depth_m), np.iinfo(np.int64).min // 2)
        # the time of the last sample under water, carried forward
        under = np.maximum(np.where(up, np.iinfo(np.int64).min // 2, time_ns), self._last_under_ns[:, None])
        last_under = np.maximum.accumulate(under, axis=1)
        self._last_under_ns = last_under[:, -1]
        nearest = np.minimum(np.searchsorted(time_ns, epochs_ns), len(time_ns) - 1)
        heard: BoolArray = up[:, nearest] & (epochs_ns - last_under[:, nearest] >= self._acquire_ns)
        return heard


@dataclass(frozen=True)
class MagneticField:
    """The field at a place: declination and inclination (rad), strength (nT)."""

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

    Raises `ScenarioError` when the package is absent or the date lies outside the model's life.
    """
    try:
        geomag = import_module("pygeomag")
    except ImportError as error:
        raise ScenarioError(
            "magnetometer: the World Magnetic Model needs the package pygeomag: pip install 'bottomlock[magnetic]', "
            "or give the declination itself"
        ) from error
    try:
        found = geomag.GeoMag().calculate(
            glat=math.degrees(latitude_rad),
            glon=math.degrees(longitude_rad),
            alt=height_m / 1000.0,
            time=decimal_year,
        )
    except ValueError as error:
        raise ScenarioError(
            f"magnetometer: the World Magnetic Model refuses {decimal_year:g}: {error}"
        ) from error
    return MagneticField(math.radians(found.d), math.radians(found.i), float(found.f))


@dataclass(frozen=True)
class Iron:
    """The vehicle's own magnetism.

    Hard iron (nT, platform) adds to the field, soft iron (3, 3) turns and stretches it.
    """

    hard_p_nt: tuple[float, float, float] = (0.0, 0.0, 0.0)
    soft: tuple[tuple[float, float, float], ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def magnetic_heading_error_rad(
    field: MagneticField, iron: Iron, attitude_t_p: FloatArray, *, assumed_declination_rad: float
) -> FloatArray:
    """Heading a levelled magnetometer reads minus the true heading, rad, at attitudes (N, 4) -> (N,).

    The field in the platform frame is distorted by soft and hard iron, turned back through the true roll
    and pitch, and its horizontal part taken for magnetic north; the assumed declination is then added.
    """
    attitude = np.asarray(attitude_t_p, dtype=np.float64)
    rotation = np.moveaxis(rotation_t_p(attitude.T), -1, 0)
    soft, hard = np.array(iron.soft), np.array(iron.hard_p_nt)
    field_p = np.einsum("nji,j->ni", rotation, field.vector_t_nt)
    felt_p = field_p @ soft.T + hard
    felt_t = np.einsum("nij,nj->ni", rotation, felt_p)
    # in the tangent frame an undisturbed field points to the declination; what is left over is heading error
    swing = np.arctan2(felt_t[:, 1], felt_t[:, 0]) - assumed_declination_rad
    return np.asarray(-(swing - 2.0 * np.pi * np.round(swing / (2.0 * np.pi))))


@dataclass(frozen=True)
class Pressure:
    """How pressure is taken for depth.

    True and assumed density (kg/m³), tide (m, positive at high water), barometer (Pa).

    A sensor that assumes a density and a mean sea level reads depth with a scale and an offset.
    """

    density_kgpm3: float = 1026.0
    assumed_density_kgpm3: float = 1026.0
    tide_m: float = 0.0
    barometric_offset_pa: float = 0.0

    def __post_init__(self) -> None:
        if min(self.density_kgpm3, self.assumed_density_kgpm3) <= 0.0:
            raise ScenarioError("pressure: densities must be positive")

    def pressure_pa(self, depth_m: FloatArray, gravity_mps2: float) -> FloatArray:
        """Pressure over the assumed standard atmosphere at depths below mean sea level, Pa."""
        column = np.asarray(depth_m) + self.tide_m
        return np.asarray(self.density_kgpm3 * gravity_mps2 * column + self.barometric_offset_pa)

    def depth_error_m(self, depth_m: FloatArray, gravity_mps2: float) -> FloatArray:
        """Depth read minus true depth below mean sea level, m."""
        read = self.pressure_pa(depth_m, gravity_mps2) / (self.assumed_density_kgpm3 * gravity_mps2)
        return np.asarray(read - np.asarray(depth_m))
