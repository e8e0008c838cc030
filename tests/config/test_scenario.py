"""Scenarios: what is accepted, in which units, and how a fault is reported."""

import json
from typing import Any

import numpy as np
import pytest

from bottomlock.config.mission_sections import CurrentTable
from bottomlock.config.scenario import load_scenario, packaged_scenarios, parse_scenario
from bottomlock.errors import ScenarioError
from bottomlock.kernel.models import DepthModel, DvlModel

TEXT = """
name = "t"
[trajectory]
kind = "straight"
[imu]
accel_bias_mg = 0.5
gyro_bias_deg_per_h = 3.0
accel_noise_mps_per_rt_h = 0.072
gyro_noise_deg_per_rt_h = 0.34
[dvl]
beam_noise_mps = 0.042
"""


def test_table_2_in_si() -> None:
    """Every number of Table 2 arrives in SI: a slip of a unit cannot hide."""
    model = load_scenario("straight").kernel_model(9.8)
    assert model.imu.accel_noise_mps_rts == pytest.approx(0.0012)
    assert model.imu.gyro_noise_rad_rts == pytest.approx(np.deg2rad(0.00567), rel=1e-3)
    assert model.imu.accel_bias_sd_mps2 == pytest.approx(4.903e-3, rel=1e-3)
    assert model.imu.gyro_bias_sd_radps == pytest.approx(1.4544e-5, rel=1e-3)
    assert model.imu.gyro_bias_walk_radps_rts == pytest.approx(4.887e-7, rel=1e-3)
    assert model.of(DvlModel).scale_factor_sd == pytest.approx(0.007)
    assert model.of(DvlModel).scale_factor_walk_rts == pytest.approx(5e-5)
    assert model.initial.attitude_sd_rad == pytest.approx([0.00995, 0.00995, 0.0199], rel=1e-2)
    assert model.of(DepthModel).sd_m == pytest.approx(0.0193, rel=1e-2)


def test_packaged_scenarios_load() -> None:
    """The three of the paper, each followed by the vehicle with beams 3 and 4 lost; an ROV; a slope; two surveys."""
    names = [
        "figure_eight",
        "hovering",
        "lawn_mower",
        "long_way",
        "slope",
        "straight",
        "survey",
        "survey_table2",
    ]
    assert list(packaged_scenarios()) == names
    for name in ("figure_eight", "lawn_mower", "straight"):
        scenario = load_scenario(name)
        assert scenario.name == name
        assert scenario.trajectory.source == "vehicle"
        assert scenario.trajectory.feedback == "truth"
        assert scenario.dvl.beams_lost == (3, 4)
        assert not scenario.depth.enabled
        assert not scenario.magnetometer.enabled


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("0.042 -> nan", "'dvl.beam_noise_mps' is nan"),
        ("[dvl]\nbeam_noise_mps = 0.042 ->", "'dvl' is missing, expected a section [dvl] with beam_noise_mps"),
        ("name = -> name ==", "not valid TOML"),
        ("straight -> constant_turn", 'source = "analytic" alone'),
        ('"straight" -> "waypoints"\nsource = "analytic"', 'source = "vehicle" alone'),
        ('"straight" -> "straight"\nsway_gain_m = 0.6', "'sway_gain_m' belongs to source = \"analytic\""),
        ('"straight" -> "straight"\nsource = "analytic"\nvehicle = "a"', "'vehicle' belongs to source = \"vehicle\""),
        # Of [dvl], with which the text ends.
        ("beams_lost = [5]", "lost beam 5 does not exist, expected 1 to 4"),
        ("max_range_m = 50", "no [seabed] to range to"),
        ("min_range_m = 5\nmax_range_m = 3", "expected less than max_range_m"),
        ("dropouts = [{beams = [1, 1], mean_up_s = 2, mean_down_s = 1}]", "beam 1 stands in two dropouts"),
        ("outages = [{ beams = [1], from_s = 2.0, to_s = 2.0 }]", "ends at 2.0 s, expected after its start at 2.0 s"),
        ('[campaign]\nmethods = ["tc", "tc"]', "method 'tc' is named twice"),
        ('[campaign]\nmethods = ["tcc"]', "unknown method 'tcc', did you mean 'tc'"),
    ],
)  # fmt: skip
def test_faults_name_key_value_range_and_unit(change: str, message: str) -> None:
    """A user must find the line to mend from the message alone; `a -> b` replaces, other text is added."""
    old, arrow, new = (part.strip() for part in change.partition("->"))
    assert not arrow or old in TEXT
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(TEXT.replace(old, new) if arrow else TEXT + change, place="t.toml")
    assert message in str(caught.value)
    assert all(line.startswith("t.toml: ") for line in str(caught.value).splitlines())


def test_parts_that_contradict_each_other_are_refused() -> None:
    """A mission that nobody swims, and a pilot who is not aboard."""
    analytic = TEXT.replace("[imu]", 'source = "analytic"\n[mission]\ndepth_m = 5.0\n[imu]')
    with pytest.raises(ScenarioError, match="an analytic truth has no mission"):
        parse_scenario(analytic, place="t.toml")
    absent = TEXT.replace("[imu]", 'pilot = "lc"\n[campaign]\nmethods = ["tc"]\n[imu]')
    with pytest.raises(ScenarioError, match=r"trajectory\.pilot is 'lc', expected \"own\" or one of"):
        parse_scenario(absent, place="t.toml")


