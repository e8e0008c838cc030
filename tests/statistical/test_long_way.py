"""50 km on the ellipsoid with a fibre-optic INS: the filter claims what it achieves, far from its origin.

Constant heading and depth at 5 m/s (`long_way`), four beams and depth. Seed, runs, latitudes and headings were fixed
before the first run. Means over time and runs have a band from the spread between runs; each test judges nine errors
and the NEES.
"""

from __future__ import annotations

from typing import Any

import pytest

import bottomlock
from bottomlock.config.scenario import load_scenario
from bottomlock.simulation.build import build_simulation
from tests.oracle import chi_squared

pytestmark = [pytest.mark.statistical, pytest.mark.slow]

SEED = 20261124
RUNS = 24
METHOD = "tc"
FAST = [(45.0, 0.0), (85.0, 90.0)]
WAYS = [(latitude, heading) for latitude in (0.0, 45.0, 70.0, 85.0) for heading in (0.0, 90.0, 225.0)]


def run(latitude_deg: float, heading_deg: float, runs: int, earth: str = "ellipsoid") -> dict[str, Any]:
    """Runs of the way, whose truth is on the ellipsoid; `earth` is what the filter takes it for."""
    scenario = load_scenario("long_way").replace("environment.latitude_deg", latitude_deg)
    simulation = build_simulation(scenario.replace("trajectory.heading_deg", heading_deg))
    truth = simulation.truth()
    schedule: Any = bottomlock.measurement_schedule(simulation, truth)
    schedule["sample_time_ns"] = schedule["sample_time_ns"][499::500]
    model = scenario.kernel_model(simulation.gravity_mps2)
    arrays: Any = truth.kernel_arrays()
    batch: Any = bottomlock.run_batch(
        simulation.geometry,
        arrays,
        model,
        model.replace(environment=model.environment.replace(earth=earth)),
        scenario.kernel_options(),
        schedule,
        [METHOD],
        seed=SEED,
        trajectory_key=31,
        first_run=0,
        runs=runs,
        threads=1,
    )
    return dict(batch)


@pytest.mark.parametrize(
    ("latitude_deg", "heading_deg"),
    [way if way in FAST else pytest.param(*way, marks=pytest.mark.long) for way in WAYS],
)
def test_claims_hold_after_fifty_kilometres(latitude_deg: float, heading_deg: float) -> None:
    """NEES of velocity and attitude in its band; no error of position, misalignment or velocity beyond its claim.

    Band of NEES at 99.8 %, of each error above at 99.9 %.
    """
    batch = run(latitude_deg, heading_deg, RUNS)
    nees = batch["nees_velocity_attitude"][:, 0]
    low, high = chi_squared.mean_band(nees.mean(axis=1), 6, 0.998)
    assert low < nees.mean() < high
    squares = (batch["error"][:, 0] / batch["sd"][:, 0])[..., :9] ** 2
    for state in range(9):
        most = chi_squared.mean_band(squares[..., state].mean(axis=1), 1.0, 0.998)[1]
        assert squares[..., state].mean() < most, f"state {state}"


def test_the_plane_of_the_paper_does_not_hold() -> None:
    """The same readings in a filter on the tangent plane: what this is for."""
    batch = run(45.0, 0.0, 4, earth="tangent_plane")
    assert batch["nees_velocity_attitude"][:, 0, -1].min() > 50.0
