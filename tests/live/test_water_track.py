"""Water track live: from a ping with cells to the navigator, the state WATER, the current on the health page."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bottomlock.io.beams import read_geometry
from bottomlock.io.water_table import WaterTable
from bottomlock.live.config import LiveConfig
from bottomlock.live.engine import Engine
from bottomlock.recordings.readings import Ping
from tests.live.test_engine import fly, states
from tests.live.world import VELOCITY, Sent, World, config

CURRENT = np.array([0.3, -0.2, 0.0])
SECTION = "\n[water_track]\nnoise_mps = 0.02\n"
GEOMETRY = read_geometry("waterlinked_a50").geometry
THROUGH = VELOCITY - Rotation.from_euler("z", 30.0, degrees=True).inv().apply(CURRENT)


def cells(time_ns: int, *, fish: bool = False) -> WaterTable:
    """Two cells of a ping, with noise that its time alone decides; `fish` adds 1 m/s to a beam of the second."""
    random_ = np.random.default_rng(time_ns)
    along = GEOMETRY.beam_velocities([THROUGH, THROUGH]) + 0.02 * random_.normal(size=(2, 4))
    along[1, 2] += 1.0 * fish
    none = np.full((2, 4), np.nan)
    return WaterTable(
        np.full(2, time_ns),
        np.array([1, 2]),
        np.array([2.0, 4.0]),
        along,
        np.ones((2, 4), dtype=bool),
        none,
        none,
    )


class WithWater:
    """A reader of pings that gives each of them cells of the water."""

    def __init__(self, reader: Any, **how: bool) -> None:  # noqa: ANN401
        self._reader, self._how = reader, how

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401
        return getattr(self._reader, name)

    def feed(self, data: bytes) -> list[Ping]:
        """The pings of its reader, with water."""
        return [replace(one, water=cells(one.time_ns, **self._how)) for one in self._reader.feed(data)]


def with_water(chosen: LiveConfig | None = None, **how: bool) -> Engine:
    """An engine whose DVL measures the water, too."""
    return watered(Engine(chosen or config("navigation", extra=SECTION)), **how)


def watered(engine: Engine, **how: bool) -> Engine:
    engine.sources[0].reader = WithWater(engine.sources[0].reader, **how)  # type: ignore[assignment]
    return engine


def none_from_five(t: float) -> tuple[int, ...]:
    """All beams of the bottom lost from 5 s to 9 s."""
    return (0, 1, 2, 3) if 5.0 <= t < 9.0 else ()


def test_the_water_takes_over_and_the_bottom_comes_back() -> None:
    """OK, WATER, OK; the velocity over ground stays within its sigma, which grows less than without water."""
    engine = with_water()
    sent = fly(engine, World(10.5, none_from_five), imu=True)
    assert states(sent) == ["OK", "WATER", "OK"]
    lines = [Sent.parse(message.data) for _, message, _ in sent]
    errors = np.array([(line.velocity - VELOCITY) / line.sd for line in lines])
    assert np.abs(errors).max() < 5.0
    plain = fly(Engine(config("navigation")), World(10.5, none_from_five), imu=True)
    assert states(plain) == ["OK", "COASTING", "OK"]
    worst = max(float(line.sd.max()) for line in lines if line.state == "WATER")
    coasting = [Sent.parse(message.data) for _, message, _ in plain]
    assert worst < max(float(line.sd.max()) for line in coasting if line.state == "COASTING")
    current = engine.estimator.current
    assert current is not None
    assert (np.abs(current[0] - CURRENT[:2]) < 4.0 * current[1]).all()
    assert (current[1] < 0.05).all()


@pytest.mark.parametrize("form", ["pd0", "nortek-dvl"])
def test_the_water_of_a_byte_stream(form: str) -> None:
    """In the ensemble of the bottom, or in a record of its own behind it, which is taken with the next ping."""
    engine = Engine(config("navigation", extra=SECTION, format=form))
    sent = fly(engine, World(10.5, none_from_five, form=form, through_mps=THROUGH), imu=True)
    assert states(sent) == ["OK", "WATER", "OK"]
    current = engine.estimator.current
    assert current is not None
    assert (np.abs(current[0] - CURRENT[:2]) < 4.0 * current[1]).all()
    assert (current[1] < 0.05).all()
    assert engine.estimator.water_counts.used > 4 * 90


def test_water_tracking_of_a_water_linked() -> None:
    """It reports the water in place of the bottom: learnt before, the current is what a start with both would give."""
    engine = Engine(config("navigation", extra=SECTION))
    sent = fly(engine, World(8.5, none_from_five, through_mps=THROUGH), imu=True)
    assert states(sent) == ["OK", "WATER"]
    current = engine.estimator.current
    assert current is not None
    assert (np.abs(current[0] - CURRENT[:2]) < 4.0 * current[1]).all()
    assert engine.estimator.water_counts.used > 4 * 30


def test_cells_are_screened() -> None:
    """A beam of the second cell is off by 1 m/s: it closes badly, and only the first cell is used."""
    engine = with_water(fish=True)
    fly(engine, World(7.0, none_from_five), imu=True)
    counts = engine.estimator.water_counts
    assert counts.used == counts.closure > 100
    assert engine.state == "WATER"


def test_two_beams_of_the_water_do_not_hold_the_velocity() -> None:
    """Rank 2 of the water is no WATER: it aids, and the state is COASTING."""
    engine = with_water()
    one: Any = engine.sources[0].reader
    feed = one.feed

    def two(data: bytes) -> list[Ping]:
        found: list[Ping] = feed(data)
        for ping in found:
            assert ping.water is not None
            ping.water.valid[:, 2:] = False
        return found

    one.feed = two
    assert states(fly(engine, World(7.0, none_from_five), imu=True)) == ["OK", "COASTING"]
    assert engine.estimator.water_counts.used > 100
