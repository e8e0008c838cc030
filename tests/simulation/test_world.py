"""What a scenario stands for is built and checked before anything runs; its fingerprint follows every file it names."""

import re
from importlib import resources
from pathlib import Path
from typing import Any

import pytest

from bottomlock.config.scenario import Scenario, load_scenario, parse_scenario
from bottomlock.errors import ScenarioError
from bottomlock.simulation.build import build_simulation
from tests.config.test_scenario import TEXT

CONFIG = resources.files("bottomlock.config")


def content() -> dict[str, Any]:
    """The straight scenario as a table to change."""
    return load_scenario("straight").model_dump(exclude_unset=True)


def write_vehicle(folder: Path, *changes: tuple[str, str]) -> Path:
    """The packaged vehicle with some words changed."""
    text = (CONFIG / "vehicles" / "tauv.toml").read_text(encoding="utf-8")
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_fingerprint_follows_the_files(tmp_path: Path) -> None:
    """The same words with another vehicle behind them are another campaign; a comment changes nothing."""
    path = write_vehicle(tmp_path)
    scenario = Scenario.model_validate(content() | {"trajectory": {"kind": "straight", "vehicle": str(path)}})
    before = build_simulation(scenario).fingerprint()
    write_vehicle(tmp_path, ('name = "tauv"', '# a comment\nname = "tauv"'))
    assert build_simulation(scenario).fingerprint() == before
    write_vehicle(tmp_path, ("centre_of_gravity_z = { value = 0.02", "centre_of_gravity_z = { value = 0.021"))
    assert build_simulation(scenario).fingerprint() != before
    grid = tmp_path / "grid.toml"
    text = "north_m = [-500, 0, 500]\neast_m = [-500, 500]\ndepth_m = [[60, 60], [60, {}], [60, 60]]\n"
    grid.write_text(text.format(60), encoding="utf-8")
    bottom = Scenario.model_validate(content() | {"seabed": {"kind": "grid", "path": str(grid)}})
    flat = build_simulation(bottom).fingerprint()
    grid.write_text(text.format(70), encoding="utf-8")
    assert build_simulation(bottom).fingerprint() != flat


def test_files_are_looked_for_beside_the_scenario(tmp_path: Path) -> None:
    """A relative path is meant from the scenario's folder, wherever the command runs."""
    write_vehicle(tmp_path, ('name = "tauv"', 'name = "mine"'))
    packaged = (CONFIG / "scenarios" / "straight.toml").read_text(encoding="utf-8")
    (tmp_path / "s.toml").write_text(
        packaged.replace('vehicle = "tauv"', 'vehicle = "mine.toml"'), encoding="utf-8"
    )
    vehicle = build_simulation(load_scenario(tmp_path / "s.toml")).vehicle
    assert vehicle is not None
    assert vehicle.name == "mine"


@pytest.mark.parametrize(
    ("sections", "message"),
    [
        ({"mission": {"depth_m": 500.0}}, "outside 0 to 200 m"),
        ({"trajectory": {"kind": "straight", "speed_mps": 9.0}}, "outside the vehicle's"),
        ({"seabed": {"kind": "grid", "path": "nowhere.toml"}}, "nowhere.toml"),
    ],
)
def test_faults_show_before_anything_runs(sections: dict[str, Any], message: str) -> None:
    """Missions, seabeds and vehicles are judged when the world is made."""
    with pytest.raises(ScenarioError, match=message):
        build_simulation(Scenario.model_validate(content() | sections))


def test_waypoints_end_with_the_path() -> None:
    """Without a duration of its own a way through waypoints lasts as long as the way is."""
    way = {"waypoints_m": [[0.0, 0.0], [100.0, 0.0]], "depth_profile": [[0.0, 10.0]]}
    simulation = build_simulation(
        Scenario.model_validate(content() | {"trajectory": {"kind": "waypoints"}, "mission": way})
    )
    assert simulation.mission is not None
    assert simulation.mission.duration_s == pytest.approx(50.0)
    assert simulation.truth().position_t_m[-1, 0] == pytest.approx(100.0, abs=1.0)


@pytest.mark.parametrize(
    ("section", "keys", "message"),
    [
        ("acoustic_position", "noise_m = -1.0", "'acoustic_position.noise_m' is -1.0, expected > 0.0 m"),
        ("acoustic_position", "outlier_fraction = 1.5", "'acoustic_position.outlier_fraction' is 1.5"),
        ("water_track", "wake = 1.5", "'water_track.wake' is 1.5"),
        ("water_track", "rang_m = 3.0", "unknown key 'water_track.rang_m', did you mean 'range_m'"),
        ("water_track", "current = { speed_mps = 0.3 }", "the current of a vehicle"),
        ("thrust", "error_percent = -100.0", "'thrust.error_percent' is -100.0"),
        ("heading", "noise_deg = -1.0", "'heading.noise_deg' is -1.0"),
    ],
)
def test_bad_sections_are_named(section: str, keys: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=re.escape(message)):
        parse_scenario(f"{TEXT}\n[{section}]\n{keys}\n", place="t")


@pytest.mark.parametrize("keys", ["outlier_fraction = -0.1", "outlier_factor = 0.5"])
def test_bad_outliers_are_named(keys: str) -> None:
    with pytest.raises(ScenarioError, match=f"'dvl.{keys.split(' ', maxsplit=1)[0]}' is .*, expected >="):
        parse_scenario(TEXT.replace("[dvl]\n", f"[dvl]\n{keys}\n"), place="t")
