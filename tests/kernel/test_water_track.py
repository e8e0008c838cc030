"""Water track through the navigator and a replayed log: by hand, by the literal equation, refused where it is off."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bottomlock.errors import KernelError
from bottomlock.kernel import Method, Navigator, replay_log
from bottomlock.kernel.models import CurrentLayers
from tests.kernel import documented_navigator as example
from tests.oracle.rotations import matrix_from_euler, quaternion_from_euler

RPY_RAD = (0.2, -0.4, 1.1)
ONE_CURRENT = CurrentLayers(sd_mps=0.0)
ON = example.options.replace(water_track=True, gate="off", current_layers=ONE_CURRENT)
LAYERED = ON.replace(current_layers=CurrentLayers())
STILL_EARTH = example.model.replace(environment=example.model.environment.replace(earth_rate_radps=0.0))


def navigator(options: Any = ON, **changes: Any) -> Navigator:  # noqa: ANN401 - of the initial state
    """At a turned attitude, before any reading."""
    turned = example.initial.replace(attitude_t_p=quaternion_from_euler(*RPY_RAD), **changes)
    return Navigator(example.janus, example.model, options, turned)


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


def test_layers_are_told_with_their_age() -> None:
    """At 13 m the layers at 10 and 20 m are measured, the others never: their current has their own part's sigma."""
    flown = navigator(LAYERED, position_t_m=(0.0, 0.0, 13.0))
    every, sd = np.ones(4, dtype=bool), np.full(4, 0.02)
    for step in range(201):
        flown.push_imu(
            step * 10_000_000, omega_p_radps=np.zeros(3), force_p_mps2=[0.0, 0.0, -example.gravity]
        )
        if step == 100:
            flown.push_water_track(step * 10_000_000, np.zeros(4), every, sd_mps=sd)
    water: Any = flown.water()
    layers = water["layers"]
    np.testing.assert_array_equal(layers["depth_m"], [0.0, 10.0, 20.0, 30.0])
    np.testing.assert_allclose(layers["age_s"][1:3], 1.0, atol=0.101)
    assert np.isinf(layers["age_s"][[0, 3]]).all()
    below = flown.state()["position_t_m"][2] / 10.0 - 1.0
    mean = (1.0 - below) * layers["current_t_mps"][1] + below * layers["current_t_mps"][2]
    np.testing.assert_allclose(water["current_t_mps"], mean, atol=1e-12)
    sds = np.sqrt(layers["current_covariance"][:, [0, 1], [0, 1]])
    assert (sds[[0, 3]] > sds[1]).all()
    np.testing.assert_equal(Navigator.load(flown.save()).water(), water)
    assert navigator(ON).water()["layers"]["depth_m"].shape == (0,)  # type: ignore[index]


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


def test_the_current_is_learned_while_both_return_and_kept_afterwards() -> None:
    """The bottom says 2 m/s ahead, the water 1.6: the current is 0.4 m/s along the course, to what the sensors tell."""
    flown = Navigator(example.janus, STILL_EARTH, ON, example.initial)
    every, sd = np.ones(4, dtype=bool), np.full(4, 0.02)
    ahead = example.janus.beam_velocities([[2.0, 0.0, 0.0], [1.6, 0.0, 0.0]])
    for step in range(3001):
        time_ns = step * 10_000_000
        flown.push_imu(time_ns, omega_p_radps=np.zeros(3), force_p_mps2=[0.0, 0.0, -example.gravity])
        if step % 50 == 25 and step < 1000:
            flown.push_beams(time_ns, ahead[0], every, sd_mps=sd)
        if step % 50 == 0:
            flown.push_water_track(time_ns, ahead[1], every, sd_mps=sd)
    water: Any = flown.water()
    np.testing.assert_allclose(water["current_t_mps"], [0.4, 0.0], atol=0.02)
    assert np.sqrt(np.diag(water["current_covariance"])).max() < 0.1
    np.testing.assert_allclose(flown.state()["velocity_p_mps"], [2.0, 0.0, 0.0], atol=0.02)


def test_is_refused_where_it_is_off() -> None:
    flown = navigator(example.options)
    with pytest.raises(KernelError, match="water_track is 0, expected true"):
        flown.push_water_track(0, np.zeros(4), np.ones(4, dtype=bool), sd_mps=np.full(4, 0.05))
    assert flown.water() is None


def test_a_log_gives_the_bits_of_the_navigator() -> None:
    rng, imu_ns = np.random.default_rng(3), np.arange(0, 4_000_000_000, 10_000_000)
    force = np.tile([0.0, 0.0, -example.gravity], (len(imu_ns), 1)) + 0.01 * rng.normal(size=(len(imu_ns), 3))
    omega, water_ns = 0.01 * rng.normal(size=force.shape), imu_ns[25::50] + 3_000_000
    water = rng.normal(size=(len(water_ns), 4))
    valid = rng.random(water.shape) < 0.8
    log: Any = {
        "imu_time_ns": imu_ns,
        "force_p_mps2": force,
        "omega_p_radps": omega,
        "dvl_time_ns": np.empty(0, dtype=np.int64),
        "beam_velocity_mps": np.empty((0, 4)),
        "beam_valid": np.empty((0, 4), dtype=bool),
        "water_track_time_ns": water_ns,
        "water_track_velocity_mps": water,
        "water_track_valid": valid,
    }
    last = imu_ns[-1:]
    log["water_track_range_m"] = range_m = rng.uniform(0.0, 40.0, len(water_ns))
    methods: tuple[Method, ...] = ("tc", "sway_current")
    for method in methods:
        beams, model = example.janus, example.model
        out: Any = replay_log(
            beams, model, LAYERED, [method], log, example.initial, sample_time_ns=last, innovations=True
        )
        (records,) = out["innovations"]
        taken = valid.any(axis=1)
        np.testing.assert_array_equal(records["water_track"]["time_ns"], water_ns[taken])
        flown = Navigator(beams, model, LAYERED, example.initial, method=method)
        waiting = list(range(len(water_ns)))
        assert model.dvl is not None
        sd = np.full(4, model.dvl.beam_noise_sd_mps)
        for k, time_ns in enumerate(imu_ns.tolist()):
            while waiting and water_ns[waiting[0]] <= time_ns:
                row = waiting.pop(0)
                flown.push_water_track(water_ns[row], water[row], valid[row], sd_mps=sd, range_m=range_m[row])
            flown.push_imu(time_ns, omega_p_radps=omega[k], force_p_mps2=force[k])
        assert out["velocity_p_mps"][0, 0].tolist() == list(flown.state()["velocity_p_mps"])
        estimated: Any = flown.water()
        for name in ("current_t_mps", "current_covariance"):
            np.testing.assert_array_equal(out[name][0, 0], estimated[name])
        loaded: Any = Navigator.load(flown.save())
        np.testing.assert_equal(loaded.water(), flown.water())
