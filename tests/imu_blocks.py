"""The inertial readings of a run, pushed to a navigator in blocks between the measurements of another sensor."""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from bottomlock.kernel import Navigator


def measured(
    navigator: Navigator, drawn: dict[str, Any], times_ns: Iterable[int]
) -> Iterator[tuple[int, int]]:
    """Row and time of each measurement, once the navigator has the readings up to it.

    Args:
        navigator: takes the readings.
        drawn: of one run, as `kernel.simulate_sensors` returns them.
        times_ns: of the measurements, rising.
    """
    done = 0
    for row, time_ns in enumerate(times_ns):
        upto = int(np.searchsorted(drawn["imu_time_ns"], time_ns, side="right"))
        part = slice(done, upto)
        navigator.push_imu_block(
            drawn["imu_time_ns"][part],
            omega_p_radps=drawn["imu_omega_p_radps"][part],
            force_p_mps2=drawn["imu_force_p_mps2"][part],
        )
        done = upto
        yield row, int(time_ns)
