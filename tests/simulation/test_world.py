"""What a scenario stands for is built and checked before anything runs; its fingerprint follows every file it names."""

from importlib import resources
from pathlib import Path
from typing import Any

import pytest

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.errors import ScenarioError
from bottomlock.simulation.build import build_simulation

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


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            ("centre_of_gravity_z = { value = 0.02", "centre_of_gravity_z = { value = -0.05"),
            "or the vehicle capsizes",
        ),
        (("derivative = { value = 4.0", "derivative = { value = 0.0"), "stable"),
    ],
)
def test_a_bad_vehicle_stops_the_world(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    """Negative mass or inertia, a wrong unit, a missing coefficient, a trim that nothing holds."""
    path = write_vehicle(tmp_path, change)
    bad = Scenario.model_validate(content() | {"trajectory": {"kind": "straight", "vehicle": str(path)}})
    with pytest.raises(ScenarioError, match=message):
        build_simulation(bad)


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
        ({"mission": {"depth": 3.0}}, "depth"),
        ({"mission": {"depth_m": 500.0}}, "outside 0 to 200 m"),
        ({"trajectory": {"kind": "straight", "speed_mps": 9.0}}, "outside the vehicle's"),
        ({"trajectory": {"kind": "waypoints"}}, "waypoints_m"),
        ({"seabed": {"kind": "abyss"}}, "abyss"),
        ({"seabed": {"kind": "plane", "depth_m": -5.0}}, "depth_m"),
        ({"seabed": {"kind": "grid", "path": "nowhere.toml"}}, "nowhere.toml"),
        ({"trajectory": {"kind": "straight", "vehicle": "whale"}}, "whale"),
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
