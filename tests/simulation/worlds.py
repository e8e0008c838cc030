"""Worlds of the simulated sensors, and what the kernel takes of one."""

from typing import Any

import numpy as np

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.simulation.build import Simulation, build_simulation, trajectory_key
from bottomlock.simulation.measurement_schedule import measurement_schedule

CURRENT = {
    "speed_mps": 0.4, "towards_deg": 60.0, "turn_deg_per_h": 900.0, "shear_north_mps_per_m": 0.01,
    "shear_east_mps_per_m": -0.02,
}  # fmt: skip
ALWAYS = {"depth": {}, "magnetometer": {}, "gps": {"antenna_depth_m": 1e3, "acquire_s": 0.0}}
"""Sensors that every world has."""
ACOUSTIC = {"rate_hz": 1.0, "transceiver_m": [50.0, 80.0, 0.0], "lever_arm_m": [0.8, -0.3, 0.6]}


def figure_of_eight(
    seconds: float = 20.0,
    *,
    earth: str = "tangent_plane",
    dvl: dict[str, Any] | None = None,
    **sections: Any,  # noqa: ANN401
) -> Simulation:
    """It dives, in a current that turns and is sheared; `sections` switch sensors on."""
    content = load_scenario("figure_eight").with_trajectory(duration_s=seconds).model_dump(exclude_unset=True)
    content["mission"] = {**content.get("mission", {}), "current": CURRENT}
    content["environment"] = {**content.get("environment", {}), "earth": earth}
    content["dvl"] |= dvl or {}
    return build_simulation(Scenario.model_validate(content | ALWAYS | sections))


def kernel_inputs(simulated: Simulation) -> tuple[int, Any, Any, Any, Any]:
    """Key, schedule, truth, model and options of a simulation, as the kernel takes them."""
    truth, scenario = simulated.truth(), simulated.scenario
    key = trajectory_key(scenario.name)
    plan = measurement_schedule(simulated, truth, trajectory_key=key)
    model = scenario.kernel_model(simulated.gravity_mps2)
    return key, plan, truth.kernel_arrays(), model, scenario.kernel_options()


def current_at(seconds: float, depth_m: float) -> list[float]:
    """North, east and down, m/s."""
    towards = np.deg2rad(60.0 + 0.25 * seconds)
    return [0.4 * np.cos(towards) + 0.01 * depth_m, 0.4 * np.sin(towards) - 0.02 * depth_m, 0.0]
