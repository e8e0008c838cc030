"""All simulated sensors at once: a campaign's run is the streaming navigator; each has random numbers of its own."""

from typing import Any

import numpy as np
import pytest

from bottomlock.kernel import Method, run_batch
from bottomlock.simulation.sensor_streams import sensor_streams
from tests.run_events import Readings
from tests.simulation.worlds import ACOUSTIC, ALWAYS, figure_of_eight, kernel_inputs

METHODS: list[Method] = ["lc", "tc", "vb", "elc", "info", "weak_sway", "sway_current"]
SENSORS: Any = {
    "acoustic_position": ACOUSTIC,
    "heading": {},
    "thrust": {"corrects": "all"},
    "water_track": {"lost_fraction": 0.3},
}
"""Sections that switch a sensor on, with keys of theirs."""


@pytest.mark.parametrize("sensor", SENSORS)
def test_switching_a_sensor_on_shifts_no_other_stream(sensor: str) -> None:
    """Every other table of readings keeps its bits, whatever the outliers of the one."""
    section, name = SENSORS[sensor], "beams_water" if sensor == "water_track" else sensor
    wild = section | ({"outlier_fraction": 0.5} if name != sensor or section is ACOUSTIC else {})
    worlds: Any = {}, {sensor: section}, {sensor: wild}
    off, on, worse = (figure_of_eight(12.0, **one) for one in worlds)
    without, *others = (sensor_streams(one, off.truth(), run=3) for one in (off, on, worse))
    assert name not in without or without[name].height == 0
    for with_it in others:
        assert with_it[name].height > 0
        for other in ("imu", "beams", "depth", "attitude", "gps"):
            assert without[other].height > 0
            assert without[other].equals(with_it[other]), other
    if wild != section:
        rows = [one[name].rows() for one in others]
        assert sum(one == other for one, other in zip(*rows, strict=False)) > 0
        assert rows[0] != rows[1]


def test_a_campaigns_run_is_the_streaming_navigator() -> None:
    """Count of fixes and mean NIS of the DVL equal the batch's, with every sensor in between; each of these counts."""
    simulated = figure_of_eight(12.0, dvl={"outlier_fraction": 0.1}, **SENSORS)
    key, plan, arrays, model, options = kernel_inputs(simulated)
    common: Any = {
        "seed": simulated.scenario.campaign.seed, "trajectory_key": key, "first_run": 2, "runs": 1, "threads": 1,
    }  # fmt: skip
    batch = run_batch(simulated.geometry, arrays, model, model, options, plan, METHODS, **common)
    readings = Readings(simulated, simulated.truth(), run=2)
    for index, method in enumerate(METHODS):
        fixes = list(readings.fixes(method, readings.valid, range(len(readings.valid))))
        assert len(fixes) == batch["fixes_accepted"][0, index] + batch["fixes_rejected"][0, index]
        assert sum(fix.used for fix in fixes) == batch["fixes_accepted"][0, index]
        # In the order of the pings, as the batch adds them.
        assert sum(fix.nis for fix in fixes) / len(fixes) == pytest.approx(
            batch["nis_mean"][0, index], rel=1e-12
        )
    tc = METHODS.index("tc")
    assert all(len(plan[f"{name}_time_ns"]) > 0 for name in ALWAYS)
    for sensor in ("acoustic_position", "heading", "thrust", "water"):
        fewer: Any = {name: values for name, values in plan.items() if not name.startswith(f"{sensor}_")}
        without = run_batch(simulated.geometry, arrays, model, model, options, fewer, ["tc"], **common)
        assert not np.array_equal(without["error"][:, 0], batch["error"][:, tc]), sensor
