"""The settings and the streaming face of the method sway_current."""

from typing import Any

import numpy as np
import pytest

from bottomlock import kernel
from bottomlock.config.scenario import load_scenario
from bottomlock.config.scenario_sections import Water
from bottomlock.kernel import Method, models
from tests.property import settings

JANUS = kernel.BeamGeometry.janus(np.deg2rad(20.0))
INITIAL: Any = settings.start(velocity=[2.0, 0.3, 0.0])


def swim(
    method: Method, seconds: int = 20, valid: tuple[bool, ...] = (True, True, False, False), **water: float
) -> Any:  # noqa: ANN401 - a navigator and the reports of each ping
    """Straight to the north at 2 m/s in a current of 0.3 m/s to the east, on perfect sensors."""
    own = {"water": models.Water().as_dict() | water} if water else {}
    options: Any = settings.options(gate="joint") | own
    navigator = kernel.Navigator(JANUS, settings.table_2(), options, INITIAL, method=method)
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


def test_packaged_prior_is_the_kernels_own() -> None:
    """Without a section `water` the kernel takes the defaults; the paper's scenarios have a current of six hours."""
    given, own = swim("sway_current", 5, current_sd_mps=Water().current_sd_mps)[0], swim("sway_current", 5)[0]
    np.testing.assert_array_equal(given.covariance(), own.covariance())
    np.testing.assert_array_equal(given.water()["covariance"], own.water()["covariance"])
    for name in ("straight", "figure_eight", "lawn_mower"):
        assert load_scenario(name).filter.water == Water(current_time_s=21_600.0)
        assert load_scenario(name).kernel_options().water == models.Water(current_time_s=21_600.0)


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
