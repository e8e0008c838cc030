"""All simulated sensors at once: a campaign's run is the streaming navigator; each has random numbers of its own."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.kernel import Method, run_batch
from bottomlock.simulation.build import Simulation, build_simulation
from bottomlock.simulation.sensor_streams import sensor_streams
from tests.run_events import Readings
from tests.simulation.test_acoustic_simulation import kernel_inputs

METHODS: list[Method] = ["lc", "tc", "vb", "elc", "info", "weak_sway", "sway_current"]
ALWAYS = {"depth": {}, "magnetometer": {}, "gps": {"antenna_depth_m": 1e3, "acquire_s": 0.0}}
SENSORS: dict[str, dict[str, Any]] = {
    "acoustic_position": {
        "rate_hz": 1.0,
        "transceiver_m": [50.0, 80.0, 0.0],
        "lever_arm_m": [0.8, -0.3, 0.6],
    },
    "heading": {},
    "thrust": {"corrects": "all"},
    "water_track": {"lost_fraction": 0.3},
}
"""Sections that switch a sensor on, with keys of theirs."""


def simulation(*sensors: str, seconds: float = 12.0, **dvl: float) -> Simulation:
    """A figure of eight in a current that turns and is sheared, with these sensors beside the common ones."""
    content = load_scenario("figure_eight").with_trajectory(duration_s=seconds).model_dump(exclude_unset=True)
    current = {"speed_mps": 0.4, "towards_deg": 60.0, "turn_deg_per_h": 900.0, "shear_north_mps_per_m": 0.01}
    content["mission"] = {**content.get("mission", {}), "current": current}
    content["environment"] = {**content.get("environment", {}), "earth": "tangent_plane"}
    content["dvl"] |= dvl
    return build_simulation(
        Scenario.model_validate(content | ALWAYS | {name: SENSORS[name] for name in sensors})
    )


@pytest.mark.parametrize("sensor", ["heading", "thrust"])
def test_switching_a_sensor_on_shifts_no_other_stream(sensor: str) -> None:
    """Every other table of readings keeps its bits; acoustic fixes and water track beside their own outliers."""
    off, on = simulation(), simulation(sensor)
    truth = off.truth()
    without, with_it = (sensor_streams(one, truth, run=3) for one in (off, on))
    assert (without[sensor].height, with_it[sensor].height) == (0, 12)
    for name in ("imu", "beams", "depth", "attitude", "gps"):
        assert without[name].height > 0
        assert without[name].equals(with_it[name]), name


def test_a_campaigns_run_is_the_streaming_navigator() -> None:
    """Count of fixes and mean NIS of the DVL equal the batch's, with every sensor in between; each of these counts."""
    simulated = simulation(*SENSORS, outlier_fraction=0.1)
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
