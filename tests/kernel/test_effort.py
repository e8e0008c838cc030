"""Forces of thrusters in a navigator and a log: the literal equation, what they tell, refusals, bits."""

import numpy as np
import pytest

from bottomlock.errors import KernelError
from bottomlock.kernel import Navigator
from bottomlock.kernel.models import CurrentLayers, EffortModel, Levers, Options
from tests.kernel import documented_navigator as example
from tests.oracle import effort as oracle
from tests.oracle.rotations import matrix_from_euler, quaternion_from_euler

HULL = EffortModel(
    mass_kg=(20.0, 21.0, 32.0),
    linear_drag_kgps=(14.0, 20.0, 33.0),
    quadratic_drag_kgpm=(140.0, 0.0, 190.0),
    buoyancy_n=2.4,
)
MODEL = example.model.replace(
    effort=HULL, environment=example.model.environment.replace(earth_rate_radps=0.0)
)
LEVER = (-0.3, 0.1, 0.2)
ON = example.options.replace(
    thrust="all", gate="off", current_layers=CurrentLayers(sd_mps=0.0), levers=Levers(effort_p_m=LEVER)
)
AXES = ("effort_surge", "effort_sway", "effort_heave")


@pytest.mark.parametrize("pitch_deg", [0.0, 20.0, -75.0, 90.0])
def test_the_first_reading_is_the_literal_one(pitch_deg: float) -> None:
    """Innovation and its covariance of the surge, of dense matrices and central differences."""
    rng, angles = np.random.default_rng(4), (0.2, np.deg2rad(pitch_deg), 1.1)
    root = rng.normal(size=(20, 20)) * 0.02
    before = root @ root.T + 1e-3 * np.eye(20)
    before[3:6] *= 0.01
    before[:, 3:6] *= 0.01
    R, velocity, rate = matrix_from_euler(*angles), np.array([0.5, 0.1, -0.1]), np.array([0.05, -0.1, 0.2])
    initial = example.initial.replace(attitude_t_p=quaternion_from_euler(*angles), velocity_p_mps=velocity)
    force_p = R.T @ [0.0, 0.0, -example.gravity]
    flown = Navigator(example.janus, MODEL, ON, initial, method="ins", covariance=before)
    flown.push_imu(0, omega_p_radps=rate, force_p_mps2=force_p)
    forces, sd_n = np.array([40.0, 5.0, -12.0]), 1e-3
    reports = flown.push_effort(0, forces, sd_n=sd_n)
    assert [report.sensor for report in reports] == list(AXES)
    hull = oracle.Hull(
        np.array(HULL.mass_kg),
        np.array(HULL.linear_drag_kgps),
        np.array(HULL.quadratic_drag_kgpm),
        2.4,
        np.array(LEVER),
    )
    own = np.array([1.0] * 3 + [0.0] * 8)
    z = oracle.residual(hull, forces, R, velocity, rate, np.zeros(3), own)
    H = oracle.jacobian(hull, forces, R, velocity, rate, force_p, own, example.gravity)
    P = np.zeros((oracle.STATES, oracle.STATES))
    P[:20, :20] = before
    sd = (
        [HULL.speed_scale_sd] * 3
        + [HULL.slip_sd_mps] * 3
        + [HULL.inertia_sd] * 3
        + [ON.water.current_sd_mps] * 2
    )
    P[range(20, 31), range(20, 31)] = np.square(sd)
    S = float(H[0] @ P @ H[0])
    # The column of a is that of the speed without slip and noise.
    slip = z[0] * min(10.0 * HULL.slip_sd_mps**2 / S, 1.0)
    H[0, oracle.SCALE.start] += slip
    np.testing.assert_allclose(reports[0].residual, z[:1], atol=1e-9)
    np.testing.assert_allclose(reports[0].covariance, [[H[0] @ P @ H[0]]], rtol=1e-5)


@pytest.mark.parametrize(
    ("options", "force", "sd_n", "words"),
    [
        (
            example.options,
            [1.0, 0.0, 0.0],
            1.0,
            r'options.thrust is 0, expected "velocity" or "all" with model.effort',
        ),
        (ON, [0.0, 1.0], 1.0, "force_p_n"),
        (ON, [0.0, 1.0, 0.0], 0.0, "sd_n"),
    ],
)
def test_a_bad_push_is_refused_and_changes_nothing(
    options: Options, force: list[float], sd_n: float, words: str
) -> None:
    flown = Navigator(example.janus, MODEL, options, example.initial, method="tc")
    flown.push_imu(0, omega_p_radps=np.zeros(3), force_p_mps2=[0.0, 0.0, -example.gravity])
    before = flown.save()
    with pytest.raises(KernelError, match=words):
        flown.push_effort(0, force, sd_n=sd_n)
    assert flown.save() == before
    assert (flown.effort() is None) == (options.thrust == "off")
