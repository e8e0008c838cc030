"""A depth sensor's bias: a filter that expects it stays consistent, one that does not is overconfident."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import pytest

import bottomlock
from bottomlock.kernel import Method
from bottomlock.models import DepthModel
from bottomlock.statistics.chi_squared import mean_band
from tests.analytic import analytic_simulation
from tests.statistical import ensembles

pytestmark = [pytest.mark.statistical, pytest.mark.slow]

RUNS = 60
METHODS: tuple[Method, ...] = ("tc", "sway_current")
BIASED = DepthModel(sd_m=0.02, bias_sd_m=0.3, bias_time_s=600.0)
UNBIASED = BIASED.replace(bias_sd_m=0.0)


@lru_cache(maxsize=2)
def flown(*, expected: bool) -> dict[str, Any]:
    """Runs on the figure of eight with beams 1 and 2 and a biased depth, whether or not the filter expects the bias."""
    simulation = analytic_simulation("figure_eight")
    scenario, truth = simulation.scenario, simulation.truth()
    schedule: Any = bottomlock.measurement_schedule(simulation, truth)
    schedule["beam_valid"] = np.tile([True, True, False, False], (len(schedule["dvl_time_ns"]), 1))
    schedule["depth_time_ns"] = schedule["dvl_time_ns"]
    schedule["depth_offset_m"] = np.zeros(len(schedule["depth_time_ns"]))
    schedule["sample_time_ns"] = schedule["sample_time_ns"][49::50]
    model = scenario.kernel_model(simulation.gravity_mps2).replace(depth=BIASED)
    assumed = model.replace(depth=BIASED if expected else UNBIASED)
    options = scenario.kernel_options().replace(gate="off")
    arrays: Any = truth.kernel_arrays()
    return dict(
        bottomlock.run_batch(
            simulation.geometry, arrays, model, assumed, options, schedule, METHODS,
            seed=ensembles.SEED, trajectory_key=31, first_run=0, runs=RUNS, threads=1,
        )
    )  # fmt: skip


def test_a_filter_that_expects_the_bias_is_consistent() -> None:
    """NEES of velocity and attitude and of the whole state, at every sample time; the false-alarm rate is 1 %."""
    batch = flown(expected=True)
    samples = batch["nees"].shape[2]
    each = 1.0 - 0.01 / (2 * samples * len(METHODS))
    for quantity, degrees in (("nees_velocity_attitude", 6.0), ("nees", 20.0)):
        _, high = mean_band(degrees, RUNS, each)
        means = batch[quantity].mean(axis=0)
        assert (means < high).all(), (quantity, means)


def test_a_filter_that_does_not_expect_it_is_overconfident_in_depth() -> None:
    """It claims centimetres of a depth that is off by decimetres; with the bias expected it claims what it has."""
    for expected in (True, False):
        batch = flown(expected=expected)
        down = batch["error"][:, :, -1, 2] / batch["sd"][:, :, -1, 2]
        over = np.sqrt((down**2).mean(axis=0))
        assert (over < 1.4).all() if expected else (over > 5.0).all(), over
