"""Missions of version 1.1 with slip and of a vehicle that hovers: dealt by their rule, and moving as they say."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from partialdvl_bench.make import make_mission
from partialdvl_bench.mission_list import levels, missions_of
from partialdvl_bench.slip import drawn_slip, slipping
from partialdvl_bench.worlds import simulation_of
from tests.bench.dealt import SLIPS, second_list
from tests.bench.missions import SEED


def test_the_list_is_what_the_rule_deals() -> None:
    listed = [spec for spec in missions_of(version="1.1") if spec.split == "test" or not spec.heading]
    assert listed == second_list()
    assert tuple(levels()["slip"]) == SLIPS


def test_a_level_is_called_what_it_is() -> None:
    for name, own in levels()["slip"].items():
        assert name == f"slip_{100 * own['sd_mps']:.0f}cm_{own['time_s']:.0f}s"


def test_a_slip_has_its_spread_and_lasts_its_time() -> None:
    """RMS and autocorrelation at one correlation time, 1/e, over 4000 correlation times."""
    slip = drawn_slip(np.random.default_rng(3), sd_mps=0.1, time_s=5.0, duration_s=20_000.0)
    values = slip(np.arange(0.0, 20_000.0, 1.0))
    assert np.sqrt(np.mean(values**2)) == pytest.approx(0.1, rel=0.05)
    assert np.mean(values[5:] * values[:-5]) / np.mean(values**2) == pytest.approx(np.exp(-1.0), abs=0.05)
    first = [
        drawn_slip(np.random.default_rng(k), sd_mps=0.1, time_s=60.0, duration_s=10.0)(0.0)
        for k in range(500)
    ]
    assert np.std(first) == pytest.approx(0.1, rel=0.1)


def test_readings_and_path_are_those_of_the_motion_with_slip() -> None:
    """v̇ = R f + g − 2 ω_ie × v in tangent axes and ṗ = v, by differences; the sway has the slip besides."""
    spec = replace(
        next(s for s in missions_of(version="1.1") if s.slip == "slip_20cm_5s" and s.split == "train"),
        duration_s=40.0,
    )
    simulation = simulation_of(spec, SEED)
    own = simulation.truth()
    slip = drawn_slip(np.random.default_rng(5), sd_mps=0.2, time_s=5.0, duration_s=40.0)
    # A plane Earth that turns a hundred times too fast, so that its part is seen.
    rate = 100.0 * simulation.earth_rate_radps
    earth_t = rate * np.array([np.cos(own.latitude_rad), 0.0, -np.sin(own.latitude_rad)])
    moved = slipping(own, slip, rate)
    t = own.time_ns * 1e-9
    np.testing.assert_allclose(
        moved.velocity_p_mps - own.velocity_p_mps, np.outer(slip(t), [0.0, 1.0, 0.0]), atol=1e-12
    )
    turned = Rotation.from_quat(own.attitude_t_p, scalar_first=True)
    aside = turned.apply(moved.velocity_p_mps - own.velocity_p_mps)
    gained = np.gradient(moved.position_t_m - own.position_t_m, t, axis=0)
    np.testing.assert_allclose(gained[1:-1], aside[1:-1], atol=2e-4)
    # The force that is added turns with the platform, whose rate in the tangent frame is ω_ip − Rᵀω_ie.
    force = turned.apply(moved.force_p_mps2 - own.force_p_mps2)
    # ω_ip of the truth holds the true Earth's rate; the rest of the one that is too fast is left over.
    left = np.cross(
        turned.apply(turned.apply(simulation.earth_rate_radps * earth_t / rate, inverse=True)), aside
    )
    expected = np.gradient(aside, t, axis=0) + np.cross(earth_t, aside) + left
    np.testing.assert_allclose(force[2:-2], expected[2:-2], atol=2e-3)
    assert np.abs(np.cross(earth_t, aside)).max() > 1e-3


def test_the_slip_is_added_and_told_to_no_estimator() -> None:
    """Data but for the name as without it in what the case states; the true sway has the slip's size more."""
    spec = replace(next(s for s in missions_of(version="1.1") if s.slip == "slip_20cm_60s"), duration_s=60.0)
    with_slip, without = (make_mission(one, SEED) for one in (spec, replace(spec, slip="")))
    assert "slip" not in with_slip.case.replace(spec.name, "")
    stated = [
        [
            line
            for line in made.case.splitlines()
            if not line.startswith(("name", "roll", "pitch", "heading_deg", "pos", "vel"))
        ]
        for made in (with_slip, without)
    ]
    assert stated[0] == stated[1]
    assert with_slip.truth["sway_mps"].to_numpy().std() > 0.05


def test_a_hovering_vehicle_holds_its_heading_and_its_kind_is_stated() -> None:
    spec = replace(
        next(s for s in missions_of(version="1.1") if s.vehicle == "bluerov2_heavy" and s.split == "train"),
        duration_s=60.0,
    )
    made = make_mission(spec, SEED)
    yaw = np.unwrap(made.truth["yaw_rad"].to_numpy())
    assert np.ptp(yaw) < np.deg2rad(2.0)
    assert '[filter.water]\nvehicle = "hovering"' in made.case
    path = made.truth.select("position_north_m", "position_east_m").to_numpy()
    assert 10.0 < np.linalg.norm(np.diff(path, axis=0), axis=1).sum() < 30.0
