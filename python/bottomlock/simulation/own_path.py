"""The path of a scenario whose trajectory is a file, and what the file says of the scenario."""

from pathlib import Path as File

import numpy as np

from bottomlock.config.scenario import Scenario
from bottomlock.errors import DataError, ScenarioError
from bottomlock.io.track import read_track
from bottomlock.simulation.path import Path

_LATITUDE_TOLERANCE_DEG = 0.1
"""Of a latitude that the scenario states as well: gravity and Earth rate differ by some 1e-5 and 1e-3 of themselves."""


def own_path(scenario: Scenario) -> Path:
    """The path of a scenario with `trajectory.file`.

    Raises:
        ScenarioError: for a file that cannot be read or is no path, naming scenario, file, row and likely mistake; and
            for a speed beside it.
    """
    settings = scenario.trajectory
    assert settings.file is not None
    if "speed_mps" in settings.model_fields_set:
        raise ScenarioError(
            f"is given, but the times of {settings.file} state the speed",
            place=f"scenario {scenario.name}",
            key="trajectory.speed_mps",
            hint="leave it out",
        )
    try:
        return Path(
            read_track(File(settings.file), settings.columns),
            settings.limits,
            max_gap_s=settings.max_gap_s,
            depth_m=scenario.environment.depth_m,
        )
    except DataError as error:
        raise ScenarioError(f"trajectory.file: {error}", place=f"scenario {scenario.name}") from error


def with_path(scenario: Scenario, path: Path) -> Scenario:
    """The scenario with the duration of its path and, of a file in degrees, its latitude and longitude.

    What the scenario states itself stays.

    Raises:
        ScenarioError: for a latitude that is not that of the file.
    """
    if "duration_s" not in scenario.trajectory.model_fields_set:
        scenario = scenario.with_trajectory(duration_s=path.duration_s)
    if path.track.latitude_rad is None or path.track.longitude_rad is None:
        return scenario
    latitude_deg, longitude_deg = np.rad2deg([path.track.latitude_rad, path.track.longitude_rad]).tolist()
    environment = scenario.environment
    stated = environment.model_fields_set
    if "latitude_deg" in stated and abs(environment.latitude_deg - latitude_deg) > _LATITUDE_TOLERANCE_DEG:
        raise ScenarioError(
            f"is {environment.latitude_deg:g}, but {path.track.place} begins at {latitude_deg:.4f}",
            place=f"scenario {scenario.name}",
            key="environment.latitude_deg",
            hint="leave the key out",
        )
    found = {"latitude_deg": latitude_deg, "longitude_deg": longitude_deg}
    update = {key: value for key, value in found.items() if key not in stated}
    return scenario.model_copy(update={"environment": environment.model_copy(update=update)})


def resolved(scenario: Scenario) -> Scenario:
    """The scenario with what its trajectory's file says of it; any other as it is.

    Raises:
        ScenarioError: as `own_path` and `with_path`.

    >>> from bottomlock.config.scenario import load_scenario
    >>> scenario = load_scenario("straight")
    >>> resolved(scenario) is scenario
    True
    """
    return with_path(scenario, own_path(scenario)) if scenario.trajectory.source == "file" else scenario
