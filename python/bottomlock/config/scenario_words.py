"""A scenario in a line, and as a table for a notebook."""

from typing import TYPE_CHECKING

from bottomlock.config.sensors import SENSORS
from bottomlock.config.toml_value import toml_value
from bottomlock.support.notebook import html_table

if TYPE_CHECKING:
    from bottomlock.config.scenario import Scenario


def line_of(scenario: "Scenario") -> str:
    """Name, path, beams, sensors and runs."""
    path, dvl, campaign = scenario.trajectory, scenario.dvl, scenario.campaign
    length = "" if path.kind == "waypoints" else f" for {path.duration_s:g} s"
    lost = f" without {', '.join(str(beam) for beam in dvl.beams_lost)}" if dvl.beams_lost else ""
    sensors = [sensor.name for sensor in SENSORS if getattr(scenario, sensor.name).enabled]
    parts = [
        f"{path.kind} at {path.speed_mps:g} m/s{length}",
        f"{dvl.beams} beams{lost}",
        *sensors,
        *(["water_track"] if scenario.water_track.enabled else []),
        f"{campaign.runs} runs of {len(campaign.methods)} methods",
    ]
    return f"<Scenario {scenario.name}: {', '.join(parts)}>"


def table_of(scenario: "Scenario") -> str:
    """Every key that the file states, a row for each section."""
    rows = []
    for name, value in scenario.model_dump(exclude_unset=True).items():
        if isinstance(value, dict):
            words = ", ".join(f"{key} = {toml_value(one)}" for key, one in value.items())
            rows.append((f"[{name}]", words))
        elif name != "name":
            rows.append((name, str(value)))
    return html_table(f"Scenario {scenario.name}", rows)
