"""Revolutions of the propeller in a navigator and a log: the literal equation, what they tell, refusals, bits."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import pytest

from bottomlock.errors import KernelError
from bottomlock.kernel import Method, Navigator, replay_log
from bottomlock.kernel.models import CurrentLayers, Options, ThrustModel
from tests.kernel import documented_navigator as example
from tests.oracle import thrust as oracle
from tests.oracle.rotations import matrix_from_euler, quaternion_from_euler

PROPELLER = ThrustModel(advance_m=0.1, advance_sd_m=0.01)
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
def test_updates_are_the_literal_filter(used: Literal["velocity", "all"], pitch_deg: float) -> None:
    """Innovation, states, advance, slip, current and covariance after a reading, of dense matrices."""
    rng, angles = np.random.default_rng(4), (0.2, np.deg2rad(pitch_deg), 1.1)
    root = rng.normal(size=(20, 20)) * 0.02
    initial = example.initial.replace(attitude_t_p=quaternion_from_euler(*angles))
    before = root @ root.T + 1e-3 * np.eye(20)
    before[3:6] *= 0.01
    before[:, 3:6] *= 0.01
    flown = Navigator(example.janus, MODEL, ON.replace(thrust=used), initial, method="ins", covariance=before)
    still(flown, 0)
    P = np.zeros((24, 24))
    P[:20, :20] = before
    P[[20, 21, 22, 23], [20, 21, 22, 23]] = np.square(
        [0.01, PROPELLER.slip_sd_mps, ON.water.current_sd_mps, ON.water.current_sd_mps]
    )
    velocity, R = np.array([2.0, 0.0, 0.0]), matrix_from_euler(*angles)
    advance, slip, current = 0.1, 0.0, np.zeros(2)
    corrected = np.ones(24) if used == "all" else np.isin(np.arange(24), [*range(6, 9), *range(20, 24)]) * 1.0
    n = 23.0
    (report,) = flown.push_thrust(0, n, sd_mps=0.02)
    z = oracle.residual(n, advance, slip, velocity, R, current)
    H = oracle.jacobian(n, R, current)
    H = oracle.jacobian(oracle.without_slip(n, z, P, H, 0.02**2, advance), R, current)
    assert (report.sensor, report.verdict, report.degrees) == ("thrust", "accepted", 1)
    np.testing.assert_allclose(report.residual, [z], atol=1e-12)
    np.testing.assert_allclose(report.covariance, H @ P @ H.T + 0.02**2, rtol=1e-9)
    error, P = oracle.update(P, H, 0.02**2, z, corrected)
    state, estimated, water = flown.state(), flown.thrust(), flown.water()
    assert estimated is not None
    assert water is not None
    np.testing.assert_allclose(state["velocity_p_mps"], velocity + error[6:9], atol=1e-9)
    np.testing.assert_allclose(state["position_t_m"], np.array([0.0, 0.0, 20.0]) + error[:3], atol=1e-9)
    found = [estimated["advance_m"], estimated["slip_mps"]]
    np.testing.assert_allclose(found, [advance + error[20], slip + error[21]], atol=1e-10)
    np.testing.assert_allclose(water["current_t_mps"], current + error[22:24], atol=1e-10)
    np.testing.assert_allclose(estimated["covariance"], P[20:22, 20:22], atol=1e-10)
    np.testing.assert_allclose(flown.covariance(), P[:20, :20], atol=1e-9)


def test_a_current_moves_the_row() -> None:
    """With a current that was learned ahead, the next reading is expected by it: the literal residual, twice."""
    flown = Navigator(example.janus, MODEL, ON, example.initial)
    for step, n in enumerate((14.0, 17.0, 16.0)):
        still(flown, step * 10_000_000)
        state, estimated, water = flown.state(), flown.thrust(), flown.water()
        assert estimated is not None
        assert water is not None
        (report,) = flown.push_thrust(step * 10_000_000, n, sd_mps=0.02)
        velocity, current = np.asarray(state["velocity_p_mps"]), np.asarray(water["current_t_mps"])
        z = oracle.residual(n, estimated["advance_m"], estimated["slip_mps"], velocity, np.eye(3), current)
        # Slip and current have been kept for a hundredth of a second since.
        np.testing.assert_allclose(report.residual, [z], atol=1e-4)
    assert flown.water()["current_t_mps"][0] > 0.1  # type: ignore[index]


def after_the_bottom(*, turns: bool) -> Navigator:
    """After half a minute at 2 m/s with four beams, and three with none."""
    steady = ON.replace(water=ON.water.replace(current_time_s=1e9))
    flown = Navigator(example.janus, MODEL, steady, example.initial)
    every, sd = np.ones(4, dtype=bool), np.full(4, 0.02)
    ahead = example.janus.beam_velocities([[2.0, 0.0, 0.0]])[0]
    for step in range(21001):
        still(flown, step * 10_000_000)
        if step % 50 == 25 and step < 3000:
            flown.push_beams(step * 10_000_000, ahead, every, sd_mps=sd)
        if turns and step % 50 == 0:
            flown.push_thrust(step * 10_000_000, 16.0, sd_mps=0.01)
    return flown


def test_the_speed_is_kept_when_the_bottom_is_lost() -> None:
    """Of 2 m/s ahead it is as certain as the slip; without them as the biases. Seen: 0.04 m/s and 0.32."""
    flown, without = after_the_bottom(turns=True), after_the_bottom(turns=False)
    with_it, alone = (np.sqrt(one.covariance()[6, 6]) for one in (flown, without))
    assert with_it < 0.2 * alone
    assert flown.state()["velocity_p_mps"][0] == pytest.approx(2.0, abs=0.02)
    learned: Any = flown.thrust()
    water: Any = flown.water()
    assert 16.0 * learned["advance_m"] + water["current_t_mps"][0] == pytest.approx(2.0, abs=0.02)
    # Apart they are as unknown as 10 % of 1.6 m/s beside 0.3 m/s leave them.
    expected = 0.01 * 0.3 / np.hypot(0.3, 0.16)
    assert np.sqrt(learned["covariance"][0, 0]) == pytest.approx(expected, rel=0.05)


def test_wrong_revolutions_are_gated_and_then_widen_the_advance() -> None:
    """A reading far off moves nothing; ones that go on are believed after five, and named as inflation."""
    flown = Navigator(example.janus, MODEL, ON.replace(gate="joint"), example.initial)
    verdicts: list[Any] = []
    for step in range(7):
        still(flown, step * 10_000_000)
        before = flown.state()["velocity_p_mps"]
        (report,) = flown.push_thrust(step * 10_000_000, 38.0, sd_mps=0.01)
        verdicts.append((report.verdict, report.inflation is not None))
        if report.verdict == "rejected":
            np.testing.assert_array_equal(flown.state()["velocity_p_mps"], before)
    assert verdicts[:5] == [("rejected", False)] * 4 + [("accepted", True)]
    assert flown.thrust()["advance_m"] < 0.08  # type: ignore[index]


@pytest.mark.parametrize(
    ("options", "turns", "words"),
    [
        (example.options, 15.0, 'options.thrust is 0, expected "velocity" or "all"'),
        (ON, 1500.0, "less than 1000 a second: are they per minute"),
        (ON, float("nan"), "revolutions_hz"),
    ],
)
def test_a_bad_push_is_refused_and_changes_nothing(options: Options, turns: float, words: str) -> None:
    flown = Navigator(example.janus, MODEL, options, example.initial)
    still(flown, 0)
    before = flown.save()
    with pytest.raises(KernelError, match=words):
        flown.push_thrust(0, turns, sd_mps=0.01)
    assert flown.save() == before
    assert (flown.thrust() is None) == (options.thrust == "off")


def test_the_option_needs_a_model() -> None:
    with pytest.raises(KernelError, match=r"thrust\.advance_m is 0, expected"):
        Navigator(example.janus, example.model, ON, example.initial)
    with pytest.raises(KernelError, match=r"options\.thrust is 'yes', expected 'off', 'velocity' or 'all'"):
        ON.replace(thrust="yes")


def test_a_log_gives_the_bits_of_the_navigator() -> None:
    rng, imu_ns = np.random.default_rng(3), np.arange(0, 4_000_000_000, 10_000_000)
    force = np.tile(GRAVITY, (len(imu_ns), 1)) + 0.01 * rng.normal(size=(len(imu_ns), 3))
    omega, thrust_ns = 0.01 * rng.normal(size=force.shape), imu_ns[25::50] + 3_000_000
    turns = 16.0 + rng.normal(size=len(thrust_ns))
    log: Any = {
        "imu_time_ns": imu_ns,
        "force_p_mps2": force,
        "omega_p_radps": omega,
        "dvl_time_ns": np.empty(0, dtype=np.int64),
        "beam_velocity_mps": np.empty((0, 4)),
        "beam_valid": np.empty((0, 4), dtype=bool),
        "thrust_time_ns": thrust_ns,
        "thrust_revolutions_hz": turns,
    }
    last, layered = imu_ns[-1:], ON.replace(current_layers=CurrentLayers())
    methods: tuple[Method, ...] = ("ins", "tc", "sway_current")
    for method in methods:
        beams = example.janus
        out: Any = replay_log(
            beams, MODEL, layered, [method], log, example.initial, sample_time_ns=last, innovations=True
        )
        (records,) = out["innovations"]
        np.testing.assert_array_equal(records["thrust"]["time_ns"], thrust_ns)
        flown = Navigator(beams, MODEL, layered, example.initial, method=method)
        waiting = list(range(len(thrust_ns)))
        for k, time_ns in enumerate(imu_ns.tolist()):
            while waiting and thrust_ns[waiting[0]] <= time_ns:
                row = waiting.pop(0)
                flown.push_thrust(thrust_ns[row], turns[row], sd_mps=PROPELLER.noise_sd_mps)
            flown.push_imu(time_ns, omega_p_radps=omega[k], force_p_mps2=force[k])
        assert out["velocity_p_mps"][0, 0].tolist() == list(flown.state()["velocity_p_mps"])
        loaded: Any = Navigator.load(flown.save())
        np.testing.assert_equal(loaded.thrust(), flown.thrust())
        np.testing.assert_equal(loaded.water(), flown.water())
