"""Actuators obey their limits, the mixer inverts, and the four controllers answer steps as documented."""

from dataclasses import replace

import numpy as np
import pytest

from bottomlock.plant import Vehicle, model, straight, swim
from bottomlock.plant.control import fin_mixing, pid, servo
from bottomlock.plant.flight import euler_rad
from bottomlock.plant.maths import SCALAR, FloatArray
from bottomlock.plant.mission import DepthProfile, Mission
from bottomlock.plant.path import PathBuilder
from bottomlock.plant.trim import eigenvalues, start_state
from tests.plant.helpers import GRAVITY_MPS2, finned, pilot


@pytest.mark.parametrize("name", ["tauv", "remus100"])
def test_mixing_is_orthogonal(name: str) -> None:
    """+ or x: a command in roll, pitch or yaw does nothing to the other two; the rows are of unit pitch and yaw."""
    mixing = fin_mixing(finned(name))
    assert np.allclose(mixing.T @ mixing, np.diag([4.0, 2.0, 2.0]), atol=1e-12)


def test_servo_lags_saturates_and_is_rate_limited() -> None:
    """A fin of 0.35 rad, 0.5 rad/s and 0.2 s by hand: the command is clipped, the lag divided, the rate clipped."""
    rate = servo(0.35, 0.5, 0.2, SCALAR)
    assert rate(0.05, 0.04) == pytest.approx(0.05)
    assert rate(0.4, -0.4) == pytest.approx(0.5)
    assert rate(-0.4, 0.4) == pytest.approx(-0.5)
    assert rate(9.0, 0.35) == pytest.approx(0.0)
    assert rate(-9.0, -0.35) == pytest.approx(0.0)


def test_fins_stay_within_their_limits_in_a_hard_turn(tauv: Vehicle) -> None:
    path = PathBuilder().line(20.0).arc(4.0, np.pi).line(60.0)
    mission = Mission("hairpin", path.segments, DepthProfile(((0.0, 20.0),)), 2.0, 40.0)
    history = swim(tauv, mission, gravity_mps2=GRAVITY_MPS2)
    limits = tauv.fin_actuator
    fins = history.state[:, model.FINS]
    assert np.abs(fins).max() <= limits.max_deflection + 1e-9
    assert np.abs(np.diff(fins, axis=0)).max() * 150.0 <= limits.max_rate * 1.02


def test_integrators_do_not_wind_up(tauv: Vehicle) -> None:
    """Held at its limit for a minute, the integral settles at a bounded value instead of running away."""
    pilot = tauv.autopilot
    for gains, low, high, error, forward in (
        (pilot.yaw, -pilot.yaw.limit, pilot.yaw.limit, 1.0, 0.0),
        (pilot.roll, -pilot.roll.limit, pilot.roll.limit, 1.0, 0.0),
        (pilot.speed, 0.0, tauv.propeller.max_speed, 2.0, 3.0 * pilot.speed.feed_forward),
    ):
        control, integral = pid(gains, low, high, SCALAR), 0.0
        for _ in range(6000):
            given, rate = control(error, 0.0, integral, 1.0, forward)
            integral += 0.01 * rate
        assert given == pytest.approx(high)
        assert abs(integral) < 30.0
        assert abs(rate) < 1e-4


def test_command_of_a_controller_by_hand(tauv: Vehicle) -> None:
    """Error 0.1, its rate 0.02 and integral 0.3: (3 + 2 0.1 + 0.5 0.3 + 0.25 0.02) 0.8, far from the limits."""
    chosen = {"proportional": 2.0, "integral": 0.5, "derivative": 0.25, "tracking_time": 2.0}
    control = pid(tauv.autopilot.yaw.model_copy(update=chosen), -9.0, 9.0, SCALAR)
    assert control(0.1, 0.02, 0.3, 0.8, 3.0) == pytest.approx((2.684, 0.1))
    # beyond the limit of 2 the integral is driven back: 0.1 + (2 - 2.684) / 0.8 / (2 s 0.5)
    limited = pid(tauv.autopilot.yaw.model_copy(update=chosen), -2.0, 2.0, SCALAR)
    assert limited(0.1, 0.02, 0.3, 0.8, 3.0) == pytest.approx((2.0, 0.1 - 0.684 / 0.8))


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
    mission = replace(straight(), segments=path.segments)
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
