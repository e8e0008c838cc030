"""The packaged surveys, and a trajectory in their world."""

import numpy as np
import pytest

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.errors import ScenarioError
from bottomlock.kernel import DEFAULT_OPTIONS
from bottomlock.simulation.build import build_simulation
from bottomlock.simulation.measurement_schedule import measurement_schedule
from bottomlock.studies import cases
from bottomlock.studies.cases import WORLD, in_world

SURVEYS = ("survey", "survey_table2")


def short(name: str = "straight", seconds: float = 20.0) -> Scenario:
    return load_scenario(name).with_trajectory(duration_s=seconds)


@pytest.mark.parametrize("name", SURVEYS)
def test_a_survey_is_the_realistic_default(name: str) -> None:
    """Depth and attitude on, beams tested as in replay, a gate that re-opens, current, outliers; no fixed loss."""
    survey = load_scenario(name)
    assert survey.depth.enabled
    assert survey.magnetometer.enabled
    assert survey.robust.tail == DEFAULT_OPTIONS["robust"]["tail"]
    assert survey.robust.closure_gate == DEFAULT_OPTIONS["robust"]["closure_gate"]
    assert survey.robust.beam_gate == DEFAULT_OPTIONS["robust"]["beam_gate"]
    assert survey.filter.inflate_after_rejections == 5
    assert survey.mission is not None
    assert survey.mission.current.speed_mps == 0.3
    assert survey.mission.current.wander_sd_mps > 0.0
    assert survey.dvl.outlier_fraction > 0.0
    assert not survey.dvl.beams_lost
    assert not survey.dvl.dropouts


def test_the_surveys_differ_in_inertial_sensors_compass_and_start_alone() -> None:
    good, table_2 = (load_scenario(name) for name in SURVEYS)
    other = {"name", "description", "imu", "magnetometer", "initial"}
    assert good.model_dump(exclude=other) == table_2.model_dump(exclude=other)
    paper = load_scenario("straight")
    assert table_2.imu == paper.imu
    assert table_2.initial == paper.initial
    assert table_2.magnetometer.yaw_noise_deg == paper.magnetometer.yaw_noise_deg


def test_the_seabed_takes_beams_of_every_number() -> None:
    """Over the first leg and the turn: pings of four beams, of three and of two, by the motion alone."""
    simulation = build_simulation(short("survey", 150.0))
    flags = measurement_schedule(simulation, simulation.truth(), runs=2)["beam_valid"]
    assert flags.ndim == 2
    counts = np.bincount(flags.sum(axis=1), minlength=5) / len(flags)
    assert counts[4] > 0.4
    assert counts[3] > 0.1
    assert counts[2] > 0.05


def test_in_world_takes_all_but_the_motion() -> None:
    """Sensors, filter and current of the world; name, trajectory and campaign stay; the mask replaces loss as ever."""
    straight, survey = short(), load_scenario("survey")
    moved = in_world(straight, survey)
    for name in WORLD:
        assert getattr(moved, name) == getattr(survey, name), name
    assert moved.mission is not None
    assert straight.mission is not None
    assert survey.mission is not None
    assert moved.mission == straight.mission.model_copy(update={"current": survey.mission.current})
    assert (moved.name, moved.trajectory, moved.campaign) == (
        straight.name,
        straight.trajectory,
        straight.campaign,
    )
    case = cases.masked(moved, (1, 3))
    assert case.seabed is None
    assert (case.dvl.beams_lost, case.dvl.max_range_m) == ((2, 4), np.inf)
    assert case.dvl.outlier_fraction == survey.dvl.outlier_fraction
    build_simulation(case)


def test_in_the_world_of_the_paper_the_water_is_still() -> None:
    """A world without a current takes the trajectory's own away."""
    back = in_world(in_world(short(), load_scenario("survey")), load_scenario("lawn_mower"))
    assert back.mission == short("straight").mission
    assert not back.depth.enabled


def test_an_analytic_trajectory_has_no_world() -> None:
    analytic = load_scenario("straight").with_trajectory(source="analytic")
    with pytest.raises(ScenarioError, match=r"straight: .* no current, expected .*\"vehicle\""):
        in_world(analytic, load_scenario("survey"))
