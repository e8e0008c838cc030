"""When each sensor measures and which beams return, as the kernel wants it."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bottomlock.errors import DataError
from bottomlock.scenario import Dvl, Scenario
from bottomlock.trajectory import Truth


def epochs_ns(truth: Truth, rate_hz: float) -> NDArray[np.int64]:
    """Epochs at a rate inside the truth; the first comes one interval after its start."""
    first, last = int(truth.time_ns[0]), int(truth.time_ns[-1])
    period = 1e9 / rate_hz
    count = int((last - first) / period + 1e-9)
    return first + np.round(np.arange(1, count + 1) * period).astype(np.int64)


def beam_valid(dvl: Dvl, time_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(epochs, beams) true where a beam returns.

    >>> from bottomlock.scenario import load_scenario
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


def schedule(scenario: Scenario, truth: Truth) -> dict[str, Any]:
    """Epochs of every sensor, the beams that return, and a sample every second.

    Raises:
        DataError: for a truth of less than a second.
    """
    empty = np.zeros(0, dtype=np.int64)
    dvl_time_ns = epochs_ns(truth, scenario.dvl.rate_hz)
    sample_time_ns = epochs_ns(truth, 1.0)
    if not len(sample_time_ns):
        raise DataError("the truth is shorter than a second: there is nothing to record")

    def of(section: Any) -> NDArray[np.int64]:  # noqa: ANN401 - the three sections share only these two fields
        return epochs_ns(truth, section.rate_hz) if section.enabled else empty

    return {
        "dvl_time_ns": dvl_time_ns,
        "beam_valid": beam_valid(scenario.dvl, dvl_time_ns),
        "depth_time_ns": of(scenario.depth),
        "magnetometer_time_ns": of(scenario.magnetometer),
        "gps_time_ns": of(scenario.gps),
        "sample_time_ns": sample_time_ns,
    }
