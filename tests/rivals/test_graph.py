"""The factor graph against the kernel and against differences. gtsam is installed by `make test-others` alone."""
# ruff: noqa: ANN401 - what is imported only where it is installed has no types here

from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bottomlock.config.scenario import Scenario, load_scenario

gtsam = pytest.importorskip("gtsam", reason="gtsam is installed for the rivals alone")
factor_graph: Any = import_module("benches.rivals.factor_graph")
beam_factors: Any = import_module("benches.rivals.beam_factors")
missions: Any = import_module("benches.rivals.scenario_missions")

STATE, BIAS, INSTRUMENT = 1, 2, 3


def short(duration_s: float, *lost: int) -> Scenario:
    scenario = load_scenario("straight").with_trajectory(duration_s=duration_s)
    return scenario.replace({"dvl.beams_lost": list(lost), "filter.gate": "off"})


def nearly_linear(mission: Any) -> Any:
    """The mission with errors of attitude and scale factor so small that no product of errors counts."""
    model = mission.model
    model = model.replace(
        initial=model.initial.replace(attitude_sd_rad=[1e-5] * 3),
        imu=model.imu.replace(gyro_noise_rad_rts=1e-7, gyro_bias_sd_radps=1e-9),
        dvl=model.dvl.replace(scale_factor_sd=1e-6, scale_factor_walk_rts=0.0),
    )
    return replace(mission, model=model)


@pytest.mark.parametrize("lost", [(), (3, 4), (2, 3, 4)])
def test_a_linear_graph_is_the_filter(lost: tuple[int, ...]) -> None:
    """Marginalised factors of a linear Gaussian system are a Kalman filter: mean and covariance."""
    mission = nearly_linear(missions.scenario_mission(short(20.0, *lost)))
    expected = missions.tightly_coupled(mission, covariance_period_ns=0)
    found = factor_graph.estimate(mission, lag_s=5.0)
    sd = np.sqrt(np.diagonal(expected.velocity_cov, axis1=1, axis2=2))
    np.testing.assert_array_less(np.abs(found.velocity_p_mps - expected.velocity_p_mps), 0.01 * sd)
    found_sd = np.sqrt(np.diagonal(found.velocity_cov, axis1=1, axis2=2))
    np.testing.assert_allclose(found_sd, sd, rtol=5e-3)
    position_sd = np.sqrt(np.diagonal(expected.position_cov, axis1=1, axis2=2))
    np.testing.assert_array_less(np.abs(found.position_t_m - expected.position_t_m), 0.01 * position_sd)
    found_position_sd = np.sqrt(np.diagonal(found.position_cov, axis1=1, axis2=2))
    np.testing.assert_allclose(found_position_sd, position_sd, rtol=5e-3)


def test_without_aiding_it_is_the_strapdown_solution() -> None:
    """Gravity down and the turning Earth: 30 s of preintegration against the kernel's steps."""
    mission = missions.scenario_mission(short(30.0, 1, 2, 3, 4))
    expected = missions.tightly_coupled(mission, "ins")
    found = factor_graph.estimate(mission, held_start=False)
    np.testing.assert_allclose(found.velocity_p_mps, expected.velocity_p_mps, rtol=0.0, atol=1e-4)
    np.testing.assert_allclose(found.position_t_m, expected.position_t_m, rtol=0.0, atol=3e-3)
    still = mission.model.environment.replace(earth_rate_radps=0.0)
    without_earth = factor_graph.estimate(
        replace(mission, model=mission.model.replace(environment=still)), held_start=False
    )
    assert np.abs(without_earth.velocity_p_mps - expected.velocity_p_mps).max() > 1e-3


def test_the_covariance_of_the_start_by_axes() -> None:
    """Position by north, east and down, velocity by surge, sway and heave, at 1 rad of yaw, as the kernel has them."""
    mission = missions.scenario_mission(short(3.0, 1, 2, 3, 4))
    yaw, base = Rotation.from_rotvec([0.0, 0.0, 1.0]), mission.start.attitude_t_p
    attitude = (yaw * Rotation.from_quat(base, scalar_first=True)).as_quat(scalar_first=True)
    initial = mission.model.initial.replace(
        position_sd_m=[1.0, 2.0, 3.0], velocity_sd_mps=[0.01, 0.02, 0.03], attitude_sd_rad=[0.01, 0.02, 0.03]
    )
    mission = replace(
        mission,
        model=mission.model.replace(initial=initial),
        start=replace(mission.start, attitude_t_p=attitude),
    )
    expected = missions.tightly_coupled(mission, "ins", covariance_period_ns=0)
    found = factor_graph.estimate(mission, held_start=False)
    for ours, theirs in (
        (found.velocity_cov, expected.velocity_cov),
        (found.position_cov, expected.position_cov),
    ):
        scale = np.abs(theirs).max(axis=(1, 2), keepdims=True)
        assert np.abs((ours - theirs) / scale).max() < 1e-3


