"""Measurement times of each sensor, and the beams lost by settings."""

import numpy as np
from numpy.typing import NDArray

from bottomlock.config.scenario_sections import Dvl


def epochs_ns(first_ns: int, last_ns: int, rate_hz: float) -> NDArray[np.int64]:
    """Epochs at a rate up to the last time, included; the first comes one interval after the first time.

    >>> epochs_ns(0, 2_000_000_000, 1.0).tolist()
    [1000000000, 2000000000]
    """
    period = 1e9 / rate_hz
    count = int((last_ns - first_ns) / period + 1e-9)
    return first_ns + np.round(np.arange(1, count + 1) * period).astype(np.int64)


def beam_valid(dvl: Dvl, time_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(epochs, beams) true where a beam is neither lost throughout nor in an outage.

    >>> from bottomlock.config.scenario import load_scenario
    >>> beam_valid(load_scenario("straight").dvl, np.array([10**9])).tolist()
    [[True, True, False, False]]
    """
    valid = np.ones((len(time_ns), dvl.beams), dtype=np.bool_)
    for beam in dvl.beams_lost:
        valid[:, beam - 1] = False
    for outage in dvl.outages:
        within = (time_ns >= outage.from_s * 1e9) & (time_ns < outage.to_s * 1e9)
        for beam in outage.beams:
            valid[within, beam - 1] = False
    return valid
