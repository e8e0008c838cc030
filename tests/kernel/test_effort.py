"""Forces of thrusters in a navigator and a log: the literal equation, what they tell, refusals, bits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bottomlock.errors import KernelError
from bottomlock.kernel import Method, Navigator, replay_log
from bottomlock.kernel.models import CurrentLayers, EffortModel, Options
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
    thrust="all", gate="off", current_layers=CurrentLayers(sd_mps=0.0), effort_lever_p_m=LEVER
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


def crabbing(*, forces: bool) -> Navigator:
    """Half a minute at 0.4 m/s ahead and 0.2 m/s across with four beams, and three minutes with none."""
    steady = ON.water.replace(current_time_s=1e9)
    used = ON.replace(thrust="velocity", water=steady, effort_lever_p_m=(0.0, 0.0, 0.0))
    flown = Navigator(example.janus, MODEL, used, example.initial.replace(velocity_p_mps=(0.4, 0.2, 0.0)))
    every, sd = np.ones(4, dtype=bool), np.full(4, 0.02)
    ahead = example.janus.beam_velocities([[0.4, 0.2, 0.0]])[0]
    force = [14.0 * 0.4 + 140.0 * 0.16, 20.0 * 0.2, 2.4]
    for step in range(21001):
        flown.push_imu(
            step * 10_000_000, omega_p_radps=np.zeros(3), force_p_mps2=[0.0, 0.0, -example.gravity]
        )
        if step % 50 == 25 and step < 3000:
            flown.push_beams(step * 10_000_000, ahead, every, sd_mps=sd)
        if forces and step % 50 == 0:
            flown.push_effort(step * 10_000_000, force, sd_n=1.0)
    return flown


def test_the_velocity_is_kept_when_the_bottom_is_lost() -> None:
    """Ahead and across it is as certain as slip and current; without forces as the biases."""
    flown, without = crabbing(forces=True), crabbing(forces=False)
    with_it, alone = (np.sqrt(np.diag(one.covariance())[6:8]) for one in (flown, without))
    assert (with_it < 0.2 * alone).all()
    np.testing.assert_allclose(flown.state()["velocity_p_mps"], [0.4, 0.2, 0.0], atol=0.02)
    assert without.effort() is not None
    learned: Any = flown.effort()
    np.testing.assert_allclose(learned["speed_scale"], 1.0, atol=0.02)
    assert learned["covariance"].shape == (9, 9)


def test_wrong_forces_are_gated_and_then_widen_the_scale() -> None:
    """Readings far off move nothing; ones that go on are believed after five, and named as inflation."""
    flown = Navigator(example.janus, MODEL, ON.replace(gate="joint"), example.initial)
    verdicts = []
    for step in range(6):
        flown.push_imu(
            step * 10_000_000, omega_p_radps=np.zeros(3), force_p_mps2=[0.0, 0.0, -example.gravity]
        )
        before = flown.state()["velocity_p_mps"]
        report, *_ = flown.push_effort(step * 10_000_000, [2075.0, 0.0, 2.4], sd_n=1.0)
        verdicts.append((report.verdict, report.inflation is not None))
        if report.verdict == "rejected":
            np.testing.assert_allclose(flown.state()["velocity_p_mps"][0], before[0], rtol=1e-12)
    assert verdicts[:5] == [("rejected", False)] * 4 + [("accepted", True)]
    assert flown.effort()["speed_scale"][0] < 0.9  # type: ignore[index]


@pytest.mark.parametrize(
    ("options", "force", "sd_n", "words"),
    [
        (
            example.options,
            [1.0, 0.0, 0.0],
            1.0,
            r'options.thrust is 0, expected "velocity" or "all" with model.effort',
        ),
        (ON, [1e10, 0.0, 0.0], 1.0, "no thruster has as much"),
        (ON, [0.0, np.nan, 0.0], 1.0, "force_p_n"),
        (ON, [0.0, 1.0], 1.0, "force_p_n"),
        (ON, [0.0, 1.0, 0.0], 0.0, "sd_n"),
    ],
)
def test_a_bad_push_is_refused_and_changes_nothing(
    options: Options, force: list[float], sd_n: float, words: str
) -> None:
    flown = Navigator(example.janus, MODEL, options, example.initial)
    flown.push_imu(0, omega_p_radps=np.zeros(3), force_p_mps2=[0.0, 0.0, -example.gravity])
    before = flown.save()
    with pytest.raises(KernelError, match=words):
        flown.push_effort(0, force, sd_n=sd_n)
    assert flown.save() == before
    assert (flown.effort() is None) == (options.thrust == "off")


def test_a_model_without_mass_or_drag_is_named() -> None:
    with pytest.raises(KernelError, match=r"effort\.mass_kg of an axis with drag is 0"):
        Navigator(
            example.janus, MODEL.replace(effort=HULL.replace(mass_kg=(20.0, 0.0, 30.0))), ON, example.initial
        )
    none = HULL.replace(linear_drag_kgps=(0.0,) * 3, quadratic_drag_kgpm=(0.0,) * 3)
    with pytest.raises(KernelError, match=r"thrust\.advance_m is 0"):
        Navigator(example.janus, MODEL.replace(effort=none), ON, example.initial)
    with pytest.raises(KernelError, match=r"effort\.speed_scale_sd is 2, expected 0 to 1"):
        Navigator(example.janus, MODEL.replace(effort=HULL.replace(speed_scale_sd=2.0)), ON, example.initial)


def test_a_log_gives_the_bits_of_the_navigator() -> None:
    rng, imu_ns = np.random.default_rng(3), np.arange(0, 4_000_000_000, 10_000_000)
    force = np.tile([0.0, 0.0, -example.gravity], (len(imu_ns), 1)) + 0.01 * rng.normal(size=(len(imu_ns), 3))
    omega, effort_ns = 0.01 * rng.normal(size=force.shape), imu_ns[25::50] + 3_000_000
    forces = np.array([40.0, 0.0, 2.4]) + rng.normal(size=(len(effort_ns), 3))
    log: Any = {
        "imu_time_ns": imu_ns,
        "force_p_mps2": force,
        "omega_p_radps": omega,
        "dvl_time_ns": np.empty(0, dtype=np.int64),
        "beam_velocity_mps": np.empty((0, 4)),
        "beam_valid": np.empty((0, 4), dtype=bool),
        "effort_time_ns": effort_ns,
        "effort_force_p_n": forces,
    }
    methods: tuple[Method, ...] = ("ins", "tc", "sway_current", "consistent")
    for method in methods:
        out: Any = replay_log(
            example.janus,
            MODEL,
            ON,
            [method],
            log,
            example.initial,
            sample_time_ns=imu_ns[-1:],
            innovations=True,
        )
        (records,) = out["innovations"]
        for axis in AXES:
            np.testing.assert_array_equal(records[axis]["time_ns"], effort_ns)
        flown = Navigator(example.janus, MODEL, ON, example.initial, method=method)
        waiting = list(range(len(effort_ns)))
        for k, time_ns in enumerate(imu_ns.tolist()):
            while waiting and effort_ns[waiting[0]] <= time_ns:
                row = waiting.pop(0)
                flown.push_effort(effort_ns[row], forces[row], sd_n=HULL.noise_sd_n)
            flown.push_imu(time_ns, omega_p_radps=omega[k], force_p_mps2=force[k])
        assert out["velocity_p_mps"][0, 0].tolist() == list(flown.state()["velocity_p_mps"])
        loaded: Any = Navigator.load(flown.save())
        np.testing.assert_equal(loaded.effort(), flown.effort())
