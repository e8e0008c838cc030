"""An ensemble in a Gaussian world: the filters that claim to be consistent are."""

import numpy as np
import pytest
from scipy.stats import chi2

from benches.rivals import adaptive, error_state, invariant, unscented
from benches.rivals.convergence import world
from benches.rivals.development import mission_along
from bottomlock.simulation.build import build_simulation
from partialdvl_bench.mission import Estimates, Mission

RUNS, DURATION_S = 40, 60.0


@pytest.fixture(scope="module")
def missions() -> list[Mission]:
    simulation = build_simulation(world(DURATION_S))
    truth = simulation.truth()
    return [mission_along(simulation, truth, run=run) for run in range(RUNS)]


def final_nees(mission: Mission, answer: Estimates) -> tuple[float, float]:
    """Of velocity and position at the end, three degrees each."""
    assert mission.truth is not None
    assert answer.position_t_m is not None
    assert answer.position_cov is not None
    velocity = (mission.truth.velocity_p_mps - answer.velocity_p_mps)[-1]
    position = (mission.truth.position_t_m - answer.position_t_m)[-1]
    return (
        float(velocity @ np.linalg.solve(answer.velocity_cov[-1], velocity)),
        float(position @ np.linalg.solve(answer.position_cov[-1], position)),
    )


@pytest.mark.long
@pytest.mark.statistical
@pytest.mark.parametrize("rival", [error_state, invariant, unscented, adaptive])
def test_nees_in_its_band(rival, missions: list[Mission]) -> None:  # type: ignore[no-untyped-def]  # noqa: ANN001
    """Mean over runs within the 99.9 % interval of chi-squared, for starts drawn from the claimed covariance."""
    nees = np.array([final_nees(mission, rival.estimate(mission)) for mission in missions])
    low, high = chi2.ppf([0.0005, 0.9995], 3 * RUNS) / RUNS
    assert ((low < nees.mean(axis=0)) & (nees.mean(axis=0) < high)).all(), nees.mean(axis=0)
