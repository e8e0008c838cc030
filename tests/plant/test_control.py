"""Actuators obey their limits, the mixer inverts, and the four controllers answer steps as documented."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from bottomlock.plant import Vehicle, model, straight, swim
from bottomlock.plant.autopilot import Mixer, attitude_pid, fin_commands, fin_servo, speed_pid, thruster
from bottomlock.plant.maths import SCALAR, FloatArray
from bottomlock.plant.mission import DepthProfile, Mission
from bottomlock.plant.path import PathBuilder
from bottomlock.plant.telemetry import euler_rad
from bottomlock.plant.trim import eigenvalues, start_state
from tests.plant.helpers import GRAVITY_MPS2, finned, pilot

angles = hnp.arrays(np.float64, 3, elements=st.floats(-0.4, 0.4))


@given(st.sampled_from(["tauv", "remus100"]), angles)
def test_mixing_inverts(name: str, modes: FloatArray) -> None:
    """+ or x: what the mixer gives to four fins comes back as roll, pitch and yaw."""
    mixer = Mixer.of(finned(name))
    assert np.allclose(mixer.modes_rad(mixer.fins_rad(modes)), modes, atol=1e-12)
    assert np.allclose(fin_commands(finned(name))(*modes.tolist()), mixer.fins_rad(modes), atol=1e-12)


def test_servo_lags_saturates_and_is_rate_limited(tauv: Vehicle) -> None:
    servo, limits = fin_servo(tauv, SCALAR), tauv.fin_actuator
    assert servo(0.05, 0.04) == pytest.approx(0.01 / limits.time_constant)
    assert servo(0.4, -0.4) == pytest.approx(limits.max_rate)
    assert servo(9.0, limits.max_deflection) == pytest.approx(0.0)
    assert servo(-9.0, -limits.max_deflection) == pytest.approx(0.0)


def test_thruster_lags_and_is_limited(tauv: Vehicle) -> None:
    motor, prop = thruster(tauv, SCALAR), tauv.propeller
    assert motor(10.5, 10.0) == pytest.approx(0.5 / prop.time_constant)
    assert motor(30.0, 0.0) == pytest.approx(prop.max_acceleration)
    assert motor(1e9, prop.max_speed) == pytest.approx(0.0)


def test_fins_stay_within_their_limits_in_a_hard_turn(tauv: Vehicle) -> None:
    path = PathBuilder().line(20.0).arc(4.0, np.pi).line(60.0)
    mission = Mission("hairpin", tuple(path.segments), DepthProfile(((0.0, 20.0),)), 2.0, 40.0)
    history = swim(tauv, mission, gravity_mps2=GRAVITY_MPS2)
    limits = tauv.fin_actuator
    fins = history.state[:, model.FINS]
    assert np.abs(fins).max() <= limits.max_deflection + 1e-9
    assert np.abs(np.diff(fins, axis=0)).max() * 150.0 <= limits.max_rate * 1.02


def test_integrators_do_not_wind_up(tauv: Vehicle) -> None:
    """Held at its limit for a minute, the integral settles at a bounded value instead of running away."""
    for control, arguments, ceiling in (
        (attitude_pid(tauv.autopilot.yaw, SCALAR), (1.0, 0.0), 3.0),
        (attitude_pid(tauv.autopilot.roll, SCALAR), (1.0, 0.0), 3.0),
    ):
        integral = 0.0
        for _ in range(6000):
            given_angle, rate, _ = control(*arguments, integral, 0.0, 1.0)
            integral += 0.01 * rate
        assert given_angle == pytest.approx(tauv.autopilot.yaw.limit, rel=0.7)
        assert abs(integral) < ceiling * 10.0
        assert abs(rate) < 1e-4
    speed = speed_pid(tauv.autopilot.speed, tauv.propeller.max_speed, SCALAR)
    integral = 0.0
    for _ in range(6000):
        shaft, rate, _ = speed(3.0, 2.0, 0.0, integral, 0.0)
        integral += 0.01 * rate
    assert shaft == pytest.approx(tauv.propeller.max_speed)
    assert abs(rate) < 1e-4


@pytest.mark.parametrize("name", ["tauv", "remus100"])
def test_the_loop_is_stable_over_the_speed_range(name: str) -> None:
    """Slow motions (below 3 rad/s) are damped with a ratio of at least 0.15, fast ones decay."""
    vehicle = finned(name)
    for speed in np.linspace(vehicle.limits.min_speed, vehicle.limits.max_speed, 5):
        values = eigenvalues(vehicle, float(speed), GRAVITY_MPS2, closed_loop=True)
        assert values.real.max() < -0.02
        slow = values[np.abs(values) < 3.0]
        assert (-slow.real / np.abs(slow)).min() > 0.15


def _step_response(time_s: FloatArray, response: FloatArray, final: float) -> tuple[float, float, float]:
    """Overshoot as a share of the step, the time after which it stays within 5 %, and the last error."""
    start = response[0]
    scaled = (response - start) / (final - start)
    outside = np.flatnonzero(np.abs(scaled - 1.0) > 0.05)
    settled = float(time_s[min(outside[-1] + 1, len(time_s) - 1)]) if len(outside) else 0.0
    return float(scaled.max() - 1.0), settled, float(abs(response[-1] - final))


def _far_sighted(vehicle: Vehicle) -> Vehicle:
    """Look so far ahead that line of sight commands the path's heading alone, and never mind the depth."""
    guidance = vehicle.guidance.model_copy(update={"look_ahead": 1e6, "crab_time_constant": 1e6})
    return vehicle.model_copy(update={"guidance": guidance})


def test_heading_step(tauv: Vehicle) -> None:
    """20 deg: overshoot at most 20 %, settled within 15 s, no steady error."""
    vehicle = _far_sighted(tauv)
    state = start_state(vehicle, straight(), GRAVITY_MPS2)
    path = PathBuilder(heading_rad=np.deg2rad(20.0)).line(500.0)
    mission = replace(straight(), segments=tuple(path.segments))
    time, track = pilot(vehicle, mission, state, duration_s=60.0)
    yaw = euler_rad(track[:, 3:7])[:, 2]
    overshoot, settling, error = _step_response(time, yaw, np.deg2rad(20.0))
    assert overshoot < 0.20
    assert settling < 15.0
    assert error < np.deg2rad(0.2)


def test_depth_step(tauv: Vehicle) -> None:
    """5 m deeper by pitch command: overshoot at most 25 %, within 5 % after 40 s, no steady error."""
    mission = replace(straight(), depth=DepthProfile(((0.0, 25.0),)))
    state = start_state(tauv, straight(), GRAVITY_MPS2)
    time, track = pilot(tauv, mission, state, duration_s=120.0)
    overshoot, settling, error = _step_response(time, track[:, 2], 25.0)
    assert overshoot < 0.25
    assert settling < 40.0
    assert error < 0.05
    assert np.abs(euler_rad(track[:, 3:7])[:, 1]).max() <= tauv.guidance.max_pitch * 1.1


def test_speed_step(tauv: Vehicle) -> None:
    """From 1.5 to 2 m/s: overshoot at most 15 %, settled within 12 s, no steady error."""
    state = start_state(tauv, straight(speed_mps=1.5), GRAVITY_MPS2)
    time, track = pilot(tauv, straight(), state, duration_s=60.0)
    speed = np.linalg.norm(track[:, 7:10], axis=1)
    overshoot, settling, error = _step_response(time, speed, 2.0)
    assert overshoot < 0.15
    assert settling < 12.0
    assert error < 0.005