def test_another_source_drops_what_only_the_old_one_knew() -> None:
    """From vehicle to analytic and back: no key of the other source is left."""
    packaged = load_scenario("lawn_mower")
    assert packaged.mission
    exact = packaged.with_trajectory(source="analytic", leg_s=30.0)
    assert (exact.trajectory.source, exact.trajectory.leg_s, exact.mission) == ("analytic", 30.0, None)
    assert exact.with_trajectory(source="vehicle").trajectory.kind == "lawn_mower"
    with pytest.raises(ScenarioError, match="'leg_s' belongs to source"):
        packaged.with_trajectory(leg_s=30.0)


@pytest.mark.parametrize("name", packaged_scenarios())
def test_what_is_dumped_is_read_again(name: str) -> None:
    """The same scenario, with the same numbers, also by way of JSON; keys that would mean something are not made up."""
    scenario = load_scenario(name)
    for dumped in (scenario.model_dump(), json.loads(json.dumps(scenario.model_dump(mode="json")))):
        again = type(scenario).model_validate(dumped)
        assert again == scenario
        assert again.content_hash() == scenario.content_hash()
        assert again.kernel_model(9.8) == scenario.kernel_model(9.8)
        assert again.kernel_options() == scenario.kernel_options()
    analytic = scenario.with_trajectory(source="analytic", kind="straight")
    assert type(scenario).model_validate(analytic.model_dump()) == analytic


def test_a_path_through_waypoints_keeps_its_end() -> None:
    """Without a duration it ends at its last waypoint, also when it is read from what was dumped."""
    own = load_scenario("straight")
    content = own.model_dump(exclude_unset=True)
    content["trajectory"] = {"kind": "waypoints"}
    content["mission"] = {"waypoints_m": [[0.0, 0.0], [100.0, 0.0]], "depth_profile": [[0.0, 10.0]]}
    scenario = type(own).model_validate(content)
    again = type(own).model_validate(scenario.model_dump())
    assert "duration_s" not in again.trajectory.model_fields_set


def test_a_key_is_replaced_and_checked() -> None:
    scenario = load_scenario("straight")
    better = scenario.replace({"imu.gyro_bias_deg_per_h": 0.01})
    assert better.imu.gyro_bias_deg_per_h == 0.01
    assert better.replace({"imu.gyro_bias_deg_per_h": scenario.imu.gyro_bias_deg_per_h}) == scenario
    assert scenario.replace({"filter.water.slip_sd_mps": 0.05}).filter.water.slip_sd_mps == 0.05
    for key, value, message in (
        (
            "imu.gyro_bias_deg_h",
            0.01,
            "unknown key 'imu.gyro_bias_deg_h', did you mean 'gyro_bias_deg_per_h'",
        ),
        ("imu.rate_hz.x", 1.0, "unknown key 'imu.rate_hz.x'"),
        ("imu.rate_hz", -1.0, "'imu.rate_hz' is -1.0, expected >= 1.0"),
    ):
        with pytest.raises(ScenarioError, match=message):
            scenario.replace({key: value})


def test_keys_are_replaced_as_one() -> None:
    """What is valid only together is given together; a key within another would hide it; the error names the key."""
    scenario = load_scenario("straight")
    angles = {
        "dvl.configuration": "angles",
        "dvl.tilts_deg": [20.0] * 3,
        "dvl.azimuths_deg": [0.0, 120.0, 240.0],
    }
    with pytest.raises(ScenarioError, match="configuration 'angles' needs azimuths_deg and tilts_deg"):
        scenario.replace({"dvl.configuration": "angles"})
    made = scenario.replace(angles | {"dvl.beams_lost": [3]})
    assert (made.dvl.beams, made.dvl.beams_lost) == (3, (3,))
    with pytest.raises(ScenarioError, match="lost beam 4 does not exist, expected 1 to 3"):
        scenario.replace(angles | {"dvl.beams_lost": [4]})
    for both in ({"imu": {}, "imu.rate_hz": 100.0}, {"imu.rate_hz": 100.0, "imu": {}}):
        with pytest.raises(ScenarioError, match=r"'imu\.rate_hz' is part of 'imu', expected one of them"):
            scenario.replace(both)
    own: dict[str, Any] = {"speed_mps": 0.3, "towards_deg": 90.0}
    moved = scenario.replace({"mission.current": own, "imu.rate_hz": 100.0})
    assert moved.mission is not None
    assert moved.mission.current == CurrentTable(**own)
    assert own == {"speed_mps": 0.3, "towards_deg": 90.0}
    with pytest.raises(ScenarioError) as caught:
        scenario.replace({"imu.rate_hz": -1.0, "dvl.tilt": 30.0})
    assert "'imu.rate_hz' is -1.0" in str(caught.value)
    assert "'dvl.tilt', did you mean 'tilt_deg'" in str(caught.value)
    assert scenario.replace({}) == scenario
