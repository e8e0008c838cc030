"""Normal gravity of the product against the symmetric form of Somigliana and a derived growth with depth."""

import numpy as np
import pytest

import bottomlock
from tests.oracle import gravity


@pytest.mark.parametrize("latitude_deg", [-90, -60, -32.8, 0, 15, 45, 70, 90])
def test_surface_gravity(latitude_deg: float) -> None:
    """The product uses the formula with k and e², the oracle the one with both axes: 1e-8 is the rounding of k."""
    latitude = float(np.deg2rad(latitude_deg))
    assert bottomlock.normal_gravity_mps2(latitude, 0.0) == pytest.approx(
        gravity.somigliana(latitude), abs=3e-8
    )


def test_values_of_the_defining_table() -> None:
    """WGS 84 by definition at the equator and at the poles."""
    assert bottomlock.normal_gravity_mps2(0.0, 0.0) == pytest.approx(9.7803253359, abs=3e-8)
    assert bottomlock.normal_gravity_mps2(np.pi / 2, 0.0) == pytest.approx(9.8321849378, abs=3e-8)


def test_depth_term() -> None:
    """In the sea gravity grows by 2.2e-6 m/s² per metre, not by the 3.1e-6 of free air."""
    gain = bottomlock.normal_gravity_mps2(0.5, 1000.0) - bottomlock.normal_gravity_mps2(0.5, 0.0)
    assert gain == pytest.approx(1000 * gravity.depth_gradient(), rel=1e-3)
