"""The prior of the vehicle's motion in a navigator: when it acts, and what it bounds."""

import numpy as np
import pytest

import bottomlock
from bottomlock.config.scenario import load_scenario

JANUS = bottomlock.BeamGeometry.janus(0.5)
VELOCITY = np.array([0.5, 0.05, -0.02])
PRIOR = bottomlock.Motion(
    mean_sd_mps=(0.5, 0.5, 0.5), change_sd_mps=(0.1, 0.1, 0.1), change_time_s=(40.0, 40.0, 40.0)
)


def navigator(prior: bottomlock.Motion) -> bottomlock.Navigator:
    """Level, looking north, at a constant velocity; accelerations are white noise of 0.2 m/s/√s."""
    scenario = load_scenario("straight")
    noise = bottomlock.ImuModel(
        accel_noise_mps_rts=0.2, gyro_noise_rad_rts=1e-5, accel_bias_sd_mps2=0.0, gyro_bias_sd_radps=0.0,
        accel_bias_walk_mps2_rts=0.0, gyro_bias_walk_radps_rts=0.0,
    )  # fmt: skip
    environment = bottomlock.Environment(latitude_rad=0.7, gravity_mps2=0.0)
    model = scenario.kernel_model(9.8).replace(imu=noise, environment=environment)
    options = scenario.kernel_options().replace(imu_sampling="averaged", motion=prior)
    start = bottomlock.InitialState(
        time_ns=0, position_t_m=(0.0, 0.0, 0.0), attitude_t_p=(1.0, 0.0, 0.0, 0.0), velocity_p_mps=tuple(VELOCITY)
    )  # fmt: skip
    return bottomlock.Navigator(JANUS, model, options, start, method="tc")


def fly(to: bottomlock.Navigator, from_s: int, to_s: int, beams: int) -> list[float]:
    """A ping a second with so many beams (none: the DVL is silent); times of the epochs of the prior, s."""
    found = []
    still = np.zeros(3)
    for step in range(from_s * 10 + 1, to_s * 10 + 1):
        time_ns = step * 100_000_000
        reports = []
        if step % 10 == 0 and beams:
            valid = np.arange(4) < beams
            readings = np.asarray(JANUS.beam_velocities(VELOCITY[None]))[0]
            reports += to.push_beams(time_ns, readings, valid, sd_mps=np.full(4, 0.01))
        reports += to.push_imu(time_ns, omega_p_radps=still, force_p_mps2=still)
        found += [report.time_ns * 1e-9 for report in reports if report.sensor == "motion"]
    return found


def velocity_sd(of: bottomlock.Navigator) -> float:
    """Largest 1 sigma of a velocity axis, m/s."""
    return float(np.sqrt(np.diag(of.covariance())[6:9].max()))


def test_whole_pings_are_learnt_from_now_and_then() -> None:
    """One epoch in twenty seconds while pings determine the velocity; more from two seconds after the last of them."""
    flown = navigator(PRIOR)
    learnt = [time for time in fly(flown, 0, 100, 4) if time > 1.0]
    assert learnt == pytest.approx([20.0, 40.0, 60.0, 80.0, 100.0])
    fly(flown, 100, 101, 0)
    # A random walk so far.
    assert velocity_sd(flown) == pytest.approx(0.2, rel=0.1)
    fly(flown, 101, 103, 0)
    assert velocity_sd(flown) < 0.1


def test_two_beams_are_no_whole_velocity() -> None:
    """Every ping of two beams is an epoch: the direction that they leave is that of the prior."""
    flown = navigator(PRIOR)
    fly(flown, 0, 10, 4)
    assert len(fly(flown, 10, 30, 2)) == pytest.approx(19, abs=1)
    assert velocity_sd(flown) < 0.12


def test_a_silent_dvl_leaves_the_velocity_bounded() -> None:
    """Five minutes without any event: 1 sigma of the velocity is that of the change, not of the white noise."""
    held, free = navigator(PRIOR), navigator(bottomlock.Motion())
    for one in (held, free):
        fly(one, 0, 120, 4)
        fly(one, 120, 420, 0)
    sd = {name: np.sqrt(np.diag(one.covariance())) for name, one in (("held", held), ("free", free))}
    assert sd["free"][6] == pytest.approx(0.2 * np.sqrt(300.0), rel=0.05)
    assert 0.1 < sd["held"][6] < 0.2
    assert sd["held"][0] < 0.1 * sd["free"][0]
    np.testing.assert_allclose(held.state()["velocity_p_mps"], VELOCITY, atol=0.1)
