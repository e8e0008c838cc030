"""The planner's predicted deviations against Monte Carlo with the kernel's own filter."""

import numpy as np
import pytest
from scipy.stats import chi2

from bottomlock.config.scenario import load_scenario
from bottomlock.kernel import BeamGeometry, run_batch
from bottomlock.observability.analysis import Aiding, deviations
from bottomlock.simulation.manoeuvres import MANOEUVRES, manoeuvre_truth

RUNS = 120


@pytest.mark.first_cases(2)
@pytest.mark.statistical
@pytest.mark.parametrize("name", ["figure_eight", "dive_and_turn", "straight"])
@pytest.mark.parametrize("beams", [(1, 2, 3, 4), (1, 2)])
def test_predicted_deviations_are_what_errors_scatter(name: str, beams: tuple[int, ...]) -> None:
    """Position, misalignment and velocity at the end: drawn errors lie in the chi-squared band of the prediction."""
    scenario = load_scenario("straight")
    environment = scenario.kernel_model(9.8125).environment
    truth = manoeuvre_truth(
        MANOEUVRES[name],
        rate_hz=150.0,
        latitude_rad=environment.latitude_rad,
        earth_rate_radps=environment.earth_rate_radps,
    )
    model = scenario.kernel_model(truth.gravity_mps2)
    janus = BeamGeometry.janus(np.deg2rad(20.0))
    predicted = deviations(truth, janus, Aiding(beams=beams), model)
    none = np.empty(0, dtype=np.int64)
    schedule = {
        "dvl_time_ns": predicted.time_ns,
        "beam_valid": np.tile(np.isin(np.arange(4) + 1, beams), (len(predicted.time_ns), 1)),
        "depth_time_ns": none,
        "magnetometer_time_ns": none,
        "gps_time_ns": none,
        "sample_time_ns": predicted.time_ns[-1:],
    }
    options = scenario.kernel_options().replace(gate="off")
    batch = run_batch(
        janus, truth.kernel_arrays(), model, model, options, schedule, ["tc"],  # type: ignore[arg-type]
        seed=2015, trajectory_key=1, first_run=0, runs=RUNS, threads=1,
    )  # fmt: skip
    scaled = batch["error"][:, 0, 0, :] / predicted.sd[-1, :9]
    # Nine components, a band of 99.9 % each.
    low, high = chi2.ppf([0.0005, 0.9995], RUNS)
    total = (scaled**2).sum(axis=0)
    assert (total > low).all(), total
    assert (total < high).all(), total
    # The filters linearise at their own estimates; their claimed σ scatter about the prediction.
    claimed = batch["sd"][:, 0, 0, :].mean(axis=0)
    np.testing.assert_allclose(claimed[3:], predicted.sd[-1, 3:9], rtol=0.03)
    # Two beams of a straight course leave 40 m to starboard, which a heading error turns into the course: second order.
    np.testing.assert_allclose(claimed[:3], predicted.sd[-1, :3], rtol=0.12)
