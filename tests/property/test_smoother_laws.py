"""The smoother against the whole history at once, and its laws on logs that nobody tidied."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

import bottomlock
from bottomlock.kernel import Method
from tests.oracle import beams, error_model, smoothing
from tests.oracle.rotations import Array, log_rotation, matrix_from_quaternion, quaternion_from_euler
from tests.property import settings

if TYPE_CHECKING:
    from bottomlock._kernel import LogDict, ReplayDict, StateDict

RATE_HZ = 20
STEP_NS = 1_000_000_000 // RATE_HZ
A = beams.x_janus()
BEAM_SD = 0.03
NONE: Any = np.empty(0, dtype=np.int64)


def still_earth() -> Any:  # noqa: ANN401 - a dict, which a test may change
    model = settings.table_2()
    model["environment"]["earth_rate_radps"] = 0.0
    # A depth that is known well at once would cost the dense oracle seven of its digits.
    model["initial"]["position_sd_m"] = [0.05, 0.05, 0.05]
    return model


def make_log(rng: np.random.Generator, steps: int, every: int) -> tuple[LogDict, Any]:
    """A vehicle that speeds up without turning; beams come and go, depths in between."""
    time_ns = np.arange(steps + 1, dtype=np.int64) * STEP_NS
    force = np.array([0.2, 0.1, -settings.GRAVITY]) + 0.02 * rng.normal(size=(steps + 1, 3))
    pings = time_ns[every::every]
    log: LogDict = {
        "imu_time_ns": time_ns,
        "force_p_mps2": force,
        "omega_p_radps": np.zeros((steps + 1, 3)),
        "dvl_time_ns": pings,
        "beam_velocity_mps": (A @ [2.0, 0.1, -0.1]) + 0.05 * rng.normal(size=(len(pings), 4)),
        "beam_valid": rng.random((len(pings), 4)) < 0.6,
        "beam_sd_mps": np.full((len(pings), 4), BEAM_SD),
        "depth_time_ns": time_ns[every // 2 :: every],
        "depth_m": 3.0 + 0.05 * rng.normal(size=len(time_ns[every // 2 :: every])),
        "heading_time_ns": NONE,
        "heading_rad": np.empty(0),
        "attitude_time_ns": NONE,
        "attitude_t_p": np.empty((0, 4)),
        "gps_time_ns": NONE,
        "gps_position_t_m": np.empty((0, 3)),
    }
    start = {
        "time_ns": 0,
        "position_t_m": [1.0, 2.0, 3.0],
        "attitude_t_p": quaternion_from_euler(0.05, -0.1, 0.7),
        "velocity_p_mps": [2.0, 0.1, -0.1],
    }
    return log, start


def replayed(log: LogDict, start: Any, methods: list[Method], **more: Any) -> ReplayDict:  # noqa: ANN401
    """Filter and smoother of every sample, gate off."""
    return bottomlock.replay_log(
        bottomlock.BeamGeometry(A),
        still_earth(),
        settings.options(exact=True, covariance_period_ns=more.pop("covariance_period_ns", 0)),
        methods,
        log,
        start,
        sample_time_ns=more.pop("sample_time_ns", log["imu_time_ns"]),
        smooth=True,
        covariances=True,
        **more,
    )


def difference(true: Any, estimate: Any) -> Array:  # noqa: ANN401 - states of either kind
    """The twenty errors of an estimate, Eq. 8."""
    turn = matrix_from_quaternion(true[1]) @ matrix_from_quaternion(estimate[1]).T
    parts = [true[k] - estimate[k] for k in (2, 3, 4, 5, 6)]
    return np.concatenate([true[0] - estimate[0], log_rotation(turn), *parts])


def parts_of(state: StateDict) -> tuple[Any, ...]:
    return (
        state["position_t_m"],
        state["attitude_t_p"],
        state["velocity_p_mps"],
        state["accel_bias_p_mps2"],
        state["gyro_bias_p_radps"],
        state["dvl_bias_mps"],
        np.atleast_1d(state["dvl_scale_factor"]),
    )


def sample_of(out: ReplayDict, k: int, prefix: str) -> tuple[Any, ...]:
    keys = (
        "position_t_m attitude_t_p velocity_p_mps accel_bias_p_mps2 gyro_bias_p_radps dvl_bias_mps dvl_scale"
    )
    return tuple(np.atleast_1d(out[prefix + key][0, k]) for key in keys.split())  # type: ignore[literal-required]


def flow(state: StateDict) -> tuple[Array, Array]:
    """F of Eq. 9 at a state of a vehicle whose gyros read zero, and the velocity that G of Eq. 10 wants."""
    rotation, velocity = matrix_from_quaternion(state["attitude_t_p"]), np.asarray(state["velocity_p_mps"])
    rate = -np.asarray(state["gyro_bias_p_radps"])
    gravity = np.array([0.0, 0.0, settings.GRAVITY])
    return error_model.f_full(rotation, velocity, rate, gravity, np.zeros(3)), velocity


def history(log: Any, start: Any) -> tuple[Array, list[smoothing.Epoch]]:  # noqa: ANN401
    """The epochs of a log as the oracle wants them, about the states of a streaming navigator."""
    model = still_earth()
    nav = bottomlock.Navigator(
        bottomlock.BeamGeometry(A), model, settings.options(covariance_period_ns=0), start, method="tc"
    )
    W = error_model.noise_density(*settings.noise_densities(model))
    P0, epochs, dt = nav.covariance(), [], STEP_NS * 1e-9
    pings, depths = list(log["dvl_time_ns"]), list(log["depth_time_ns"])
    for k, time_ns in enumerate(log["imu_time_ns"]):
        before = nav.state()
        nav.push_imu(int(time_ns), omega_p_radps=log["omega_p_radps"][k], force_p_mps2=log["force_p_mps2"][k])
        state = nav.state()
        Phi, Q = np.eye(20), np.zeros((20, 20))
        if k > 0:
            (F0, v0), (F1, v1) = flow(before), flow(state)
            Phi = np.eye(20) + (F0 + F1) / 2 * dt
            G = error_model.g_full(matrix_from_quaternion(state["attitude_t_p"]), (v0 + v1) / 2)
            half = G @ W @ G.T * dt / 2
            Q = Phi @ half @ Phi.T + half
        rows, z, variance = np.empty((0, 20)), np.empty(0), np.empty(0)
        if time_ns in pings:
            e = pings.index(time_ns)
            valid = log["beam_valid"][e]
            velocity, scale = np.asarray(state["velocity_p_mps"]), state["dvl_scale_factor"]
            rows = beams.h_tight(A, velocity, np.zeros((4, 3)), scale)[valid]
            expected = [
                beams.beam_velocity(A[i], velocity, np.zeros(3), np.zeros(3), state["dvl_bias_mps"][i], scale)
                for i in range(4)
            ]
            z = (log["beam_velocity_mps"][e] - expected)[valid]
            variance = np.full(len(z), BEAM_SD**2)
            y, sd = log["beam_velocity_mps"][e], log["beam_sd_mps"][e]
            nav.push_beams(int(time_ns), y, valid, sd_mps=sd)
        elif time_ns in depths:
            e = depths.index(time_ns)
            rows = np.eye(20)[[2]]
            z = np.array([log["depth_m"][e] - state["position_t_m"][2]])
            variance = np.array([model["depth"]["sd_m"] ** 2])
            nav.push_depth(int(time_ns), float(log["depth_m"][e]), sd_m=model["depth"]["sd_m"])
        fed_back = difference(parts_of(nav.state()), parts_of(state))
        epochs.append(smoothing.Epoch(Phi, Q, rows, np.diag(variance), z, fed_back))
    return P0, epochs


def test_smoother_is_the_conditioned_history() -> None:
    """Every sample of TC with beams and depths: mean and covariance of the joint history given all readings, to 1e-9.

    In units of each state's own filtered uncertainty. The oracle knows no adjoint, no gain and no recursion backward.
    """
    log, start = make_log(np.random.default_rng(8), steps=40, every=4)
    P0, epochs = history(log, start)
    mean, covariance = smoothing.smooth(P0, epochs)
    out = replayed(log, start, ["tc"])
    for k in range(len(log["imu_time_ns"])):
        filtered, smoothed = sample_of(out, k, ""), sample_of(out, k, "smoothed_")
        sd = np.sqrt(np.diag(out["covariance"][0, k]))
        np.testing.assert_allclose(difference(smoothed, filtered) / sd, mean[k + 1] / sd, atol=1e-9)
        got = out["smoothed_covariance"][0, k] / np.outer(sd, sd)
        np.testing.assert_allclose(got, covariance[k + 1] / np.outer(sd, sd), atol=1e-9)
