"""Every message read back by a decoder that is not ours: what stands in it, and when nothing is sent."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bottomlock.config.scenario import load_scenario
from bottomlock.errors import ScenarioError
from bottomlock.kernel import BeamGeometry, Navigator, normal_gravity_mps2, solve_velocity
from bottomlock.kernel.models import InitialState
from bottomlock.ports.estimate import Estimate
from bottomlock.ports.registry import PORTS, port
from tests.ports.cases import JANUS, MASKS, SECOND, START, TRUTH, from_beams, mavlink, mip, navigated, ping

GEOMETRY = {"distance_sensor", "ros_dvl", "waterlinked_json", "pd0"}
MAVLINK = {"vision_position_delta", "vision_speed_estimate", "odometry"}
ALL = sorted(PORTS)
FULL, OPPOSITE, SIDE = MASKS["4 beams"], MASKS["2 opposite"], MASKS["2 neighbours"]


def made(name: str, **settings: Any) -> Any:  # noqa: ANN401
    given: dict[str, Any] = {"geometry": JANUS} if name in GEOMETRY else {}
    if name in MAVLINK:
        given |= {"variance_factor": 1.0, "max_rate_hz": 5.0}
    if name == "pd0":
        given["receiver_sd_mps"] = 0.5
    return port(name, **(given | settings))


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("state", ["UNSAFE", "INITIALISING"])
def test_every_port_is_silent_when_it_is_unsafe(name: str, state: Any) -> None:  # noqa: ANN401
    one = made(name)
    for estimate in (from_beams(FULL, START, state=state), navigated(START + SECOND, state=state)):
        assert one.sends(estimate) == f"state is {state}"
        assert one.encode(estimate) is None


@pytest.mark.parametrize("name", ALL)
def test_without_a_beam_nothing_is_sent_in_mode_velocity(name: str) -> None:
    one = made(name)
    for k in range(3):
        estimate = from_beams((0, 0, 0, 0), START + k * SECOND // 5)
        if name == "ros_dvl":
            # The message holds the beams; that all are lost is what it says.
            assert one.encode(estimate) is not None
        else:
            assert one.sends(estimate)
            assert one.encode(estimate) is None


@pytest.mark.parametrize("name", ALL)
def test_sends_and_encode_agree(name: str) -> None:
    """Over masks, modes and times: bytes exactly where there is no reason against them."""
    one = made(name)
    time_ns = START
    for k in range(40):
        time_ns += (37 + 61 * (k % 4)) * 1_000_000
        masks = list(MASKS.values())
        estimate = navigated(time_ns, rank=k % 4) if k % 3 else from_beams(masks[k % 5], time_ns)
        reason = one.sends(estimate)
        assert (one.encode(estimate) is None) == (reason is not None)


def test_vision_position_delta_of_pings() -> None:
    """One message a ping: velocity times interval, and the confidence that gives the autopilot its σ back."""
    one = made("vision_position_delta", min_noise_mps=0.01, max_noise_mps=0.9)
    assert (
        one.sends(from_beams(FULL))
        == "no interval yet: the first estimate, or the first after a gap or a reset"
    )
    assert one.encode(from_beams(FULL)) is None
    estimate = from_beams(FULL, START + SECOND // 5)
    message = mavlink(one.encode(estimate))
    assert (message.get_type(), message.time_usec, message.time_delta_usec) == (
        "VISION_POSITION_DELTA",
        (START + SECOND // 5) // 1000,
        200_000,
    )
    np.testing.assert_allclose(message.position_delta, TRUTH * 0.2, rtol=1e-6)
    assert list(message.angle_delta) == [0.0, 0.0, 0.0]
    sd = 0.01 + 0.89 * (1.0 - message.confidence / 100.0)
    largest = float(np.sqrt(np.linalg.eigvalsh(estimate.covariance_m2ps2)[-1]))
    assert largest <= sd < largest + 2e-6
    assert (message.get_srcSystem(), message.get_srcComponent()) == (1, 197)


def test_the_distance_to_the_bottom() -> None:
    """The mean of the ranges along z in cm, downwards, once a ping; beyond its limits and without a range nothing."""
    one = made("distance_sensor")
    message = mavlink(one.encode(from_beams(SIDE)))
    # 30 m along beams of 20 deg, whichever of them return.
    assert message.current_distance == round(3000.0 * np.cos(np.deg2rad(20.0)))
    assert (message.get_type(), message.orientation, message.type) == ("DISTANCE_SENSOR", 25, 1)
    assert (message.min_distance, message.max_distance, message.covariance) == (5, 5000, 255)
    assert message.time_boot_ms == START // 1_000_000 % 2**32
    beams = ping(FULL)
    first, again = (navigated(START + k * SECOND, beams=beams) for k in (1, 2))
    assert one.encode(first) is not None
    assert one.encode(again) is None
    assert one.waits
    assert one.reason == "the distance of this ping was sent"
    assert one.sends(navigated(START + 3 * SECOND)) == "there is no ping of the geometry's beams"
    assert one.sends(from_beams((0, 0, 0, 0), START + 3 * SECOND)) == "no beam of the ping has a range"
    near = made("distance_sensor", max_distance_m=20.0)
    assert near.sends(from_beams(FULL)) == "the distance is 28.19 m, outside of 0.05 to 20"
    with pytest.raises(
        ScenarioError, match=r"max_distance_m is 700\.0, expected more than min_distance_m, .* at most 655"
    ):
        made("distance_sensor", max_distance_m=700.0)
    ahead = BeamGeometry(JANUS.directions_p, mounting_rpy_rad=[0.0, np.pi / 2, 0.0])
    with pytest.raises(ScenarioError, match="more than 60 degrees away from down"):
        made("distance_sensor", geometry=ahead)


def test_vision_position_delta_integrates_a_turn() -> None:
    """At 100 Hz on a circle: the delta is the integral of the body velocity, the angle is that of the turn."""
    one = made("vision_position_delta", max_rate_hz=5.0)
    sent = []
    for k in range(101):
        yaw = 0.4 * k / 100
        velocity = np.array([1.0 + 0.5 * k / 100, 0.1, 0.0])
        attitude = [np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]
        data = one.encode(
            navigated(START + k * SECOND // 100, velocity_p_mps=velocity, attitude_t_p=attitude)
        )
        if data is not None:
            sent.append(mavlink(data))
    assert [message.time_delta_usec for message in sent][1:] == [200_000] * (len(sent) - 1)
    whole = np.sum([message.position_delta for message in sent], axis=0)
    duration = sum(message.time_delta_usec for message in sent) / 1e6
    np.testing.assert_allclose(whole, [duration + 0.25 * duration**2, 0.1 * duration, 0.0], atol=1e-5)
    turned = np.sum([message.angle_delta for message in sent], axis=0)
    np.testing.assert_allclose(turned, [0.0, 0.0, 0.4 * duration], atol=1e-6)


def test_the_largest_variance_of_an_interval_counts() -> None:
    one = made("vision_position_delta", min_noise_mps=0.01, max_rate_hz=2.0)
    small, large = 0.02**2, 0.5**2
    confidences = []
    for k, variance in enumerate([small, small, large, small, small, small, small, small, small]):
        data = one.encode(navigated(START + k * SECOND // 5, covariance_m2ps2=np.eye(3) * variance))
        if data is not None:
            confidences.append(mavlink(data).confidence)
    sd = [0.01 + 0.89 * (1.0 - confidence / 100.0) for confidence in confidences]
    assert sd == pytest.approx([0.02, 0.5, 0.02], abs=1e-5)


def test_confidence_zero_is_never_sent() -> None:
    """ArduPilot would fuse it with σ = max, which is too small: nothing is sent instead, and nothing is added up."""
    one = made("vision_position_delta", max_noise_mps=0.3)
    for k, sd in enumerate([0.1, 0.1, 0.31, 0.1, 0.1]):
        estimate = navigated(START + k * SECOND // 4, covariance_m2ps2=np.eye(3) * sd**2)
        reason = one.sends(estimate)
        assert (one.encode(estimate) is not None) == (k in (1, 4)), k
        if k == 2:
            assert reason == (
                "σ is 0.310 m/s, above max_noise_mps, 0.3: the autopilot would use that smaller one"
            )


def test_a_reset_starts_a_new_interval() -> None:
    one = made("vision_position_delta")
    one.encode(navigated(START))
    assert one.encode(navigated(START + SECOND // 4, reset_counter=8)) is None
    assert one.encode(navigated(START + SECOND // 2, reset_counter=8)) is not None


def test_the_rate_towards_an_autopilot_is_limited_in_mode_navigation_only() -> None:
    one = made("odometry")
    sent = [one.encode(navigated(START + k * SECOND // 50)) is not None for k in range(50)]
    assert sum(sent) == 5
    assert one.sends(navigated(START + SECOND - 1)) == "at most one message in 0.200 s"
    one = made("odometry")
    assert all(one.encode(from_beams(FULL, START + k * SECOND // 15)) for k in range(15))


def test_vision_speed_estimate() -> None:
    """North-east-down: yaw 0.6 rad; σ² I not below the whole covariance, the misalignment's part included."""
    one = made("vision_speed_estimate")
    estimate = navigated()
    message = mavlink(one.encode(estimate))
    c, s = np.cos(0.6), np.sin(0.6)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    velocity = turn @ TRUTH
    np.testing.assert_allclose([message.x, message.y, message.z], velocity, rtol=1e-6)
    assert (message.usec, message.reset_counter) == (START // 1000, 7)
    sent = np.array(message.covariance).reshape(3, 3)
    assert np.array_equal(sent, np.eye(3) * sent[0, 0])
    rng = np.random.default_rng(2)
    joint = estimate.navigation_covariance
    assert joint is not None
    draws = rng.multivariate_normal(np.zeros(9), joint, 4000)
    # R_true = Exp([ρ x]) R to first order, drawn rather than derived.
    errors = np.cross(draws[:, 3:6], velocity) + draws[:, 6:] @ turn.T
    largest = np.linalg.eigvalsh(np.cov(errors.T))[-1]
    assert largest * 0.9 < sent[0, 0] < largest * 1.1
    assert one.sends(from_beams(FULL)) is not None
    limited = made("vision_speed_estimate", receiver_noise_mps=0.01)
    assert "above receiver_noise_mps, 0.01" in limited.sends(estimate)


def test_odometry_for_px4() -> None:
    """Body axes with three variances; no pose, no attitude: NaN, which PX4 does not use."""
    estimate = navigated(rank=2)
    message = mavlink(made("odometry").encode(estimate))
    assert (message.frame_id, message.child_frame_id) == (1, 12)
    np.testing.assert_allclose([message.vx, message.vy, message.vz], TRUTH, rtol=1e-6)
    assert np.isnan([message.x, message.y, message.z, *message.q, message.pose_covariance[0]]).all()
    variances = np.array([message.velocity_covariance[k] for k in (0, 6, 11)])
    assert np.isfinite(variances).all()
    assert np.linalg.eigvalsh(np.diag(variances) - estimate.covariance_m2ps2)[0] >= 0.0
    others = [v for k, v in enumerate(message.velocity_covariance) if k not in (0, 6, 11, 15, 18, 20)]
    assert others == [0.0] * 15
    assert (message.reset_counter, message.quality, message.estimator_type) == (7, 67, 3)


def test_odometry_for_ardupilot() -> None:
    """Pose and attitude are there, local axes are FRD; a larger σ than the autopilot's own is not sent."""
    one = made("odometry", receiver="ardupilot", receiver_noise_mps=0.5)
    message = mavlink(one.encode(navigated()))
    assert (message.frame_id, message.child_frame_id, message.quality) == (20, 12, 100)
    np.testing.assert_allclose([message.x, message.y, message.z], [10.0, -20.0, 5.0])
    np.testing.assert_allclose(message.q, [np.cos(0.3), 0.0, 0.0, np.sin(0.3)], rtol=1e-6)
    pose = np.array([message.pose_covariance[k] for k in (0, 6, 11, 15, 18, 20)])
    joint = navigated().navigation_covariance
    assert joint is not None
    assert np.linalg.eigvalsh(np.diag(pose) - joint[:6, :6])[0] >= 0.0
    assert one.sends(navigated(START + SECOND, covariance_m2ps2=np.eye(3) * 0.36)).startswith("σ is 0.600")
    assert (
        one.sends(from_beams(FULL, START + SECOND)) == "mode velocity has no pose, which this receiver takes"
    )


def test_the_variance_factor_counts_in_mode_navigation_only() -> None:
    plain, wide = made("odometry"), made("odometry", variance_factor=4.0)
    ratio = np.array(mavlink(wide.encode(navigated())).velocity_covariance[0]) / np.array(
        mavlink(plain.encode(navigated())).velocity_covariance[0]
    )
    assert ratio == pytest.approx(4.0, rel=1e-6)
    later = from_beams(FULL, START + SECOND)
    assert wide.encode(later) == plain.encode(later)


@pytest.mark.parametrize(
    ("mask", "flags"), [(FULL, 7), (MASKS["3 beams"], 7), (OPPOSITE, 4), (SIDE, 1), ((1, 0, 0, 1), 2)]
)
def test_mip_axes_in_mode_velocity(mask: tuple[int, ...], flags: int) -> None:
    """X = 1, Y = 2, Z = 4: what lies along a platform axis is sent, nothing else."""
    estimate = from_beams(mask)
    found = mip(made("microstrain").encode(estimate))
    assert (found["flags"], found["frame"], found["timebase"], found["ns"]) == (flags, 1, 2, START)
    there = [bool(flags >> k & 1) for k in range(3)]
    np.testing.assert_allclose(found["velocity"], np.where(there, TRUTH, 0.0), rtol=1e-6)
    sent = np.diag(found["sd"][there] ** 2)
    assert np.linalg.eigvalsh(sent - estimate.covariance_m2ps2[np.ix_(there, there)])[0] >= -1e-18
    assert list(found["sd"][np.logical_not(there)]) == [0.0] * (3 - sum(there))


def test_mip_in_mode_navigation_omits_or_estimates_unseen_axes() -> None:
    seen = from_beams(SIDE)
    estimate = navigated(rank=2, information_s2pm2=seen.information_s2pm2)
    assert mip(made("microstrain").encode(estimate))["flags"] == 1
    assert mip(made("microstrain", unseen="estimate").encode(estimate))["flags"] == 7


def test_every_port_takes_what_a_navigator_gives() -> None:
    """20 s with all beams, 20 s with two, 60 s with none: covariances of a real filter, at every stage of an outage."""
    scenario, gravity = load_scenario("straight"), normal_gravity_mps2(0.57)
    still = InitialState(
        time_ns=START, position_t_m=[0, 0, 0], attitude_t_p=[1, 0, 0, 0], velocity_p_mps=[0, 0, 0]
    )
    model, options = scenario.kernel_model(gravity), scenario.kernel_options()
    navigator = Navigator(JANUS, model, options, still, method="tc")
    ports = {name: made(name) for name in ALL}
    sent = dict.fromkeys(ALL, 0)
    masks = [FULL] * 20 + [SIDE] * 20 + [(0, 0, 0, 0)] * 60
    for second, mask in enumerate(masks):
        stamps = START + second * SECOND + np.arange(0, SECOND, SECOND // 50)
        omega = np.zeros((50, 3))
        navigator.push_imu_block(
            stamps, omega_p_radps=omega, force_p_mps2=omega + np.array([0.0, 0.0, -gravity])
        )
        seen = np.array(mask, dtype=bool)
        if seen.any():
            navigator.push_beams(int(stamps[-1]), np.zeros(4), seen, sd_mps=np.full(4, 0.02))
        fixes = solve_velocity(JANUS, np.zeros((1, 4)), [seen], method="info", beam_sd_mps=0.02)
        estimate = Estimate.from_navigator(
            navigator, fixes=fixes, beams=ping(mask), omega_p_radps=np.zeros(3)
        )
        assert estimate.rank == (3, 2, 0)[(second >= 20) + (second >= 40)]
        for name, one in ports.items():
            data = one.encode(estimate)
            sent[name] += data is not None
            if name == "odometry":
                variances = [mavlink(data).velocity_covariance[k] for k in (0, 6, 11)]
                assert np.linalg.eigvalsh(np.diag(variances) - estimate.covariance_m2ps2)[0] >= 0.0
    assert sent["odometry"] == 100
    assert sent["microstrain"] == 40
    assert sent["vision_position_delta"] == 99
