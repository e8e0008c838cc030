"""The Earth's rate wherever the package forms it, on a vehicle that is fixed to the Earth at 45 degrees south.

By hand, level with the bow to the north: Ω/√2 = 5.156304e-5 rad/s forwards and as much downwards, where the
north has it upwards. Half an hour with the wrong sign is 10 degrees of heading.
"""

from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import bottomlock
from bottomlock.config.scenario import EARTH_RATE_RADPS, load_scenario
from bottomlock.dead_reckoning.sensors import Sensors, attitudes_of
from bottomlock.dead_reckoning.track import Velocities
from bottomlock.plant.flight import inertial_measurements
from bottomlock.recordings.attitude_motion import inertial_readings
from bottomlock.recordings.streams import Attitudes as RecordedAttitudes
from bottomlock.recordings.streams import Inertial
from bottomlock.replay.init.against_imu import turns
from bottomlock.simulation.analytic import Attitudes, ideal_inertial_readings
from tests.oracle import beams, truth
from tests.property import settings

LATITUDE_RAD, GRAVITY = -np.pi / 4, 9.8
RATE = np.array([5.156304e-5, 0.0, 5.156304e-5])
TIME_NS = np.arange(2001, dtype=np.int64) * 100_000_000
EARTH: dict[str, float] = {
    "latitude_rad": LATITUDE_RAD,
    "gravity_mps2": GRAVITY,
    "earth_rate_radps": EARTH_RATE_RADPS,
}
NONE = np.zeros((0, 3))


def start() -> bottomlock.InitialState:
    return bottomlock.InitialState(
        time_ns=0, position_t_m=np.zeros(3), attitude_t_p=[1.0, 0.0, 0.0, 0.0], velocity_p_mps=np.zeros(3)
    )


def model() -> Any:  # noqa: ANN401 - the kernel's model
    environment = bottomlock.Environment(**EARTH, earth="tangent_plane")
    return load_scenario("straight").kernel_model(GRAVITY).replace(environment=environment)


def readings() -> tuple[np.ndarray, np.ndarray]:
    """Rate and specific force of the vehicle at rest, by hand."""
    return np.tile(RATE, (len(TIME_NS), 1)), np.tile([0.0, 0.0, -GRAVITY], (len(TIME_NS), 1))


def test_ideal_sensors_read_it() -> None:
    """Of the analytic truth, of the simulated vehicle, and made from attitudes."""
    zero, still = np.zeros(3), np.zeros((3, 3))
    level = Attitudes(zero, zero, zero, zero, zero, zero, still, still)
    state = np.zeros((3, 13))
    state[:, 3] = 1.0
    made = inertial_readings(TIME_NS[:3], Rotation.identity(3), still, latitude_rad=LATITUDE_RAD)
    for omega, force in (
        ideal_inertial_readings(level, **EARTH),
        inertial_measurements(state, np.zeros((3, 6)), **EARTH),
        (made[0], made[1] - [0.0, 0.0, GRAVITY]),
    ):
        np.testing.assert_allclose(omega, np.tile(RATE, (3, 1)), atol=1e-11)
        np.testing.assert_allclose(force, np.tile([0.0, 0.0, -GRAVITY], (3, 1)), atol=1e-11)


def test_dead_reckoning_keeps_its_attitude() -> None:
    omega, force = readings()
    sensors = Sensors(
        imu_ns=TIME_NS[1:],
        omega_p_radps=omega[1:],
        force_p_mps2=force[1:],
        ping_ns=np.zeros(0, dtype=np.int64),
        beam_mps=np.zeros((0, 4)),
        beam_valid=np.zeros((0, 4), dtype=np.bool_),
        depths=None,
        attitudes=None,
        heading_ns=np.zeros(0, dtype=np.int64),
        heading_rad=np.zeros(0),
    )
    still = Velocities(np.zeros(0, dtype=np.int64), NONE, np.zeros((0, 3, 3)))
    found = attitudes_of(sensors, start(), model(), still)
    assert found.time_ns[-1] == TIME_NS[-1]
    # Half a step of the Earth's turn, 2.6e-6 rad, is in its level; the wrong sign would turn it by 0.02 rad.
    assert found.attitude.magnitude().max() < 1e-5


def test_gyros_are_compared_without_it() -> None:
    """Against a recorded attitude that swings in yaw the gyros of a first case have no offset."""
    omega, force = readings()
    seconds = TIME_NS * 1e-9
    attitude = Rotation.from_rotvec(np.outer(0.5 * np.sin(0.1 * seconds), [0.0, 0.0, 1.0]))
    omega = attitude.inv().apply(omega) + np.outer(0.05 * np.cos(0.1 * seconds), [0.0, 0.0, 1.0])
    inertial = Inertial(TIME_NS, force, omega)
    imu: Any = SimpleNamespace(time_ns=TIME_NS, omega_p_radps=omega, inertial=inertial)
    recorded: Any = SimpleNamespace(
        match=SimpleNamespace(clear=True), platform=lambda: RecordedAttitudes(TIME_NS, attitude)
    )
    gyros = turns(imu, recorded, 1.0, LATITUDE_RAD).gyros
    assert gyros is not None
    np.testing.assert_allclose(gyros.offset_radps, np.zeros(3), atol=1e-5)


def test_simulated_sensors_allow_for_it() -> None:
    """Averaged readings of an IMU without errors are means of the truth's; beams have nothing of the Earth's rate.

    The truth is another code's, and the DVL 10 m ahead.
    """
    arm = np.array([10.0, 0.0, 0.0])
    motion: Any = truth.make(
        truth.figure_eight_yaw, truth.dive_pitch, seconds=20, rate_hz=50.0, latitude_rad=LATITUDE_RAD
    )
    exact = settings.table_2()
    exact["environment"]["latitude_rad"] = LATITUDE_RAD
    exact |= {name: dict.fromkeys(exact[name], 0.0) for name in ("imu", "dvl")}
    read: Any = bottomlock.simulate_sensors(
        bottomlock.BeamGeometry(beams.x_janus(), lever_arms_p_m=np.tile(arm, (4, 1))), motion, exact,
        settings.schedule(20), seed=1, trajectory_key=1, run=0, imu_sampling="averaged",
    )  # fmt: skip
    for name, allowed in (("omega_p_radps", 1e-7), ("force_p_mps2", 2e-6)):
        means = 0.5 * (motion[name][1:] + motion[name][:-1])
        np.testing.assert_allclose(read[f"imu_{name}"][1:], means, atol=allowed)
    for row in range(20):
        k = 50 * (row + 1)
        earth_p = Rotation.from_quat(motion["attitude_t_p"][k], scalar_first=True).inv().apply(RATE)
        velocity = motion["velocity_p_mps"][k] + np.cross(motion["omega_p_radps"][k] - earth_p, arm)
        np.testing.assert_allclose(read["dvl_velocity_mps"][row], beams.x_janus() @ velocity, atol=1e-9)