def factor(name: str) -> tuple[Any, list[int]]:
    noise = gtsam.noiseModel.Unit.Create(1)
    lever = np.array([0.4, -0.3, 0.2])
    if name == "depth":
        return beam_factors.depth_factor(STATE, INSTRUMENT, 18.0, lever, 6, 1.0), [STATE, INSTRUMENT]
    if name == "heading":
        return beam_factors.heading_factor(STATE, INSTRUMENT, 3.1, range(2, 4), 6, 1.0), [STATE, INSTRUMENT]
    if name == "velocity":
        noise = gtsam.noiseModel.Unit.Create(3)
        return beam_factors.velocity_factor(STATE, np.array([1.0, 0.2, -0.1]), noise), [STATE]
    if name == "walk":
        sd, decay = np.ones(6), np.linspace(0.5, 1.0, 6)
        return beam_factors.walk_factor(INSTRUMENT, INSTRUMENT + 1, decay, sd), [INSTRUMENT, INSTRUMENT + 1]
    made = beam_factors.beam_factor(
        (STATE, BIAS, INSTRUMENT),
        0.7,
        np.array([0.36, -0.48, 0.8]),
        lever if name == "beam with lever arm" else np.zeros(3),
        np.array([0.1, -0.2, 0.3]),
        # As fast a turn as shows its Jacobian.
        np.array([0.05, 0.0, -0.08]),
        bias_row=1,
        size=6,
        noise=noise,
    )
    keys = [STATE, INSTRUMENT, BIAS] if name == "beam with lever arm" else [STATE, INSTRUMENT]
    return made, keys


@pytest.mark.parametrize("name", ["beam", "beam with lever arm", "depth", "heading", "velocity", "walk"])
def test_jacobians_by_differences(name: str) -> None:
    made, keys = factor(name)
    rotation = gtsam.Rot3.Ypr(-3.0, 0.5, -0.4)
    state = gtsam.NavState(rotation, np.array([10.0, 20.0, 30.0]), np.array([1.5, -0.7, 0.4]))
    instrument = np.array([0.01, -0.02, 0.03, 0.04, 0.1, -0.3])

    def values(moved: int = 0, step: Any = None) -> Any:
        out = gtsam.Values()
        out.insert(STATE, state.retract(step) if moved == STATE else state)
        out.insert(BIAS, _bias(step) if moved == BIAS else _bias(np.zeros(6)))
        for key in (INSTRUMENT, INSTRUMENT + 1):
            out.insert(key, instrument + step if moved == key else instrument)
        return out

    jacobian = np.asarray(made.linearize(values()).jacobian()[0])
    sizes = {STATE: 9, BIAS: 6}
    ordered = np.hstack([jacobian])
    start, half = 0, 1e-5
    for key in keys:
        for column in range(sizes.get(key, 6)):
            step = half * np.eye(sizes.get(key, 6))[column]
            ahead, behind = (made.unwhitenedError(values(key, side * step)) for side in (1.0, -1.0))
            np.testing.assert_allclose(
                ordered[:, start + column], (ahead - behind) / (2.0 * half), rtol=1e-6, atol=1e-8
            )
        start += sizes.get(key, 6)


def test_student_t_weights_a_beam() -> None:
    """The weight (ν + 1)/(ν + x²) over σ², by the factor's whitened Jacobian and error."""
    robust = load_scenario("survey_table2").kernel_options().robust
    assert robust is not None
    noise, sd = factor_graph._beam_noise(robust, 0.02), 0.02
    for x in (0.0, 1.0, 8.0):
        made = gtsam.CustomFactor(noise, [STATE], lambda *_, x=x: _linear(*_, offset=x * sd))
        values = gtsam.Values()
        values.insert(STATE, np.zeros(1))
        information = float(np.square(made.linearize(values).jacobian()[0]).item())
        degrees = robust.student_t_degrees
        assert information == pytest.approx((degrees + 1.0) / (degrees + x**2) / sd**2, rel=1e-9)


def _bias(step: Any) -> Any:
    return gtsam.imuBias.ConstantBias(
        np.array([0.01, 0.02, 0.03]) + step[:3], np.array([0.02, -0.01, 0.03]) + step[3:]
    )


def _linear(_: Any, values: Any, jacobians: Any, *, offset: float) -> Any:
    if jacobians is not None:
        jacobians[0] = np.eye(1, order="F")
    return values.atVector(STATE) + offset
