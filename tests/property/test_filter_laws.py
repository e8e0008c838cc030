"""One step of the product's filter against the textbook's dense filter with plain inverses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bottomlock
from bottomlock.kernel import Method
from tests.oracle import beams, error_model, kalman
from tests.oracle.mechanisation import earth_rate_tangent, integrate
from tests.oracle.rotations import Array, log_rotation, matrix_from_quaternion, quaternion_from_euler
from tests.property import settings
from tests.property import strategies as sea

if TYPE_CHECKING:
    from bottomlock._kernel import StateDict

# Typical sizes of the twenty errors: position, misalignment, velocity, biases, beam biases, scale factor.
SIZES = np.array([2.0] * 3 + [0.01] * 3 + [0.1] * 3 + [5e-3] * 3 + [1e-5] * 3 + [5e-3] * 4 + [7e-3])


@st.composite
def state_covariances(draw: st.DrawFn) -> Array:
    """A correlated 20 × 20 covariance of realistic size."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    root = rng.normal(size=(20, 20)) + 2 * np.eye(20)
    covariance: Array = root @ root.T / 20 * np.outer(SIZES, SIZES)
    return (covariance + covariance.T) / 2


def initial(velocity: Array, quaternion: Array) -> Any:  # noqa: ANN401 - a dict, as a state is
    """An estimate with every part different from zero."""
    return {
        "time_ns": 0,
        "position_t_m": np.array([1.0, 2.0, 3.0]),
        "attitude_t_p": quaternion,
        "velocity_p_mps": velocity,
        "accel_bias_p_mps2": np.array([0.01, -0.02, 0.005]),
        "gyro_bias_p_radps": np.array([1e-4, -2e-4, 3e-4]),
        "dvl_bias_mps": np.array([0.01, -0.01, 0.02, 0.005]),
        "dvl_scale_factor": 0.004,
    }


def error_of(true: StateDict, estimate: StateDict) -> Array:
    """True ⊟ estimate, as the 20-vector of Eq. 8: what an update feeds back from `estimate` to `true`."""
    turn = matrix_from_quaternion(true["attitude_t_p"]) @ matrix_from_quaternion(estimate["attitude_t_p"]).T
    return np.concatenate(
        [
            true["position_t_m"] - estimate["position_t_m"],
            log_rotation(turn),
            true["velocity_p_mps"] - estimate["velocity_p_mps"],
            true["accel_bias_p_mps2"] - estimate["accel_bias_p_mps2"],
            true["gyro_bias_p_radps"] - estimate["gyro_bias_p_radps"],
            true["dvl_bias_mps"] - estimate["dvl_bias_mps"],
            [true["dvl_scale_factor"] - estimate["dvl_scale_factor"]],
        ]
    )


def expected_readings(instrument: sea.Instrument, state: StateDict, rate: Array) -> Array:
    """Eq. 15 at an estimate, on an Earth that does not turn."""
    rate_tp = rate - state["gyro_bias_p_radps"]
    return np.array(
        [
            beams.beam_velocity(
                instrument.directions[i],
                state["velocity_p_mps"],
                rate_tp,
                instrument.levers[i],
                float(state["dvl_bias_mps"][i]),
                state["dvl_scale_factor"],
            )
            for i in range(instrument.beams)
        ]
    )


