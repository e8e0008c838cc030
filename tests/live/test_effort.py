"""Forces of thrusters live: lines, and what the filter makes of them where the bottom is lost."""

from __future__ import annotations

import numpy as np
import pytest

from tests.live.test_thrust import SECONDS, flown
from tests.live.test_water_track import THROUGH
from tests.live.world import START_NS

DRAG = np.array([20.0, 40.0, 60.0])
SOURCE = """
[[source]]
name = "thrusters"
address = "udpin:127.0.0.1:12"
format = "effort-csv"
rate_hz = 5
clock = "host"
"""
SECTION = """[effort]
mass_kg = [20.0, 25.0, 30.0]
linear_drag_kg_per_s = [20.0, 40.0, 60.0]
"""


def lines(factor: float = 1.0) -> list[tuple[int, int, bytes]]:
    """Five a second, of the drag at the speed through the water, with noise of a fifth of a newton."""
    random, found = np.random.default_rng(9), []
    for k in range(round(5 * SECONDS)):
        time_ns = START_NS + round((k + 0.3) / 5 * 1e9)
        force_n = factor * DRAG * THROUGH + 0.2 * random.standard_normal(3)
        line = f"{time_ns},{','.join(map(repr, force_n.tolist()))}\n".encode()
        found.append((time_ns + 5_000_000, 2, line))
    return found


@pytest.mark.parametrize("factor", [1.0, 1.2])
def test_forces_hold_the_velocity(factor: float) -> None:
    """Surge and sway claimed half as far off as without, and within it; also where the drag is a sixth too small."""
    engine, error, sd = flown(SECTION + SOURCE, lines(factor))
    _, coasting, alone = flown("", [])
    assert (np.abs(error[:2]) < 3.0 * sd[:2]).all()
    assert (np.abs(coasting[:2]) < 3.0 * alone[:2]).all()
    assert (sd[:2] < 0.5 * alone[:2]).all()
    assert engine.state == "COASTING"
    assert dict(engine.estimator.gated) == {}
