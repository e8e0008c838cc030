"""Senseless parts of a world are refused when they are made, by name."""

from collections.abc import Callable

import pytest

from bottomlock.errors import ScenarioError
from bottomlock.plant import DepthProfile
from bottomlock.plant.seabed import PlaneSeabed
from bottomlock.plant.surroundings import GpsReception, Pressure


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: PlaneSeabed(-5.0), "positive depth"),
        (lambda: DepthProfile(((5.0, 20.0), (5.0, 29.0))), "strictly rising"),
        (lambda: Pressure(density_kgpm3=0.0), "densities"),
        (lambda: GpsReception(acquire_s=-1.0), "acquire_s is -1"),
    ],
)
def test_senseless_parts_are_refused(make: Callable[[], object], words: str) -> None:
    with pytest.raises(ScenarioError, match=words):
        make()
