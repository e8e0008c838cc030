"""The settings and the streaming face of the method sway_current."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from bottomlock import kernel
from bottomlock.config.scenario import load_scenario
from bottomlock.config.scenario_sections import Water
from bottomlock.kernel import Method, models
from tests.property import settings

JANUS = kernel.BeamGeometry.janus(np.deg2rad(20.0))
INITIAL: Any = {
    "time_ns": 0,
    "position_t_m": [0.0, 0.0, 0.0],
    "attitude_t_p": [1.0, 0.0, 0.0, 0.0],
    "velocity_p_mps": [2.0, 0.3, 0.0],
}


def swim(
    method: Method,
    seconds: int = 20,
    valid: tuple[bool, ...] = (True, True, False, False),
    model: Any = None,  # noqa: ANN401 - a dict
    **water: float,
) -> Any:  # noqa: ANN401 - a navigator and the reports of each ping
    """Straight to the north at 2 m/s in a current of 0.3 m/s to the east, on perfect sensors."""
    own = {"water": models.Water().as_dict() | water} if water else {}
    options: Any = settings.options(gate="joint") | own
    navigator = kernel.Navigator(JANUS, model or settings.table_2(), options, INITIAL, method=method)
    earth = settings.EARTH_RATE * np.array([np.cos(settings.LATITUDE_RAD), 0, -np.sin(settings.LATITUDE_RAD)])
    velocity = np.array([2.0, 0.3, 0.0])
    force = 2 * np.cross(earth, velocity) - np.array([0, 0, settings.GRAVITY])
    reports = []
    for k in range(seconds * 50 + 1):
        navigator.push_imu(k * 20_000_000, omega_p_radps=earth, force_p_mps2=force)
        if k and k % 50 == 0:
            beams = JANUS.beam_velocities([velocity])[0]
            reports.append(navigator.push_beams(k * 20_000_000, beams, valid, sd_mps=np.full(4, 0.042)))
    return navigator, reports


def test_each_ping_tells_of_beams_heave_and_sway() -> None:
    """The assumptions come after the beams, each with a report of its own."""
    _, reports = swim("sway_current")
    assert [report.sensor for report in reports[0]] == ["beams", "heave", "sway"]
    assert all(report.verdict == "accepted" for report in reports[-1])
    assert [report.sensor for report in swim("tc", 1)[1][0]] == ["beams"]


def test_the_current_is_found_where_the_sway_over_ground_is_known() -> None:
    """All beams on a leg to the north: the current's east part is the sway, its north part stays the prior's."""
    navigator, _ = swim("sway_current", valid=(True, True, True, True))
    water = navigator.water()
    sd = np.sqrt(np.diag(water["covariance"]))
    assert water["current_t_mps"][1] == pytest.approx(0.3, abs=3 * sd[1])
    assert sd[1] < 0.06
    assert sd[0] > 0.29
    assert water["restarts"] == 0
    assert swim("tc", 1)[0].water() is None


def test_the_current_is_stated_about_true_north_with_the_error_of_the_heading() -> None:
    """A heading that is uncertain by 0.2 rad turns 0.3 m/s to the east by 6 cm/s, which no beam or slip tells."""
    yaw_sd_rad = 0.2
    uncertain = settings.table_2()
    uncertain["initial"]["attitude_sd_rad"] = (1e-3, 1e-3, yaw_sd_rad)
    water = swim("sway_current", valid=(True, True, True, True), model=uncertain)[0].water()
    added = water["current_covariance"] - water["covariance"][:2, :2]
    assert added[0, 0] == pytest.approx((water["current_t_mps"][1] * yaw_sd_rad) ** 2, rel=0.1)
    assert abs(added[1, 1]) < 0.05 * added[0, 0]
    np.testing.assert_array_equal(water["current_covariance"], water["current_covariance"].T)


def test_the_selector_has_the_current_of_the_filter_it_selects() -> None:
    """`consistent` states the current as soon as its report says that `sway_current` is selected, and none before."""
    navigator = swim("consistent", 0)[0]
    assert navigator.water() is None
    navigator, reports = swim("consistent")
    assert reports[-1][0].choice["method"] == "sway_current"
    np.testing.assert_equal(navigator.water(), swim("sway_current")[0].water())
    restored: Any = kernel.Navigator.load(navigator.save())
    np.testing.assert_array_equal(
        restored.water()["current_covariance"], navigator.water()["current_covariance"]
    )


def test_the_slip_is_learned_at_full_lock_alone() -> None:
    """A vehicle without any slip: its variance comes down with all beams and stays the prior's with two.

    A ping knows the heave to 2 cm/s; the sway to 6 cm/s, three times the slip, so that there the prior stays.
    """
    for valid, learns in (((True, True, True, True), True), ((True, True, False, False), False)):
        water = swim("sway_current", 300, valid=valid)[0].water()
        assert water["alarms"] == 0
        assert (water["heave_slip_sd_mps"] < 0.6 * Water().slip_sd_mps) == learns
        assert (water["sway_slip_sd_mps"] != Water().slip_sd_mps) == learns
        assert water["sway_slip_sd_mps"] == pytest.approx(Water().slip_sd_mps, rel=0.1 if learns else 1e-12)


def test_packaged_prior_is_the_kernels_own() -> None:
    """Without a section `water` the kernel takes the defaults; the paper's scenarios have a current of six hours."""
    given, own = swim("sway_current", 5, current_sd_mps=Water().current_sd_mps)[0], swim("sway_current", 5)[0]
    np.testing.assert_array_equal(given.covariance(), own.covariance())
    np.testing.assert_array_equal(given.water()["covariance"], own.water()["covariance"])
    for name in ("straight", "figure_eight", "lawn_mower"):
        assert load_scenario(name).filter.water == Water(current_time_s=21_600.0)
        assert load_scenario(name).kernel_options().water == models.Water(current_time_s=21_600.0)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("current_sd_mps", -0.1),
        ("slip_sd_mps", 0.0),
        ("current_time_s", 0.0),
        ("slip_epochs", 0.5),
        ("sway_gain_m", np.nan),
    ],
)
def test_bad_priors_are_refused_by_name(key: str, value: float) -> None:
    with pytest.raises(kernel.KernelError, match=f"water.{key}"):
        swim("sway_current", 1, (True, True, False, False), **{key: value})
    with pytest.raises(ValidationError, match=key):
        Water.model_validate({key: value})


def test_a_prior_that_lacks_a_number_is_refused() -> None:
    options: Any = settings.options() | {"water": {"current_sd_mps": 0.3}}
    with pytest.raises(kernel.KernelError, match="current_time_s"):
        kernel.Navigator(JANUS, settings.table_2(), options, INITIAL, method="sway_current")
    with pytest.raises(kernel.KernelError, match=r"options\.water is of type int, expected a dict"):
        kernel.Navigator(JANUS, settings.table_2(), options | {"water": 3}, INITIAL, method="sway_current")


def test_a_covariance_at_the_start_reaches_both_filters() -> None:
    """Given a covariance, the method starts from it, with the prior of the water as it was."""
    covariance = np.diag(np.arange(1.0, 21.0) * 1e-4)
    navigator = kernel.Navigator(
        JANUS, settings.table_2(), settings.options(), INITIAL, method="sway_current", covariance=covariance
    )
    np.testing.assert_array_equal(navigator.covariance(), covariance)
    water: Any = navigator.water()
    assert water["restarts"] == 0
    assert np.sqrt(water["covariance"][0, 0]) == pytest.approx(Water().current_sd_mps)
