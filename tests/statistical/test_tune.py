"""`bottomlock tune` finds the noise that made a log, within its claimed sigma."""

import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binom

from bottomlock.kernel.models import Options
from bottomlock.replay.tune.criterion import Criterion, Found, search, uncertainty
from bottomlock.replay.tune.passes import Inputs, horizons_of, passes_of
from tests.statistical.tune_logs import KINDS, Dive, dive, model

TUNED = ("accel_noise", "gyro_noise", "accel_walk", "gyro_walk", "beam_noise", "tilt", "yaw")
OPTIONS = Options(gate="off", robust=None, imu_sampling="averaged")


def each(of: Callable[[int], tuple[float, ...]], seeds: Sequence[int]) -> NDArray[np.float64]:
    """What a function has of each seed, a process a core: the searches of short logs are mostly Python."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(os.cpu_count(), mp_context=context) as pool:
        return np.array(list(pool.map(of, seeds)))


def tuned(dived: Dive, begun: dict[str, float], names: tuple[str, ...] = TUNED) -> tuple[Criterion, Found]:
    """The search over a simulated log from other noise on; the prior is about that noise."""
    start = np.log([begun[name] for name in names])

    def inputs(logs: NDArray[np.float64]) -> Inputs:
        noise = begun | dict(zip(names, np.exp(logs), strict=True))
        return Inputs(model(noise), OPTIONS, noise["beam_noise"] / dived.noise["beam_noise"])

    times = dived.log["imu_time_ns"]
    horizons = horizons_of(float(times[-1] - times[0]) * 1e-9)
    with ThreadPoolExecutor(1) as executor:
        criterion = Criterion(
            dived.geometry, dived.start, passes_of(dived.log, horizons), inputs, start, executor
        )
        return criterion, search(criterion, [start])


def errors_over_sd(seed: int) -> tuple[float, ...]:
    """Error of each logarithm over its claimed sigma; begun as a grade of instrument is off."""
    kind = KINDS[seed % len(KINDS)]
    dived = dive(seed, kind)
    rng = np.random.default_rng(seed + 1000)
    factors = np.exp(rng.normal(0.0, 0.7, len(TUNED)))
    begun = dict(kind) | {name: kind[name] * factor for name, factor in zip(TUNED, factors, strict=True)}
    criterion, found = tuned(dived, begun)
    sd = uncertainty(criterion, found, 60.0)
    return tuple((found.best.at - np.log([kind[name] for name in TUNED])) / sd)


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
