"""Missions that another process simulates: the bits of this one's, in the cache; where it fails, nothing is lost."""

import shutil
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from bottomlock.campaign.flights_ahead import flights_ahead
from bottomlock.plant import fly
from bottomlock.plant.cache import is_stored
from bottomlock.simulation.build import Simulation, build_simulation
from tests.campaign.small_campaign import short

DEADLINE_S = 60.0


def _simulations() -> list[Simulation]:
    """Three missions of ten seconds, the second twice."""
    return [
        build_simulation(short(2, name))
        for name in ("straight", "figure_eight", "figure_eight", "lawn_mower")
    ]


@pytest.fixture
def _empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A cache of its own, which the other process inherits."""
    monkeypatch.setenv("BOTTOMLOCK_CACHE", str(tmp_path / "cache"))


@pytest.mark.long
@pytest.mark.usefixtures("_empty_cache")
def test_all_but_the_first_are_there_with_the_same_bits() -> None:
    """The first is left to the caller."""
    first, *others = simulations = _simulations()
    keys = [one.flight_key() for one in simulations]
    end = time.monotonic() + DEADLINE_S
    with flights_ahead(simulations, threads=2):
        while not all(is_stored(str(key)) for key in keys[1:]) and time.monotonic() < end:
            time.sleep(0.05)
    assert [is_stored(str(key)) for key in keys] == [False, True, True, True]
    for one in others:
        assert one.vehicle is not None
        assert one.mission is not None
        own = fly(
            one.vehicle,
            one.mission,
            latitude_rad=one.latitude_rad,
            gravity_mps2=one.gravity_mps2,
            use_cache=False,
        )
        np.testing.assert_array_equal(one.flight().history.state, own.history.state)
    assert len(first.flight().truth.time_ns) == 1501


@pytest.mark.usefixtures("_empty_cache")
def test_without_the_process_the_caller_simulates_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that ends at once, and none for a single thread or a single mission."""
    monkeypatch.setattr(sys, "executable", shutil.which("false"))
    with flights_ahead(_simulations(), threads=2):
        assert len(_simulations()[-1].flight().truth.time_ns) == 1501
    monkeypatch.setattr(sys, "executable", "/nowhere/python")
    with flights_ahead(_simulations(), threads=1), flights_ahead(_simulations()[1:3], threads=2):
        pass
