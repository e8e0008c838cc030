"""Packaged grades of instruments: units, order, sources, and single keys that override them."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

import bottomlock
from bottomlock import kernel
from bottomlock.config.instrument_grades import Kind, grade_of, grades
from bottomlock.config.scenario import load_scenario
from bottomlock.config.scenario_sections import Filter
from bottomlock.errors import ScenarioError
from bottomlock.kernel import models


def test_a_grade_in_si_is_that_of_its_data_sheet() -> None:
    """Xsens MTi-G, converted here by hand: 3600 deg/h is 1 deg/s, 3 deg/sqrt(h) is 0.05 deg/sqrt(s), 2 mg."""
    model = bottomlock.imu("mti")
    assert model.gyro_bias_sd_radps == pytest.approx(np.pi / 180.0)
    assert model.gyro_noise_rad_rts == pytest.approx(0.05 * np.pi / 180.0)
    assert model.accel_bias_sd_mps2 == pytest.approx(0.0196133)
    assert model.accel_noise_mps_rts == pytest.approx(0.002)
    # 10 deg/h and 15 ug within an hour.
    assert model.gyro_bias_walk_radps_rts == pytest.approx(
        np.deg2rad(10.0 / 3600.0) * np.sqrt(2 / 3600), rel=0.01
    )
    assert model.accel_bias_walk_mps2_rts == pytest.approx(15e-6 * 9.80665 * np.sqrt(2 / 3600), rel=0.01)


def test_the_torpedo_is_the_kernels_own_and_vehicles_fill_the_keys_left_out() -> None:
    """Without a vehicle the prior is that of the packaged torpedo."""
    assert bottomlock.vehicle_water("torpedo") == models.Water()
    own = Filter.model_validate({"water": {"vehicle": "hovering", "slip_time_s": 30.0}}).kernel_options()[
        "water"
    ]
    assert own == bottomlock.vehicle_water("hovering").as_dict() | {"slip_time_s": 30.0}
    with pytest.raises(ValidationError, match="vehicle is 'boat', expected one of torpedo, hovering, glider"):
        Filter.model_validate({"water": {"vehicle": "boat"}})
    with pytest.raises(ScenarioError, match="vehicle is 'rov'"):
        bottomlock.vehicle_water("rov")


@pytest.mark.parametrize("name", list(grades("water")))
def test_every_vehicle_has_a_source_and_a_prior_that_the_kernel_takes(name: str) -> None:
    one = grade_of("water", name)
    assert len(one.source) > 20
    assert set(one.keys) == set(models.Water().as_dict())
    water = bottomlock.vehicle_water(name)
    kernel.check_settings(water.place, water.as_dict())


@pytest.mark.parametrize("kind", ["imu", "attitude"])
def test_every_grade_has_the_same_keys_and_a_source(kind: Kind) -> None:
    found = grades(kind)
    first = next(iter(found.values()))
    for one in found.values():
        common = {key for key in one.keys if "warm_up" not in key}
        assert common | {"gyro_g_sensitivity_deg_per_h_per_g"} >= first.keys.keys() >= common, one.name
        assert min(one.keys.values()) > 0.0, one.name
        assert len(one.source) > 20, one.name
        assert ("max_rate_deg_per_s" in one.keys) == (kind == "imu"), one.name


def test_biases_fall_from_grade_to_grade() -> None:
    """The list begins with the coarsest; industrial MEMS is better than an early AHRS."""
    biases = [one.keys["gyro_bias_deg_per_h"] for one in grades("imu").values() if one.name != "autopilot"]
    assert biases == sorted(biases, reverse=True)


def test_a_scenario_changes_its_grade() -> None:
    """Keys that the grade gave go with it; keys that the scenario states stay."""
    scenario = load_scenario("straight")
    content = scenario.model_dump(exclude_unset=True)
    content["imu"] = {"grade": "phone", "accel_bias_mg": 7.0}
    other = type(scenario).model_validate(content).replace({"imu.grade": "ring_laser"})
    assert other.imu.gyro_bias_deg_per_h == 0.01
    assert other.imu.accel_bias_mg == 7.0


def test_an_unknown_grade_names_those_known() -> None:
    with pytest.raises(
        ScenarioError,
        match=r"'mtx', did you mean 'mti'\? expected one of phone, autopilot, mti.*bottomlock list grades",
    ):
        load_scenario("straight").replace({"imu.grade": "mtx"})
    with pytest.raises(ScenarioError, match="expected one of"):
        bottomlock.imu("MTi")
