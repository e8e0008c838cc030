"""Water track live: from a ping with cells to the navigator, the state WATER, the current on the health page."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bottomlock.live.engine import Engine
from tests.live.world import VELOCITY, World, config, fly, lines, states

CURRENT = np.array([0.3, -0.2, 0.0])
SECTION = "\n[water_track]\nnoise_mps = 0.02\n"
THROUGH = VELOCITY - Rotation.from_euler("z", 30.0, degrees=True).inv().apply(CURRENT)


def none_from_five(t: float) -> tuple[int, ...]:
    """All beams of the bottom lost from 5 s to 9 s."""
    return (0, 1, 2, 3) if 5.0 <= t < 9.0 else ()


def water_of(engine: Engine) -> tuple[Any, Any, int]:
    """Current, north and east, its 1 sigma, and how many readings were used, as the page shows them."""
    shown = engine.estimator.known()["water"]
    current, sd = (np.array(shown[key]) for key in ("current_mps", "current_sd_mps"))
    return current, sd, int(shown["cells"].split()[0])


@pytest.mark.parametrize("form", ["pd0", "nortek-dvl"])
def test_the_water_takes_over_and_the_bottom_comes_back(form: str) -> None:
    """OK, WATER, OK; the velocity over ground stays within its sigma, which grows less than without water.

    In the ensemble of the bottom, or in a record of its own behind it, which is taken with the next ping.
    """
    world = World(10.5, none_from_five, form=form, through_mps=THROUGH)
    engine = Engine(config("navigation", extra=SECTION, format=form))
    sent = fly(engine, world.arrivals(imu=True))
    assert states(sent) == ["OK", "WATER", "OK"]
    errors = np.array([(line.velocity - VELOCITY) / line.sd for line in lines(sent)])
    assert np.abs(errors).max() < 5.0
    plain = fly(Engine(config("navigation", format=form)), world.arrivals(imu=True))
    assert states(plain) == ["OK", "COASTING", "OK"]
    worst = max(float(line.sd.max()) for line in lines(sent) if line.state == "WATER")
    assert worst < max(float(line.sd.max()) for line in lines(plain) if line.state == "COASTING")
    current, sd, used = water_of(engine)
    assert (np.abs(current - CURRENT[:2]) < 4.0 * sd).all()
    assert (sd < 0.05).all()
    assert used > 4 * 90


def test_water_tracking_of_a_water_linked() -> None:
    """It reports the water in place of the bottom: learnt before, the current is what a start with both would give."""
    engine = Engine(config("navigation", extra=SECTION))
    sent = fly(engine, World(8.5, none_from_five, through_mps=THROUGH).arrivals(imu=True))
    assert states(sent) == ["OK", "WATER"]
    current, sd, used = water_of(engine)
    assert (np.abs(current - CURRENT[:2]) < 4.0 * sd).all()
    assert used > 4 * 30


def test_two_beams_of_the_water_do_not_hold_the_velocity(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rank 2 of the water is no WATER: it aids, and the state is COASTING."""
    engine = Engine(config("navigation", extra=SECTION, format="pd0"))
    feed = engine.sources[0].reader.feed

    def two(data: bytes) -> list[Any]:
        found: list[Any] = list(feed(data))
        for ping in found:
            if ping.water is not None:
                ping.water.valid[:, 2:] = False
        return found

    monkeypatch.setattr(engine.sources[0].reader, "feed", two)
    world = World(7.0, none_from_five, form="pd0", through_mps=THROUGH)
    assert states(fly(engine, world.arrivals(imu=True))) == ["OK", "COASTING"]
    assert water_of(engine)[2] > 100
