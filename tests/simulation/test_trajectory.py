"""Analytic truth: a perfect IMU returns it, and it moves as its scenario says."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.errors import DataError
from bottomlock.simulation.analytic import analytic_truth
from bottomlock.simulation.build import Simulation, build_simulation, closure
from bottomlock.truth import Truth
from tests.analytic import analytic, analytic_simulation

NAMES = ("straight", "figure_eight", "lawn_mower", "constant_turn")
FLOWN = build_simulation(load_scenario("lawn_mower").with_trajectory(duration_s=100.0))


def truth_of(name: str) -> tuple[Scenario, Truth]:
    simulation = analytic_simulation(name)
    return simulation.scenario, simulation.truth()


@pytest.mark.parametrize("simulation", [*map(analytic_simulation, NAMES), FLOWN])
def test_perfect_imu_returns_the_truth(simulation: Simulation) -> None:
    """Position within 1 cm and attitude within 1e-6 rad after 250 s; also of a vehicle that dives and turns."""
    position_m, attitude_rad = closure(simulation, simulation.truth())
    assert position_m < 0.01
    assert attitude_rad < 1e-6


def readings_agree(truth: Truth, gravity_t: NDArray[np.float64]) -> None:
    """An independent look: rates and forces from differences of attitude and velocity, not from the formulas."""
    earth_t = 7.292115e-5 * np.array([np.cos(truth.latitude_rad), 0.0, -np.sin(truth.latitude_rad)])
    turns = Rotation.from_quat(truth.attitude_t_p[:, [1, 2, 3, 0]])
    velocity_t = turns.apply(truth.velocity_p_mps)
    for k in range(100, len(truth.time_ns) - 100, 997):
        dt = (truth.time_ns[k + 1] - truth.time_ns[k - 1]) * 1e-9
        rate = (turns[k - 1].inv() * turns[k + 1]).as_rotvec() / dt
        assert truth.omega_p_radps[k] == pytest.approx(rate + turns[k].inv().apply(earth_t), abs=2e-6)
        accel = (velocity_t[k + 1] - velocity_t[k - 1]) / dt
        force_t = accel + 2.0 * np.cross(earth_t, velocity_t[k]) - gravity_t[k]
        assert turns[k].apply(truth.force_p_mps2[k]) == pytest.approx(force_t, abs=2e-5)
        step = (truth.position_t_m[k + 1] - truth.position_t_m[k - 1]) / dt
        assert velocity_t[k] == pytest.approx(step, abs=2e-5)


@pytest.mark.parametrize("name", NAMES)
def test_readings_agree_with_differences_of_the_states(name: str) -> None:
    _, truth = truth_of(name)
    readings_agree(truth, np.tile([0.0, 0.0, truth.gravity_mps2], (len(truth.time_ns), 1)))


def test_figure_eight_closes_and_dives() -> None:
    """One circle each way at a constant dive rate: heading comes back, depth grows by v sin(5 deg) t."""
    _, truth = truth_of("figure_eight")
    yaw, pitch, _ = Rotation.from_quat(truth.attitude_t_p[-1][[1, 2, 3, 0]]).as_euler("ZYX", degrees=True)
    assert yaw == pytest.approx(0.0, abs=1e-6)
    assert pitch == pytest.approx(-5.0)
    assert np.hypot(*truth.position_t_m[-1, :2]) < 30.0
    assert 40.0 < truth.position_t_m[-1, 2] < 45.0


def test_lawn_mower_dives_first_then_mows_level() -> None:
    """The dive ends at 30 s; each turn is a half turn; depth is then constant."""
    _, truth = truth_of("lawn_mower")
    level = truth.time_ns >= 30 * 10**9
    assert np.ptp(truth.position_t_m[level, 2]) < 1e-9
    yaw = np.unwrap(Rotation.from_quat(truth.attitude_t_p[:, [1, 2, 3, 0]]).as_euler("ZYX")[:, 0])
    for second, heading in ((69, 0.0), (91, 180.0), (151, 0.0)):
        assert np.rad2deg(yaw[second * 150]) == pytest.approx(heading, abs=1e-6)


def test_truth_refuses_nonsense() -> None:
    """Wrong shapes, disorder in time, and quaternions that are none are named with their row."""
    _, truth = truth_of("straight")
    arrays = {name: value[:5] for name, value in truth.kernel_arrays().items() if name != "time_ns"}

    def make(times: list[int] | list[float], **change: NDArray[np.float64]) -> Truth:
        return Truth(time_ns=np.array(times), latitude_rad=0.5, gravity_mps2=9.8, **(arrays | change))

    make([0, 1, 2, 3, 4])
    with pytest.raises(DataError, match="does not increase at row 2"):
        make([0, 1, 1, 3, 4])
    with pytest.raises(DataError, match="one-dimensional int64 array"):
        make([0.0, 1.0, 2.0, 3.0, 4.0])
    with pytest.raises(DataError, match=r"velocity_p_mps has shape \(4, 3\)"):
        make([0, 1, 2, 3, 4], velocity_p_mps=arrays["velocity_p_mps"][:4])
    with pytest.raises(DataError, match="norm 2 at row 0"):
        make([0, 1, 2, 3, 4], attitude_t_p=2.0 * arrays["attitude_t_p"])
    with pytest.raises(DataError, match="not finite at row 0"):
        make([0, 1, 2, 3, 4], force_p_mps2=np.full((5, 3), np.nan))


def test_an_impossible_turn_is_rejected() -> None:
    """Sideslip as large as the speed, and a half turn shorter than its blends."""
    scenario = analytic("lawn_mower")
    for change, message in (
        ({"turn_s": 8.0}, "turn_s"),
        ({"sway_gain_m": 10.0}, "sway_gain_m"),
        ({"dive_s": 2.0}, "dive_s"),
    ):
        settings = scenario.trajectory.model_copy(update=change)
        with pytest.raises(DataError, match=message):
            analytic_truth(scenario.model_copy(update={"trajectory": settings}), 9.8)
