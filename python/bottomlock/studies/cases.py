"""Variants of a scenario: which beams return, which sensors aid, and the world of another scenario.

A variant keeps the scenario's name, and with it the random streams: run k has the same sensor errors in all of them.
"""

from collections.abc import Sequence
from itertools import combinations
from typing import Any

from bottomlock.config import sensors as config_sensors
from bottomlock.config.mission_sections import CurrentTable
from bottomlock.config.scenario import Scenario
from bottomlock.config.sensors import AcousticPosition, Depth, Gps, Heading, Magnetometer
from bottomlock.errors import ScenarioError
from bottomlock.text import did_you_mean

PAPER_TRAJECTORIES = ("straight", "figure_eight", "lawn_mower")
"""The packaged scenarios of the 2017 paper."""

SENSORS: dict[str, dict[str, Any]] = {
    "depth": {"depth": Depth()},
    "heading": {"heading": Heading()},
    "attitude": {"magnetometer": Magnetometer()},
    "gps": {"gps": Gps(antenna_depth_m=1000.0)},
    "acoustic": {"acoustic_position": AcousticPosition()},
}
"""Sensors that may aid beside the beams, by name: their section of a scenario. The GPS antenna is on a float, or the
vehicle at the surface: fixes are received at any depth of the trajectory."""

WORLD = (
    "environment", "seabed", "imu", "dvl", *(sensor.name for sensor in config_sensors.SENSORS), "initial", "filter",
    "robust",
)  # fmt: skip
"""Sections that are a world, beside the current of its mission; a trajectory in it keeps the others."""

_LOSS = (
    "beams_lost", "outages", "dropouts", "altitude_loss", "replay_validity",
    "min_range_m", "max_range_m", "max_incidence_deg", "range_noise_m", "beam_noise_mps_per_m",
)  # fmt: skip
"""Keys of `[dvl]` that lose beams, or are of the seabed, which there is none of."""


def masks(beams: int) -> list[tuple[int, ...]]:
    """Every set of returning beams, 1 to `beams`, more beams first.

    >>> masks(3)
    [(1, 2, 3), (1, 2), (1, 3), (2, 3), (1,), (2,), (3,)]
    """
    return [mask for size in range(beams, 0, -1) for mask in combinations(range(1, beams + 1), size)]


def masked(scenario: Scenario, mask: tuple[int, ...]) -> Scenario:
    """The scenario with these beams from first to last and no others, on a truth that all methods share.

    Raises:
        ScenarioError: for a beam that the instrument does not have, and for none.

    Examples:
        >>> from bottomlock.config.scenario import load_scenario
        >>> masked(load_scenario("straight"), (1, 4)).dvl.beams_lost
        (2, 3)
    """
    beams = scenario.dvl.beams
    if not mask or not set(mask) <= set(range(1, beams + 1)):
        raise ScenarioError(
            f"a mask of beams {list(mask)}",
            place=f"scenario {scenario.name}",
            expected=f"one or more of 1 to {beams}",
        )
    if scenario.trajectory.feedback == "estimate":
        scenario = scenario.with_trajectory(feedback="truth", pilot="own")
    kept = {name: getattr(scenario.dvl, name) for name in scenario.dvl.model_fields_set.difference(_LOSS)}
    lost = tuple(beam for beam in range(1, beams + 1) if beam not in mask)
    dvl = type(scenario.dvl).model_validate(kept | {"beams_lost": lost})
    return scenario.model_copy(update={"dvl": dvl, "seabed": None})


def aided_by(scenario: Scenario, sensors: Sequence[str]) -> Scenario:
    """The scenario with these sensors beside the beams and no others, at their default noise.

    Raises:
        ScenarioError: for a sensor that is not known.

    Examples:
        >>> from bottomlock.config.scenario import load_scenario
        >>> aided = aided_by(load_scenario("survey"), ["depth"])
        >>> aided.depth.enabled, aided.magnetometer.enabled
        (True, False)
    """
    unknown = [name for name in sensors if name not in SENSORS]
    if unknown:
        hint = did_you_mean(unknown[0], SENSORS)
        raise ScenarioError(f"unknown sensor '{unknown[0]}'{hint} (known: {', '.join(SENSORS)})")
    off = {
        section.name: getattr(scenario, section.name).model_copy(update={"enabled": False})
        for section in config_sensors.SENSORS
    }
    on = {key: section for name in sensors for key, section in SENSORS[name].items()}
    return scenario.model_copy(update=off | on)


def in_world(scenario: Scenario, world: Scenario) -> Scenario:
    """The trajectory of a scenario with the sensors, filter, seabed and current of another one.

    Raises:
        ScenarioError: for a trajectory without a vehicle, which has no current.

    Examples:
        >>> from bottomlock.config.scenario import load_scenario
        >>> moved = in_world(load_scenario("straight"), load_scenario("survey"))
        >>> moved.name, moved.trajectory.kind, moved.depth.enabled, moved.mission.current.speed_mps
        ('straight', 'straight', True, 0.3)
    """
    if scenario.trajectory.source != "vehicle":
        raise ScenarioError(
            "its trajectory has no vehicle and so no current",
            place=f"scenario {scenario.name}",
            expected=f'trajectory.source "vehicle" to fly it in the world of {world.name}',
        )
    current = world.mission.current if world.mission else CurrentTable()
    mission = scenario.mission.model_copy(update={"current": current}) if scenario.mission else None
    return scenario.model_copy(update={name: getattr(world, name) for name in WORLD} | {"mission": mission})
