"""Inertial readings made from attitudes: with them the kernel flies the attitudes, and a velocity that persists."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import bottomlock
from bottomlock.config.imu import WEIGHTLESS_MPS2
from bottomlock.config.scenario import load_scenario
from bottomlock.recordings.attitude_motion import MotionFromAttitude, divided, held, inertial_readings

LATITUDE = 0.7


def attitudes(seed: int, count: int, step_rad: float) -> Rotation:
    """Attitudes far apart from one another."""
    rng = np.random.default_rng(seed)
    return Rotation.concatenate(
        [Rotation.from_rotvec(part) for part in np.cumsum(rng.normal(0.0, step_rad, (count, 3)), axis=0)]
    )


def navigator(attitude: Rotation, velocity: np.ndarray) -> bottomlock.Navigator:
    scenario = load_scenario("straight")
    model = scenario.kernel_model(9.8)
    environment = bottomlock.Environment(latitude_rad=LATITUDE, gravity_mps2=WEIGHTLESS_MPS2)
    return bottomlock.Navigator(
        bottomlock.BeamGeometry.janus(0.5),
        model.replace(environment=environment),
        scenario.kernel_options().replace(imu_sampling="averaged"),
        bottomlock.InitialState(
            time_ns=0,
            position_t_m=(0.0, 0.0, 0.0),
            attitude_t_p=np.roll(attitude.as_quat(), 1),
            velocity_p_mps=velocity,
        ),
        method="tc",
    )


@pytest.mark.parametrize("step_ns", [500_000_000, 4_500_000_000])
def test_the_strapdown_gives_attitudes_velocity_and_way(step_ns: int) -> None:
    """After turns of tens of degrees: attitude to rounding, velocity along the vehicle's axes, way by quadrature."""
    rough, velocity = attitudes(1, 30, 0.3), np.array([0.8, -0.2, 0.1])
    time_ns, attitude = divided(np.arange(30) * step_ns, rough)
    omega, force = inertial_readings(
        time_ns, attitude, np.tile(velocity, (len(time_ns), 1)), latitude_rad=LATITUDE
    )
    flown = navigator(attitude[0], velocity)
    flown.push_imu_block(time_ns, omega_p_radps=omega, force_p_mps2=force)
    state = flown.state()
    error = Rotation.from_quat(np.roll(state["attitude_t_p"], -1)) * attitude[-1].inv()
    assert error.magnitude() < 1e-12
    np.testing.assert_allclose(state["velocity_p_mps"], velocity, atol=2e-6)
    # A turn at a constant rate between the rough attitudes, in 200 chords each.
    way = np.zeros(3)
    for before, after in pairwise(rough):
        turn = (before.inv() * after).as_rotvec()
        middles = (np.arange(200) + 0.5) / 200
        way += (
            (before * Rotation.from_rotvec(middles[:, None] * turn)).apply(velocity).mean(axis=0)
            * step_ns
            * 1e-9
        )
    assert np.linalg.norm(state["position_t_m"] - way) < 2e-3 * np.linalg.norm(way)


def test_a_velocity_is_held_from_its_ping_on() -> None:
    """A step that begins before a ping has the velocity of the one before; before the first there is none."""
    velocity = np.array([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    time_ns = np.array([0, 10, 20, 30, 40, 50])
    assert held(time_ns, np.array([10, 35]), velocity)[:, 0].tolist() == [0, 0, 1, 1, 1, 2]


def test_a_filter_without_gravity_refuses_gravity() -> None:
    flown = navigator(Rotation.identity(), np.zeros(3))
    time_ns = np.arange(1, 200) * 10_000_000
    with pytest.raises(bottomlock.KernelError, match="without gravity"):
        flown.push_imu_block(
            time_ns, omega_p_radps=np.zeros((199, 3)), force_p_mps2=np.tile([0.0, 0.0, -9.8], (199, 1))
        )


def test_attitudes_as_they_come() -> None:
    """The readings of a navigator that is fed one attitude at a time are those of the whole log."""
    rough, velocity = attitudes(2, 12, 0.1), np.array([0.6, 0.1, -0.1])
    time_ns = 1_618_087_343_372_070_000 + np.arange(12) * 450_000_000
    motion = MotionFromAttitude(LATITUDE)
    motion.hold(velocity)
    blocks = [motion.block(int(t), np.roll(r.as_quat(), 1)) for t, r in zip(time_ns, rough, strict=True)]
    assert [len(block["time_ns"]) for block in blocks] == [0] + [5] * 11
    times, attitude = divided(time_ns, rough)
    omega, force = inertial_readings(
        times, attitude, np.tile(velocity, (len(times), 1)), latitude_rad=LATITUDE
    )
    np.testing.assert_array_equal(np.concatenate([block["time_ns"] for block in blocks]), times[1:])
    np.testing.assert_allclose(
        np.concatenate([block["omega_p_radps"] for block in blocks]), omega[1:], atol=1e-8
    )
    np.testing.assert_allclose(
        np.concatenate([block["force_p_mps2"] for block in blocks]), force[1:], atol=1e-8
    )
