"""A start at a place that is known to a kilometre or three: no sensor makes the place better known than it is.

What the position's error was before the start lies on no way, which a misalignment would turn, and the axis of a depth
turns with a correction of the place by the first depth too. Else tilts of 0.5 deg sent `tc` 8 km off at a claimed 3 km.
"""

from typing import Any

import numpy as np
import pytest

from bottomlock import load_scenario
from bottomlock.kernel import Method, run_batch
from bottomlock.simulation.build import build_simulation
from bottomlock.statistics.chi_squared import mean_band
from tests.analytic import batch_of

pytestmark = [pytest.mark.statistical, pytest.mark.slow]

SEED, RUNS, PROBABILITY = 20261201, 40, 1.0 - 1e-3
METHODS: tuple[Method, ...] = ("tc", "sway_current")


@pytest.mark.first_cases(1)
@pytest.mark.parametrize(
    ("place_m", "tilt_deg"), [(1000.0, 0.5), (1000.0, 0.02), (3000.0, 0.02), (1000.0, 5.0)]
)
def test_a_place_known_to_kilometres_is_no_better_known_after_a_minute(
    place_m: float, tilt_deg: float
) -> None:
    """With four beams and a depth of 2 cm, on the ellipsoid: NEES of the whole state, and of velocity and attitude."""
    scenario = load_scenario("survey").with_trajectory(duration_s=60.0)
    start = {"position_m": (place_m, place_m, 2.0), "roll_deg": tilt_deg, "pitch_deg": tilt_deg}
    scenario = scenario.replace(
        {"imu.rate_hz": 50.0, **{f"initial.{key}": value for key, value in start.items()}}
    )
    work = batch_of(build_simulation(scenario), slice(-1, None)) | {"seed": SEED, "trajectory_key": 0}
    batch: Any = run_batch(**work, methods=METHODS, runs=RUNS, threads=1)
    for key, degrees in {"nees": 20, "nees_velocity_attitude": 6}.items():
        assert (batch[key][:, :, -1].mean(axis=0) < mean_band(degrees, RUNS, PROBABILITY)[1]).all(), key
    error_m, claimed_m = (
        np.sqrt((batch[key][:, :, -1, :2] ** 2).sum(axis=2).mean(axis=0)) for key in ("error", "sd")
    )
    assert (error_m < 1.3 * claimed_m).all(), (error_m, claimed_m)
