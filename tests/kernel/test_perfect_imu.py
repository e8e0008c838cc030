"""A perfect IMU returns the truth: the product's strapdown against truths that the tests build themselves."""

import numpy as np
import pytest

import bottomlock
from tests.analytic import analytic
from tests.oracle import truth
from tests.oracle.mechanisation import earth_rate_tangent, integrate
from tests.oracle.rotations import Array, log_rotation, matrix_from_quaternion
from tests.property import settings


def lead(motion: dict[str, Array]) -> bottomlock.Navigator:
    """The INS alone, fed the ideal readings from the true start."""
    start = bottomlock.InitialState(
        time_ns=0,
        position_t_m=motion["position_t_m"][0],
        attitude_t_p=motion["attitude_t_p"][0],
        velocity_p_mps=motion["velocity_p_mps"][0],
    )
    options = settings.options(covariance_period_ns=1_000_000_000)
    nav = bottomlock.Navigator(
        bottomlock.BeamGeometry.janus(0.35), settings.table_2(), options, start, method="ins"
    )
    nav.push_imu_block(
        motion["time_ns"], omega_p_radps=motion["omega_p_radps"], force_p_mps2=motion["force_p_mps2"]
    )
    return nav


def turn_between(q: Array, other: Array) -> float:
    """Angle between two attitudes, rad."""
    return float(np.linalg.norm(log_rotation(matrix_from_quaternion(q) @ matrix_from_quaternion(other).T)))


def test_truth_comes_back_after_250_s() -> None:
    """Within 1 cm and 1e-6 rad after 250 s at 150 Hz, Earth rate and dive included."""
    motion = truth.make(yaw=truth.figure_eight_yaw, pitch=truth.dive_pitch)
    state = lead(motion).state()
    assert np.linalg.norm(state["position_t_m"] - motion["position_t_m"][-1]) < 0.01
    assert turn_between(state["attitude_t_p"], motion["attitude_t_p"][-1]) < 1e-6


@pytest.mark.parametrize(
    ("name", "latitude_deg"),
    [(name, 32.8) for name in ("straight", "figure_eight", "lawn_mower", "constant_turn")]
    + [("figure_eight", -45.0)],
)
def test_packaged_truth_obeys_the_differential_equation(name: str, latitude_deg: float) -> None:
    """The package's own truths, 40 s of each, through an eighth-order integrator that shares no code with them."""
    from scipy.interpolate import CubicSpline

    scenario = analytic(name).replace({"environment.latitude_deg": latitude_deg})
    motion = bottomlock.analytic_truth(scenario, settings.GRAVITY)
    last = 40 * 150
    t = motion.time_ns[: last + 20] * 1e-9
    rate = CubicSpline(t, motion.omega_p_radps[: last + 20])
    force = CubicSpline(t, motion.force_p_mps2[: last + 20])
    # The integrator stops where a smooth input changes its shape, so it is led from second to second.
    state = (motion.position_t_m[0], motion.attitude_t_p[0], motion.velocity_p_mps[0])
    earth = earth_rate_tangent(np.deg2rad(latitude_deg))
    for k in range(0, last, 750):
        end = integrate(state, rate, force, settings.GRAVITY, earth, t[[k, k + 750]])
        state = (end.position[-1], end.quaternion[-1], end.velocity[-1])
    assert np.linalg.norm(state[0] - motion.position_t_m[last]) < 1e-4
    assert turn_between(state[1], motion.attitude_t_p[last]) < 1e-7
    np.testing.assert_allclose(state[2], motion.velocity_p_mps[last], atol=1e-5)
