"""Water track through the navigator and a replayed log: by hand, by the literal equation, refused where it is off."""

from typing import Any

import numpy as np
import pytest

from bottomlock.errors import KernelError
from bottomlock.kernel import Navigator
from bottomlock.kernel.models import CurrentLayers
from tests.kernel import documented_navigator as example
from tests.oracle.rotations import matrix_from_euler, quaternion_from_euler

RPY_RAD = (0.2, -0.4, 1.1)
ONE_CURRENT = CurrentLayers(sd_mps=0.0)
ON = example.options.replace(water_track=True, gate="off", current_layers=ONE_CURRENT)
LAYERED = ON.replace(current_layers=CurrentLayers())


def navigator(options: Any = ON, **changes: Any) -> Navigator:  # noqa: ANN401 - of the initial state
    """At a turned attitude, before any reading."""
    turned = example.initial.replace(attitude_t_p=quaternion_from_euler(*RPY_RAD), **changes)
    return Navigator(example.janus, example.model, options, turned, method="tc")


def test_the_row_is_the_literal_equation() -> None:
    """Z = y − bᵀ(v − Rᵀc); S has velocity, bias, scale factor, noise, and the current seen along the beam."""
    flown, beam_mps = navigator(), np.array([0.1, 0.6, 0.4, -0.2])
    valid, sd = np.array([True, True, False, True]), np.full(4, 0.05)
    (report,) = flown.push_water_track(0, beam_mps, valid, sd_mps=sd) or _after_a_reading(flown)
    model, current_sd = example.model, ON.water.current_sd_mps
    b = np.asarray(example.janus.directions_p)[valid]
    v, R = np.array([2.0, 0.0, 0.0]), matrix_from_euler(*RPY_RAD)
    np.testing.assert_allclose(report.residual, beam_mps[valid] - b @ v, atol=1e-12)
    across = (b @ R.T)[:, :2]
    dvl: Any = model.dvl
    expected = (
        b @ np.diag(np.square(model.initial.velocity_sd_mps)) @ b.T
        + np.eye(3) * (dvl.beam_bias_sd_mps**2 + 0.05**2)
        + np.outer(b @ v, b @ v) * dvl.scale_factor_sd**2
        + across @ across.T * current_sd**2
    )
    np.testing.assert_allclose(report.covariance, expected, rtol=1e-9)
    assert (report.sensor, report.verdict) == ("water_track", "accepted")


def test_a_cell_between_layers_is_the_literal_equation() -> None:
    """Layers each have a current of their own: of the two about a cell each counts by its distance."""
    flown, range_m = navigator(LAYERED, position_t_m=(0.0, 0.0, 13.0)), 9.0
    beam_mps, sd = np.array([0.1, 0.6, 0.4, -0.2]), np.full(4, 0.05)
    (report,) = flown.push_water_track(
        0, beam_mps, np.ones(4, dtype=bool), sd_mps=sd, range_m=range_m
    ) or _after_a_reading(flown)
    b, R = np.asarray(example.janus.directions_p), matrix_from_euler(*RPY_RAD)
    depth_m = 13.0 + range_m * (b @ R.T)[:, 2]
    layers_m = np.array([10.0, 20.0, 30.0, 40.0])
    weights = np.array([np.interp(depth_m, layers_m, one) for one in np.eye(4)]).T
    prior, own = LAYERED.water, LAYERED.current_layers
    across = (b @ R.T)[:, :2]
    shared = weights @ weights.T * own.sd_mps**2 + prior.current_sd_mps**2
    v, dvl = np.array([2.0, 0.0, 0.0]), example.model.dvl
    assert dvl is not None
    expected = (
        b @ np.diag(np.square(example.model.initial.velocity_sd_mps)) @ b.T
        + np.eye(4) * (dvl.beam_bias_sd_mps**2 + 0.05**2)
        + np.outer(b @ v, b @ v) * dvl.scale_factor_sd**2
        + across @ across.T * shared
    )
    np.testing.assert_allclose(report.covariance, expected, rtol=1e-9)


@pytest.mark.parametrize("range_m", [-1.0, 2000.1, float("nan")])
def test_a_range_that_no_cell_has_is_refused(range_m: float) -> None:
    flown = navigator(LAYERED)
    with pytest.raises(KernelError, match=r"water track range_m is .*from 0"):
        flown.push_water_track(
            0, np.zeros(4), np.ones(4, dtype=bool), sd_mps=np.full(4, 0.05), range_m=range_m
        )


def _after_a_reading(flown: Navigator) -> list[Any]:
    """A measurement at the start waits for the first inertial reading."""
    return flown.push_imu(0, omega_p_radps=np.zeros(3), force_p_mps2=[0.0, 0.0, -example.gravity])


def test_is_refused_where_it_is_off() -> None:
    flown = navigator(example.options)
    with pytest.raises(KernelError, match=r"options\.water_track is false, expected true"):
        flown.push_water_track(0, np.zeros(4), np.ones(4, dtype=bool), sd_mps=np.full(4, 0.05))
    assert flown.water() is None
