"""Acoustic fixes as the filter weighs them: NIS and NEES over a fixed ensemble, and a wrong weight that shows.

The verdicts are four bands, each with a false-alarm rate of 2.5e-4: 1e-3 together (Bonferroni), for a seed that was
not chosen.
"""

from typing import Any

import numpy as np
import pytest

from bottomlock.kernel import Method, Navigator
from bottomlock.kernel.models import DvlModel
from bottomlock.simulation.build import build_simulation
from bottomlock.statistics.chi_squared import mean_band
from tests.imu_blocks import measured
from tests.oracle.acoustic_position import deviation
from tests.run_events import Readings
from tests.simulation.test_acoustic_simulation import scenario

RUNS, SECONDS = 60, 40.0
PROBABILITY = 1.0 - 2.5e-4


def run_filter(method: Method, weigh: float) -> tuple[float, int, float]:
    """Mean NIS of the acoustic fixes, their number, and mean NEES of the position at the end, over the runs.

    `weigh` multiplies the deviation given to the filter.
    """
    keys: dict[str, Any] = {
        "transceiver_m": [150.0, -60.0, 0.0],
        "noise_m": 0.4,
        "noise_percent_of_range": 1.5,
    }
    quiet = scenario(SECONDS, **keys)
    off = {
        name: getattr(quiet, name).model_copy(update={"enabled": False})
        for name in ("depth", "magnetometer", "gps")
    }
    simulation = build_simulation(quiet.model_copy(update=off))
    truth, section = simulation.truth(), simulation.scenario.acoustic_position
    transceiver = np.array(section.transceiver_m)
    options = simulation.scenario.kernel_options().replace(gate="off")
    nis, nees = [], []
    for run in range(RUNS):
        readings = Readings(simulation, truth, run=run)
        drawn: Any = readings._drawn
        navigator = Navigator(simulation.geometry, readings._model, options, drawn["initial"], method=method)
        for k, time_ns in measured(navigator, drawn, drawn["acoustic_position_time_ns"]):
            fix = drawn["acoustic_position_t_m"][k]
            sd = deviation(fix, transceiver, section.noise_m, section.noise_percent_of_range / 100.0)
            (report,) = navigator.push_acoustic_position(
                time_ns=time_ns, position_t_m=fix, sd_m=np.full(3, sd * weigh)
            )
            nis.append(report.nis)
            if method == "tc":
                sd_mps = np.full(4, readings._model.of(DvlModel).beam_noise_sd_mps)
                navigator.push_beams(time_ns, drawn["dvl_velocity_mps"][k], readings.valid[k], sd_mps=sd_mps)
        row = int(np.searchsorted(truth.time_ns, navigator.state()["time_ns"]))
        error = truth.position_t_m[row] - navigator.state()["position_t_m"]
        nees.append(error @ np.linalg.solve(navigator.covariance()[:3, :3], error))
    return float(np.mean(nis)), len(nis), float(np.mean(nees))


@pytest.mark.parametrize("method", ["ins", "tc"])
def test_innovations_and_errors_are_as_large_as_claimed(method: Method) -> None:
    nis, count, nees = run_filter(method, 1.0)
    low, high = mean_band(3, count, PROBABILITY)
    assert low < nis < high, (nis, count)
    low, high = mean_band(3, RUNS, PROBABILITY)
    assert low < nees < high, nees
