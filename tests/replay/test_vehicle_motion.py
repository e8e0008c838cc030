"""The vehicle's motion as its pings show it: what was drawn is found."""

import numpy as np
import pytest

from bottomlock.errors import DataError
from bottomlock.replay.vehicle_motion import vehicle_motion
from tests.dive import gauss_markov


def drawn(seed: int, count: int, step_s: float, sd: float, time_s: float, white: float) -> np.ndarray:
    """(n,) a first-order process about 0.5 and white noise."""
    rng = np.random.default_rng(seed)
    return 0.5 + gauss_markov(sd * rng.normal(size=count), step_s, time_s) + white * rng.normal(size=count)


def test_what_was_drawn_is_found() -> None:
    """Five hours at 1 Hz: sigma, time and white noise of each axis to a fifth; the walk that starts a departure."""
    count = 18_000
    sd, time_s, white = (0.12, 0.05, 0.03), (40.0, 20.0, 80.0), (0.1, 0.02, 0.05)
    velocity = np.stack(
        [drawn(k, count, 1.0, *parts) for k, parts in enumerate(zip(sd, time_s, white, strict=True))], axis=1
    )
    found = vehicle_motion(np.arange(count) * 1_000_000_000, velocity)
    np.testing.assert_allclose(found.fluctuation_sd_mps, sd, rtol=0.2)
    np.testing.assert_allclose(found.fluctuation_time_s, time_s, rtol=0.4)
    np.testing.assert_allclose(found.white_sd_mps, white, rtol=0.1)
    np.testing.assert_allclose(found.mean_mps, 0.5, atol=0.05)
    walk = np.sqrt((2 * 0.12**2 / 40.0 + 2 * 0.05**2 / 20.0) / 2)
    assert found.accel_noise_mps_per_rt_s == pytest.approx(walk, rel=0.2)


def test_white_noise_is_no_acceleration() -> None:
    """A vehicle at a constant velocity: what is left is less than the noise of a ping over the longest time."""
    velocity = 0.05 * np.random.default_rng(3).normal(size=(5000, 3))
    found = vehicle_motion(np.arange(5000) * 500_000_000, velocity)
    np.testing.assert_allclose(found.white_sd_mps, 0.05, rtol=0.1)
    assert found.accel_noise_mps_per_rt_s < 0.01


def test_too_few_pings() -> None:
    with pytest.raises(DataError, match=r"12 pings .* give imu\.errors\.accel_noise_mps_per_rt_h"):
        vehicle_motion(np.arange(12) * 1_000_000_000, np.zeros((12, 3)))