@pytest.mark.first_cases(1)
@given(
    instrument=sea.instruments(least=3, most=4),
    velocity=sea.velocities,
    angles=sea.angles,
    rate=sea.rates,
    noise=sea.numbers(-0.2, 0.2, 4),
    P=state_covariances(),
    data=st.data(),
)
@pytest.mark.parametrize("method", ["tc", "info", "vb", "lc"])
def test_beam_update_is_the_textbook_update(
    method: Method,
    instrument: sea.Instrument,
    velocity: Array,
    angles: tuple[float, float, float],
    rate: Array,
    noise: Array,
    P: Array,
    data: st.DataObject,
) -> None:
    """TC is Eq. 22 in a dense filter; information form, exact virtual beam and (for three beams) LC are the same.

    The instrument has lever arms, so every column of the corrected H counts. Earth rate and gyro noise are off: the
    first adds a misalignment block that Eq. 22 leaves out, the second the correlated noise of Eq. 20, tested below.
    """
    valid = data.draw(sea.masks(instrument.beams, 3 if method == "lc" else 1))
    if method in {"info", "vb", "lc"} and valid.sum() > 3:
        valid[-1] = False
    model = settings.table_2()
    model["environment"]["earth_rate_radps"] = 0.0
    model["imu"]["gyro_noise_rad_rts"] = 1e-15
    navigator = bottomlock.Navigator(
        instrument.geometry,
        model,
        settings.options(exact=True),
        initial(velocity, quaternion_from_euler(*angles)),
        method=method,
        covariance=P,
    )
    force = np.array([0.1, 0.2, -9.8])
    navigator.push_imu(0, omega_p_radps=rate, force_p_mps2=force)
    navigator.push_imu(6_666_667, omega_p_radps=rate, force_p_mps2=force)
    before, P = navigator.state(), navigator.covariance()
    expected = expected_readings(instrument, before, rate)
    y = expected + noise[: instrument.beams]
    reports = navigator.push_beams(6_666_667, y, valid, sd_mps=instrument.sd)
    assert [report.verdict for report in reports] == ["accepted"]

    scale = before["dvl_scale_factor"]
    H = beams.h_tight(instrument.directions, before["velocity_p_mps"], instrument.levers, scale)[valid]
    R = np.diag(instrument.sd[valid] ** 2)
    residual = (y - expected)[valid]
    x, P_new = kalman.update(np.zeros(20), P, H, R, residual)
    # In units of each state's own uncertainty.
    sd = np.sqrt(np.diag(P))
    np.testing.assert_allclose(error_of(navigator.state(), before) / sd, x / sd, atol=1e-7)
    got = navigator.covariance()
    np.testing.assert_allclose(got / np.outer(sd, sd), P_new / np.outer(sd, sd), atol=1e-8)
    assert reports[0].nis == pytest.approx(kalman.nis(H, P, R, residual), rel=1e-7, abs=1e-9)


