"""A trajectory in the world of another scenario: with its sensors, filter, seabed and current."""

from typing import Any

from bottomlock.config.scenario import Scenario
from bottomlock.config.sensors import SENSORS
from bottomlock.errors import ScenarioError

SECTIONS = (
    "environment", "seabed", "imu", "dvl", *(sensor.name for sensor in SENSORS), "initial", "filter", "robust",
)  # fmt: skip
"""What a world is, beside the current of its mission; the trajectory keeps its motion, name, runs, seed and methods."""


def in_world(scenario: Scenario, world: Scenario) -> Scenario:
    """The trajectory of a scenario in a world.

    The name stays, and with it the random streams: run k has the same random numbers in every world.

    Raises:
        ScenarioError: for a trajectory without a vehicle, which has no current.

    Examples:
        >>> from bottomlock.config.scenario import load_scenario
        >>> moved = in_world(load_scenario("straight"), load_scenario("survey"))
        >>> moved.name, moved.trajectory.kind, moved.depth.enabled, moved.mission["current"]["speed_mps"]
        ('straight', 'straight', True, 0.3)
    """
    if scenario.trajectory.source != "vehicle":
        kind = (
            "an analytic trajectory"
            if scenario.trajectory.source == "analytic"
            else "a trajectory from a file"
        )
        raise ScenarioError(
            f"scenario {scenario.name}: {kind} has no current, expected trajectory.source "
            f'"vehicle" to fly it in the world of {world.name}'
        )
    mission: dict[str, Any] = {key: value for key, value in scenario.mission.items() if key != "current"}
    if "current" in world.mission:
        mission["current"] = world.mission["current"]
    return scenario.model_copy(
        update={name: getattr(world, name) for name in SECTIONS} | {"mission": mission}
    )
