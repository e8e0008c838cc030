"""50 km on the ellipsoid with a fibre-optic INS: the filter claims what it achieves, far from its origin.

Constant heading and depth at 5 m/s (`long_way`), four beams and depth. Seed, runs, latitudes and headings were fixed
before the first run. Means over time and runs have a band from the spread between runs; each test judges nine errors
and the NEES.
"""

from typing import Any

import pytest

from bottomlock.config.scenario import load_scenario
from bottomlock.kernel import run_batch
from bottomlock.simulation.build import build_simulation
from tests.analytic import batch_of
from tests.oracle import chi_squared

pytestmark = [pytest.mark.statistical, pytest.mark.slow]

SEED, RUNS = 20261124, 24
WAYS = [(0.0, 225.0), (85.0, 90.0), pytest.param(45.0, 0.0, marks=pytest.mark.deep)]


def fly(latitude_deg: float, heading_deg: float) -> dict[str, Any]:
    """The kernel's batch of runs of one way."""
    scenario = load_scenario("long_way").replace({"environment.latitude_deg": latitude_deg})
    simulation = build_simulation(scenario.replace({"trajectory.heading_deg": heading_deg}))
    work = batch_of(simulation, slice(499, None, 500)) | {"seed": SEED, "trajectory_key": 31}
    return dict(run_batch(**work, methods=["tc"], runs=RUNS, threads=1))


@pytest.mark.long
@pytest.mark.parametrize(("latitude_deg", "heading_deg"), WAYS)
def test_claims_hold_after_fifty_kilometres(latitude_deg: float, heading_deg: float) -> None:
    """NEES of velocity and attitude in its band; no error of position, misalignment or velocity beyond its claim.

    Band of NEES at 99.8 %, of each error above at 99.9 %.
    """
    batch = fly(latitude_deg, heading_deg)
    nees = batch["nees_velocity_attitude"][:, 0]
    low, high = chi_squared.mean_band(nees.mean(axis=1), 6, 0.998)
    assert low < nees.mean() < high
    squares = (batch["error"][:, 0] / batch["sd"][:, 0])[..., :9] ** 2
    for state in range(9):
        most = chi_squared.mean_band(squares[..., state].mean(axis=1), 1.0, 0.998)[1]
        assert squares[..., state].mean() < most, f"state {state}"
