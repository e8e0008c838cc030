"""Vehicles and flights shared by the plant's tests; simulated once."""

import pytest

from bottomlock.plant import Flight, Vehicle, figure_eight, fly, lawn_mower, straight
from tests.plant.helpers import GRAVITY_MPS2, LATITUDE_RAD, finned


@pytest.fixture(scope="session")
def tauv() -> Vehicle:
    """The 2017 paper's vehicle."""
    return finned("tauv")


@pytest.fixture(scope="session")
def remus() -> Vehicle:
    """The vehicle with published coefficients."""
    return finned("remus100")


@pytest.fixture(scope="session")
def flights(tauv: Vehicle) -> dict[str, Flight]:
    """The three missions in still water: a loop to either side, a dive with the first turns."""
    return {
        mission.name: fly(tauv, mission, latitude_rad=LATITUDE_RAD, gravity_mps2=GRAVITY_MPS2)
        for mission in (
            straight(duration_s=100.0),
            figure_eight(duration_s=125.0),
            lawn_mower(duration_s=125.0),
        )
    }
