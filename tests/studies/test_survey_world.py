"""The packaged surveys, a trajectory in their world, and what the pages of a study say about it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.errors import ScenarioError
from bottomlock.kernel import DEFAULT_OPTIONS
from bottomlock.pages.page import markdown
from bottomlock.simulation.build import build_simulation
from bottomlock.simulation.measurement_schedule import measurement_schedule
from bottomlock.studies import cases, masks_page, world_words
from bottomlock.studies.consistency import run_consistency
from bottomlock.studies.masks_answer import answer, what_was_run
from bottomlock.studies.world import SECTIONS, in_world
from bottomlock.tables.studies import MASKS
from tests.studies.test_masks import row

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
    assert survey.mission["current"]["speed_mps"] == 0.3
    assert survey.mission["current"]["wander_sd_mps"] > 0.0
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
    simulation = build_simulation(load_scenario("survey"))
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
    for name in SECTIONS:
        assert getattr(moved, name) == getattr(survey, name), name
    assert moved.mission["current"] == survey.mission["current"]
    assert {key: moved.mission[key] for key in straight.mission} == straight.mission
    assert (moved.name, moved.trajectory, moved.campaign) == (
        straight.name,
        straight.trajectory,
        straight.campaign,
    )
    case = cases.masked(moved, (1, 3)).scenario
    assert case.seabed == {}
    assert (case.dvl.beams_lost, case.dvl.max_range_m) == ((2, 4), np.inf)
    assert case.dvl.outlier_fraction == survey.dvl.outlier_fraction
    assert cases.over_slope(moved, 20.0).scenario.seabed == survey.seabed
    build_simulation(case)


def test_in_the_world_of_the_paper_the_water_is_still() -> None:
    """A world without a current takes the trajectory's own away."""
    back = in_world(in_world(short(), load_scenario("survey")), load_scenario("lawn_mower"))
    assert "current" not in back.mission
    assert not back.depth.enabled


def test_an_analytic_trajectory_has_no_world() -> None:
    analytic = load_scenario("straight").with_trajectory(source="analytic")
    with pytest.raises(
        ScenarioError, match=r"straight: an analytic trajectory has no current, expected .*\"vehicle\""
    ):
        in_world(analytic, load_scenario("survey"))


def test_the_words_are_those_of_the_world() -> None:
    """Every sentence follows the settings; scenarios that differ are named."""
    paper, survey = [short()], [in_world(short(), load_scenario("survey"))]
    still, moving = (
        " ".join([*world_words.settings(one), *world_words.limits(one)]) for one in (paper, survey)
    )
    for words in (
        "Further sensors: none",
        "The water is still",
        "never inflated",
        "exactly the errors",
        "not tested",
    ):
        assert words in still
        assert words not in moving
    for words in (
        "`depth` at 1 Hz, `magnetometer` at 0.5 Hz", "0.3 m/s towards 90°", "after 5 rejected fixes", "2.7 % of the",
        "Student's t with 4 degrees", "beam noise 20 mm/s", "0.05 mg and 0.1 °/h", "re-opens",
    ):  # fmt: skip
        assert words in moving
        assert words not in still
    both = world_words.settings([short("straight"), in_world(short("lawn_mower"), load_scenario("survey"))])
    assert "straight: Further sensors: none. lawn_mower: Further sensors: `depth`" in " ".join(both)
    off = survey[0].model_copy(update={"filter": survey[0].filter.model_copy(update={"gate": "off"})})
    assert "No gate." in world_words.settings([off])
    assert "no fix is rejected" in " ".join(world_words.limits([off]))


def test_a_consistency_page_of_the_survey(tmp_path: Path) -> None:
    """Two runs of one cell: the page has the world's settings, and nothing of the paper's."""
    one = in_world(short(seconds=60.0), load_scenario("survey")).with_overrides(runs=2, methods=["ins", "tc"])
    run_consistency([one], [(1, 2, 3, 4)], tmp_path, command="the command", threads=1)
    text = (tmp_path / "consistency.md").read_text(encoding="utf-8")
    assert text.startswith("# Consistency of the methods\n\n1. **")
    assert "2.7 % of the readings" in text
    assert "exactly the errors" not in text
    assert "\n\n\n" not in text


def masks_table() -> pl.DataFrame:
    """Two methods under four beams, two and one, and the reference under two."""
    rows = [
        ("lc", "beams_12", "1,2", 0.01, "consistent"),
        ("tc", "beams_1234", "1,2,3,4", 0.02, "consistent"),
        ("tc", "beams_12", "1,2", 0.05, "consistent"),
        ("tc", "beams_13", "1,3", 0.09, "conservative"),
        ("tc", "beams_1", "1", 1.0, "consistent"),
        ("vb", "beams_1234", "1,2,3,4", 0.02, "consistent"),
        ("vb", "beams_12", "1,2", 3.0, "overconfident"),
        ("vb", "beams_13", "1,3", 3.0, "overconfident"),
        ("vb", "beams_1", "1", 4.0, "overconfident"),
        ("tc", "dropouts", "varying", 0.03, "consistent"),
    ]
    names = ["method", "case", "beams", "velocity_rms_over_runs_mps", "verdict"]
    return pl.DataFrame(rows, schema=names, orient="row")


def test_the_answer_of_the_masks() -> None:
    """Ranges of the methods that are nowhere overconfident, those that are by their counts, and the recovery."""
    summary = pl.DataFrame(
        {
            "trajectory": ["straight"] * 3, "method": ["tc", "tc", "vb"], "step_sigmas_max": [1.0] * 3,
            "nis_1": [1.0] * 3, "nis_5": [1.0] * 3, "rejected_fraction": [0.0] * 3, "jumps": [0] * 3,
            "degrees": [4] * 3, "back_at_epoch": [1, 1, None], "recovered": [True, True, False],
        }
    )  # fmt: skip
    lines = answer(masks_table(), summary)
    assert len(lines) == 5
    assert lines[0].endswith("`tc`, `vb` 0.020.")
    assert lines[1].endswith("allows: `tc` 0.050–0.090.")
    # One row in one is what chance allows.
    assert lines[2].endswith("`tc` 1.00; `vb` 4.00.")
    assert lines[3].endswith("`vb` 3 of 4.")
    assert lines[4].endswith("`tc` recover for every pair; `vb` for 0 of 1.")
    none = answer(masks_table().filter(pl.col("beams") == "1"), None)
    assert none[0].endswith("not run.")
    assert none[4].endswith("not run.")
    flown = [in_world(short(), load_scenario("survey"))]
    run = what_was_run(flown, "bottomlock masks straight")
    table = pl.DataFrame([row()], schema=dict(MASKS), orient="row")
    page = markdown(masks_page.page(table, None, run, world_words.limits(flown)))
    assert page.startswith("# Masks and recovery\n\n1. **Three beams or more**")
    assert "- Command: `bottomlock masks straight`" in page
    assert "\n\n\n" not in page
