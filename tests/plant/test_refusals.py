"""Senseless parts of a world are refused when they are made, by name."""

from collections.abc import Callable

import pytest

from bottomlock.errors import ScenarioError
from bottomlock.plant import DepthProfile
from bottomlock.plant.seabed import PlaneSeabed


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: PlaneSeabed(-5.0), "positive depth"),
        (lambda: DepthProfile(((5.0, 20.0), (5.0, 29.0))), "strictly rising"),
    ],
)
def test_senseless_parts_are_refused(make: Callable[[], object], words: str) -> None:
    with pytest.raises(ScenarioError, match=words):
        make()