def test_ping_at_the_first_sample_uses_its_rate() -> None:
    """A ping at the time of the very first IMU sample has that sample's rate for its lever arms, as any later one."""
    model = settings.table_2()
    model["environment"]["earth_rate_radps"] = 0.0
    levers = np.tile([1.0, 0.0, 0.0], (4, 1))
    instrument = sea.Instrument(beams.x_janus(), levers, np.full(4, 0.042))
    start = initial(np.array([2.0, 0, 0]), np.array([1.0, 0, 0, 0]))
    navigator = bottomlock.Navigator(instrument.geometry, model, settings.options(), start, method="tc")
    rate = np.array([0.0, 0.0, 0.5])
    navigator.push_imu(0, omega_p_radps=rate, force_p_mps2=np.array([0.0, 0.0, -9.8]))
    y = expected_readings(instrument, navigator.state(), rate)
    report = navigator.push_beams(0, y, np.ones(4, bool), sd_mps=instrument.sd)[0]
    np.testing.assert_allclose(report.residual, 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("period_ns", "latitude_rad"), [(0, settings.LATITUDE_RAD), (100_000_000, -np.pi / 4)]
)
def test_prediction_is_van_loan_along_the_motion(period_ns: int, latitude_rad: float) -> None:
    """One second at 150 Hz: state against the differential equation, covariance against steps of Van Loan's Φ and Qd.

    Second order at 10 Hz stays within 1e-4 of the uncertainty. First order at 150 Hz drops F²dt²/2 in each of 150
    steps, which is 1/150 of every second-order term after one second; those carry correlations up to 0.05 here,
    so 3.3e-4.
    """
    tolerance = 1e-4 if period_ns else 3.3e-4
    rate, force = np.array([0.02, -0.03, 0.1]), np.array([0.3, 0.2, -9.7])
    velocity, quaternion = np.array([2.0, 0.1, -0.1]), quaternion_from_euler(0.1, 0.2, 0.5)
    model = settings.table_2()
    model["environment"]["latitude_rad"] = latitude_rad
    before = initial(velocity, quaternion)
    P = np.diag(SIZES**2)
    P[3, 7] = P[7, 3] = 0.5 * SIZES[3] * SIZES[7]
    navigator = bottomlock.Navigator(
        bottomlock.BeamGeometry.janus(0.35),
        model,
        settings.options(covariance_period_ns=period_ns),
        before,
        method="tc",
        covariance=P,
    )
    time_ns = np.round(np.arange(151) * 1e9 / 150).astype(np.int64)
    navigator.push_imu_block(
        time_ns, omega_p_radps=np.tile(rate, (151, 1)), force_p_mps2=np.tile(force, (151, 1))
    )

    true_rate = rate - np.asarray(before["gyro_bias_p_radps"])
    true_force = force - np.asarray(before["accel_bias_p_mps2"])
    earth = earth_rate_tangent(latitude_rad)
    motion = integrate(
        (np.asarray(before["position_t_m"]), quaternion, velocity),
        lambda _: true_rate,
        lambda _: true_force,
        settings.GRAVITY,
        earth,
        time_ns * 1e-9,
    )
    state = navigator.state()
    np.testing.assert_allclose(state["position_t_m"], motion.position[-1], atol=2e-6)
    np.testing.assert_allclose(state["velocity_p_mps"], motion.velocity[-1], atol=2e-6)
    turn = matrix_from_quaternion(state["attitude_t_p"]) @ matrix_from_quaternion(motion.quaternion[-1]).T
    assert np.linalg.norm(log_rotation(turn)) < 1e-8

    Q = error_model.noise_density(*settings.noise_densities(model))
    gravity = np.array([0.0, 0.0, settings.GRAVITY])
    for k in range(150):
        middle = (motion.quaternion[k] + motion.quaternion[k + 1]) / 2
        v = (motion.velocity[k] + motion.velocity[k + 1]) / 2
        rotation = matrix_from_quaternion(middle)
        F = error_model.f_full(rotation, v, true_rate, gravity, earth)
        G = error_model.g_full(rotation, v)
        P = kalman.predict(P, *kalman.van_loan(F, G @ Q @ G.T, 1 / 150))
    sd = np.sqrt(np.diag(P))
    np.testing.assert_allclose(
        navigator.covariance() / np.outer(sd, sd), P / np.outer(sd, sd), atol=tolerance
    )


def test_gyro_noise_reaches_the_beams_through_lever_arms() -> None:
    """Eq. 20: with lever arms the innovation covariance holds the noise of the gyro that all beams share."""
    rng = np.random.default_rng(20)
    directions, levers, sd = beams.x_janus(), rng.normal(size=(4, 3)), np.full(4, 0.01)
    model = settings.table_2()
    model["environment"]["earth_rate_radps"] = 0.0
    P = np.diag(SIZES**2)
    start = initial(np.array([2.0, 0, 0]), np.array([1.0, 0, 0, 0]))
    shares: list[Array] = []
    for gyro_noise in (1e-15, 1e-3):
        model["imu"]["gyro_noise_rad_rts"] = gyro_noise
        geometry = bottomlock.BeamGeometry(directions, lever_arms_p_m=levers)
        navigator = bottomlock.Navigator(
            geometry, model, settings.options(), start, method="tc", covariance=P
        )
        time_ns = np.round(np.arange(3) * 1e9 / 150).astype(np.int64)
        navigator.push_imu_block(
            time_ns, omega_p_radps=np.zeros((3, 3)), force_p_mps2=np.tile([0, 0, -9.8], (3, 1))
        )
        before = navigator.covariance()
        H = beams.h_tight(directions, navigator.state()["velocity_p_mps"], levers, 0.004)
        report = navigator.push_beams(int(time_ns[-1]), np.zeros(4), np.ones(4, bool), sd_mps=sd)[0]
        shares.append(report.covariance - H @ before @ H.T)
    np.testing.assert_allclose(shares[0], np.diag(sd**2), atol=1e-10)
    # One reading of a gyro of density n at 150 Hz has the variance n² · 150.
    full = beams.beam_noise(directions, levers, 1e-3 * np.sqrt(150), sd)
    np.testing.assert_allclose(shares[1], full, rtol=1e-3, atol=1e-9)
