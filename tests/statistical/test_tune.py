"""`bottomlock tune` finds the noise that made a log, within its claimed sigma."""

import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binom

from bottomlock.replay.case import load_case
from bottomlock.replay.tune.criterion import Criterion
from bottomlock.replay.tune.parameters import Parameter
from bottomlock.replay.tune.passes import Recording, horizons_of
from tests.statistical.tune_logs import KINDS, dive, write_case

DEG = float(np.rad2deg(1.0))
TUNED = {
    "accel_noise": ("imu.errors.accel_noise_mps_per_rt_h", 60.0),
    "gyro_noise": ("imu.errors.gyro_noise_deg_per_rt_h", 60.0 * DEG),
    "accel_walk": ("imu.errors.accel_bias_walk_mps2_per_rt_s", 1.0),
    "gyro_walk": ("imu.errors.gyro_bias_walk_deg_per_s_per_rt_s", DEG),
    "beam_noise": ("dvl.beam_noise_mps", 1.0),
    "tilt": ("attitude.roll_pitch_sd_deg", DEG),
    "yaw": ("attitude.yaw_sd_deg", DEG),
}
"""Keys of the noise, and their units of the SI."""


def each(of: Callable[[int], tuple[float, ...]], seeds: Sequence[int]) -> NDArray[np.float64]:
    """What a function has of each seed, a process a core: the searches of short logs are mostly Python."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(os.cpu_count(), mp_context=context) as pool:
        return np.array(list(pool.map(of, seeds)))


def errors_over_sd(seed: int) -> tuple[float, ...]:
    """Error of each logarithm over its claimed sigma; begun as a grade of instrument is off."""
    kind = KINDS[seed % len(KINDS)]
    dived = dive(seed, kind, rate_hz=10.0)
    rng = np.random.default_rng(seed + 1000)
    factors = np.exp(rng.normal(0.0, 0.7, len(TUNED)))
    begun = dict(kind) | {name: kind[name] * factor for name, factor in zip(TUNED, factors, strict=True)}
    noise = [
        Parameter(key, begun[name] * unit, is_given=True, words=name) for name, (key, unit) in TUNED.items()
    ]
    with TemporaryDirectory() as folder, ThreadPoolExecutor(1) as executor:
        read = Recording.read(load_case(write_case(Path(folder), dived)))
        recording = replace(read, valid=np.ones_like(read.valid))
        criterion = Criterion(recording, recording.passes(horizons_of(418.0)), noise, executor)
        found = criterion.best([criterion.start], lambda *_: None)
    true = np.log([kind[name] * unit for name, (_, unit) in TUNED.items()])
    return tuple((found.at - true) / criterion.uncertainty(found, 60.0))


@pytest.mark.parametrize(
    "logs", [pytest.param(16, marks=pytest.mark.long), pytest.param(200, marks=pytest.mark.deep)]
)
def test_claimed_sigma_covers_95_percent(logs: int) -> None:
    """Of logs of three kinds the parameters are within 2 sigma in 95 %, each as often as chance allows.

    95 % of draws fall below the limit of a parameter once in 500 times: 180 of 200, 12 of 16. And no sigma is huge.
    """
    z = each(errors_over_sd, range(10, 10 + logs))
    within = (np.abs(z) < 2.0).mean(axis=0)
    assert within.mean() >= 0.95, dict(zip(TUNED, within, strict=True))
    assert (within * logs >= binom.ppf(0.002, logs, 0.95)).all(), dict(zip(TUNED, within, strict=True))
    rms = np.sqrt((z**2).mean(axis=0))
    assert (rms > 1.0 / 3.0).all(), dict(zip(TUNED, rms, strict=True))
