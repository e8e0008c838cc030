"""GPS at the surface, the magnetometer's heading error, and what pressure makes of depth."""

import math
from typing import Any

import numpy as np
import pytest

from bottomlock.config.sensors import Depth, Gps, Magnetometer
from bottomlock.plant.surroundings import (
    GpsReception,
    MagneticField,
    depth_error_m,
    magnetic_heading_error_rad,
    world_magnetic_model,
)

FIELD = MagneticField(math.radians(5.0), math.radians(60.0), 48_000.0)


def _headings(count: int = 8) -> np.ndarray[Any, np.dtype[np.float64]]:
    half = 0.5 * 2.0 * np.pi * np.arange(count) / count
    return np.stack([np.cos(half), np.zeros(count), np.zeros(count), np.sin(half)], axis=1)


EPOCHS = np.arange(1, 61, dtype=np.int64) * 1_000_000_000
TIME = np.arange(0, 60_000_000_001, 100_000_000, dtype=np.int64)
UP = np.where((TIME >= 20_000_000_000) & (TIME < 40_000_000_000), 0.1, 5.0)


def test_gps_needs_the_surface_and_time_to_lock() -> None:
    """Two runs: one comes up for twenty seconds, the other never does."""
    heard = GpsReception(Gps(acquire_s=5.0)).received(TIME, np.stack([UP, np.full(601, 3.0)]), EPOCHS)
    assert (EPOCHS[heard[0]] == np.arange(25, 40) * 1_000_000_000).all()
    assert not heard[1].any()


def test_hard_iron_swings_once_round_the_compass() -> None:
    """A fixed field ahead of h adds h / H sin(magnetic heading) to first order (deviation coefficient B)."""
    level = FIELD.strength_nt * math.cos(FIELD.inclination_rad)
    iron = Magnetometer(hard_iron_nt=(0.01 * level, 0.0, 0.0))
    errors = magnetic_heading_error_rad(FIELD, iron, _headings(36))
    heading = 2.0 * np.pi * np.arange(36) / 36 - FIELD.declination_rad
    assert np.allclose(errors, -0.01 * np.sin(heading), atol=2e-4)


def test_soft_iron_swings_twice_round_the_compass() -> None:
    iron = Magnetometer(soft_iron=((1.02, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
    errors = magnetic_heading_error_rad(FIELD, iron, _headings(36))
    heading = 2.0 * np.pi * np.arange(36) / 36 - FIELD.declination_rad
    assert np.allclose(np.abs(errors), np.abs(0.01 * np.sin(2.0 * heading)), atol=3e-4)


@pytest.mark.parametrize(
    ("place_deg", "year", "expected"),
    [
        ((80.0, 0.0), 2020.0, (-1.28, 83.14, 55_000.1)),
        ((0.0, 120.0), 2020.0, (0.16, -15.42, 41_104.9)),
        ((-80.0, 240.0), 2020.0, (69.36, -72.20, 55_120.6)),
    ],
)
def test_the_package_gives_the_test_values_of_the_model(
    place_deg: tuple[float, float], year: float, expected: tuple[float, float, float]
) -> None:
    """Declination, inclination and intensity that NOAA publishes with the coefficients of 2020, of a model now past."""
    pytest.importorskip("pygeomag")
    field = world_magnetic_model(math.radians(place_deg[0]), math.radians(place_deg[1]), year)
    found = math.degrees(field.declination_rad), math.degrees(field.inclination_rad), field.strength_nt
    assert found == pytest.approx(expected, abs=0.05)


def test_depth_errors_by_hand() -> None:
    """1 % denser water reads 1 % deep; half a metre of high tide reads half a metre deep."""
    depth = np.array([0.0, 50.0, 100.0])
    dense = Depth(true_density_kg_per_m3=1030.0, water_density_kg_per_m3=1030.0 / 1.01)
    assert depth_error_m(dense, depth, 9.8) == pytest.approx(0.01 * depth)
    assert depth_error_m(Depth(tide_m=0.5), depth, 9.8) == pytest.approx(0.5)
    low = Depth(barometric_offset_pa=-1025.0 * 9.8)
    assert depth_error_m(low, depth, 9.8) == pytest.approx(-1.0)
