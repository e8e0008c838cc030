"""A perfect IMU returns the truth: the product's strapdown against truths that the tests build themselves."""

import numpy as np

import bottomlock
from tests.oracle import truth
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
