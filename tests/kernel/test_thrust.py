"""Speeds by the drives in a navigator: the literal equation along each axis."""

from typing import Any, Literal

import numpy as np
import pytest

from bottomlock.kernel import KernelError, Navigator, check_settings
from bottomlock.kernel.models import CurrentLayers, ThrustModel
from tests.kernel import documented_navigator as example
from tests.oracle import thrust as oracle
from tests.oracle.rotations import matrix_from_euler, quaternion_from_euler

PROPELLER = ThrustModel(scale_sd=[0.1, 0.0, 0.0], slip_sd_mps=[0.02, 0.0, 0.0])
MODEL = example.model.replace(
    thrust=PROPELLER, environment=example.model.environment.replace(earth_rate_radps=0.0)
)
ON = example.options.replace(thrust="velocity", gate="off", current_layers=CurrentLayers(sd_mps=0.0))
GRAVITY = np.array([0.0, 0.0, -example.gravity])


def still(navigator: Navigator, time_ns: int) -> list[Any]:
    reports: list[Any] = navigator.push_imu(time_ns, omega_p_radps=np.zeros(3), force_p_mps2=GRAVITY)
    return reports


@pytest.mark.parametrize("pitch_deg", [0.0, 20.0, 89.9, 90.0, -90.0])
@pytest.mark.parametrize("used", ["velocity", "all"])
@pytest.mark.parametrize("k", [0, 1, 2])
def test_updates_are_the_literal_filter(k: int, used: Literal["velocity", "all"], pitch_deg: float) -> None:
    """Innovation, states, scale, slip, current and covariance after a reading, of dense matrices."""
    axis = np.eye(3)[k]
    drives = ThrustModel(scale_sd=0.1 * axis, slip_sd_mps=0.02 * axis)
    rng, angles = np.random.default_rng(4), (0.2, np.deg2rad(pitch_deg), 1.1)
    root = rng.normal(size=(20, 20)) * 0.02
    initial = example.initial.replace(attitude_t_p=quaternion_from_euler(*angles))
    before = root @ root.T + 1e-3 * np.eye(20)
    before[3:6] *= 0.01
    before[:, 3:6] *= 0.01
    model = MODEL.replace(thrust=drives)
    flown = Navigator(example.janus, model, ON.replace(thrust=used), initial, method="ins", covariance=before)
    still(flown, 0)
    P = np.zeros((24, 24))
    P[:20, :20] = before
    P[[20, 21, 22, 23], [20, 21, 22, 23]] = np.square(
        [0.1, 0.02, ON.water.current_sd_mps, ON.water.current_sd_mps]
    )
    velocity, R = np.array([2.0, 0.0, 0.0]), matrix_from_euler(*angles)
    scale, slip, current = 1.0, 0.0, np.zeros(2)
    corrected = np.ones(24) if used == "all" else np.isin(np.arange(24), [*range(6, 9), *range(20, 24)]) * 1.0
    n = (2.3, 0.3, -0.2)[k]
    (report,) = flown.push_thrust(0, n * axis, sd_mps=0.02)
    z = oracle.residual(axis, n, scale, slip, velocity, R, current)
    H = oracle.jacobian(axis, n, R, current)
    H = oracle.jacobian(axis, oracle.without_slip(n, z, P, H, 0.02**2, scale), R, current)
    name = ("thrust_surge", "thrust_sway", "thrust_heave")[k]
    assert (report.sensor, report.verdict, report.degrees) == (name, "accepted", 1)
    np.testing.assert_allclose(report.residual, [z], atol=1e-12)
    np.testing.assert_allclose(report.covariance, H @ P @ H.T + 0.02**2, rtol=1e-9)
    error, P = oracle.update(P, H, 0.02**2, z, corrected)
    state, estimated, water = flown.state(), flown.thrust(), flown.water()
    assert estimated is not None
    assert water is not None
    np.testing.assert_allclose(state["velocity_p_mps"], velocity + error[6:9], atol=1e-9)
    np.testing.assert_allclose(state["position_t_m"], np.array([0.0, 0.0, 20.0]) + error[:3], atol=1e-9)
    found = [estimated["scale"][k], estimated["slip_mps"][k]]
    np.testing.assert_allclose(found, [scale + error[20], slip + error[21]], atol=1e-10)
    np.testing.assert_allclose(water["current_t_mps"], current + error[22:24], atol=1e-10)
    own = estimated["covariance"][np.ix_([k, 3 + k], [k, 3 + k])]
    np.testing.assert_allclose(own, P[20:22, 20:22], atol=1e-10)
    np.testing.assert_allclose(flown.covariance(), P[:20, :20], atol=1e-9)


def test_what_simulations_alone_have_may_be_left_out() -> None:
    """Of a model in plain numbers, as a C program states it."""
    section = {"scale_sd": [0.1] * 3, "slip_sd_mps": [0.02] * 3, "slip_time_s": 5.0, "noise_sd_mps": 0.01}
    check_settings("thrust", section)
    with pytest.raises(KernelError, match="slip_time_s is missing"):
        check_settings("thrust", {key: value for key, value in section.items() if key != "slip_time_s"})
