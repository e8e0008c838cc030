"""Actuators obey their limits, the mixer inverts, commands are those by hand, and the loop is stable."""

import numpy as np
import pytest

from bottomlock.plant import Vehicle
from bottomlock.plant.control import fin_mixing, pid, servo
from bottomlock.plant.maths import SCALAR
from bottomlock.plant.trim import eigenvalues
from tests.plant.helpers import GRAVITY_MPS2, finned


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
