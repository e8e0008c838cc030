"""Waves in a depth: found where the accelerometers do not feel them, with size and period, and nowhere else."""

import numpy as np
import pytest

from bottomlock.replay.init.depth_part import find_waves


@pytest.mark.parametrize("rate_hz", [1.0, 4.0])
@pytest.mark.parametrize(
    ("wave_m", "period_s", "heave_m", "noise_m"),
    [(0.35, 8.0, 0.2, 0.03), (0.35, 12.0, 0.0, 0.03), (0.0, 8.0, 0.3, 0.03), (0.0, 8.0, 0.0, 0.2)],
    ids=["waves and heave", "swell", "heave alone", "noise alone"],
)
def test_waves_are_what_is_not_felt(
    wave_m: float, period_s: float, heave_m: float, noise_m: float, rate_hz: float
) -> None:
    """Of a vehicle that dives by metres, and heaves with a period of 8 s, its accelerometers biased and noisy."""
    random = np.random.default_rng(7)
    slow, fast = 2.0 * np.pi / 200.0, 2.0 * np.pi / 8.0
    at, felt_at = np.arange(0.0, 600.0, 1.0 / rate_hz), np.arange(0.0, 600.0, 0.02)
    heave = np.sqrt(2.0) * heave_m
    waves = np.sqrt(2.0) * wave_m * np.sin(2.0 * np.pi * at / period_s + 1.0)
    depth = (
        5.0
        + 3.0 * np.sin(slow * at)
        + heave * np.sin(fast * at)
        + waves
        + noise_m * random.normal(size=at.size)
    )
    accel = -3.0 * slow**2 * np.sin(slow * felt_at) - heave * fast**2 * np.sin(fast * felt_at)
    accel += 0.02 + 0.01 * random.normal(size=felt_at.size)
    found = find_waves((at * 1e9).astype(np.int64), depth, (felt_at * 1e9).astype(np.int64), accel)
    if wave_m == 0.0:
        assert found is None
    else:
        assert found is not None
        assert found.sd_m == pytest.approx(wave_m, rel=0.1)
        assert found.period_s == pytest.approx(period_s, rel=0.05)
