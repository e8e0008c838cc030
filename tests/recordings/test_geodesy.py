"""Geodetic coordinates to the tangent frame and back, against pymap3d, at every latitude and at depth."""

import itertools

import numpy as np
import pytest

from bottomlock.geodesy import Place, geodetic_from_tangent, tangent_from_geodetic

PLACES = [
    Place(np.deg2rad(latitude), np.deg2rad(longitude), height)
    for latitude, longitude, height in (
        (0.0, 0.0, 0.0), (42.2, 3.1, 12.0), (-33.9, 151.2, -10_900.0), (79.9, -179.99, 0.0), (90.0, 10.0, 5.0),
    )
]  # fmt: skip


@pytest.mark.parametrize("at", PLACES)
def test_tangent_and_back_agree_with_pymap3d(at: Place) -> None:
    """To a micrometre of position 100 km away, where a sphere would be hundreds of metres off."""
    pymap3d = pytest.importorskip("pymap3d")
    ned = np.random.default_rng(3).uniform(-1e5, 1e5, (200, 3)) * [1.0, 1.0, 0.1]
    expected = pymap3d.ned2geodetic(*ned.T, at.latitude_rad, at.longitude_rad, at.height_m, deg=False)
    latitude, longitude, height = geodetic_from_tangent(ned, at)
    assert latitude == pytest.approx(expected[0], abs=2e-13)
    turn = np.remainder(longitude - expected[1] + np.pi, 2.0 * np.pi) - np.pi
    assert turn * np.cos(latitude) == pytest.approx(np.zeros(200), abs=2e-13)
    assert height == pytest.approx(expected[2], abs=2e-6)
    there = tangent_from_geodetic(expected[0], expected[1], expected[2], at)
    reference = np.stack(
        pymap3d.geodetic2ned(*expected, at.latitude_rad, at.longitude_rad, at.height_m, deg=False), axis=1
    )
    assert there == pytest.approx(reference, abs=1e-6)


@pytest.mark.parametrize("at", PLACES)
def test_there_and_back_is_where_it_was(at: Place) -> None:
    ned = np.array([[0.0, 0.0, 0.0], [300.0, -440.0, 60.0], [-5e4, 5e4, 11_000.0]])
    latitude, longitude, height = geodetic_from_tangent(ned, at)
    assert tangent_from_geodetic(latitude, longitude, height, at) == pytest.approx(ned, abs=1e-6)


def test_a_degree_of_latitude_is_longer_at_the_pole() -> None:
    """Meridian arcs of one degree of WGS 84: 110,574 m at the equator, 111,694 m at the pole (NGA tables)."""
    arcs = []
    for degree in (0.0, 89.0):
        step = np.deg2rad(np.linspace(degree, degree + 1.0, 1001))
        lengths = [
            float(np.linalg.norm(tangent_from_geodetic([b], [0.0], [0.0], Place(a, 0.0, 0.0))))
            for a, b in itertools.pairwise(step)
        ]
        arcs.append(sum(lengths))
    assert arcs == pytest.approx([110_574.0, 111_694.0], abs=1.0)
