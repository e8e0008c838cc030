"""ROS 2 messages through rosbags, makers' records and sentences through readers: what was sent comes back."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bottomlock.io import pd0 as pd0_reader
from bottomlock.io import ros as ros_reader
from bottomlock.io import waterlinked_json as waterlinked_reader
from bottomlock.io.rows import PLAIN
from bottomlock.kernel import solve_velocity
from bottomlock.ports.registry import PORTS, port
from tests.ports.cases import BEAM_SD, JANUS, MASKS, SECOND, START, TRUTH, from_beams, navigated
from tests.ports.receivers import waterlinked_client

rosbags = pytest.importorskip("rosbags.typesys")

FLU = np.diag([1.0, -1.0, -1.0])
VELOCITY_DEFINITION = """
std_msgs/Header header
string body_frame_id
string reference_frame_id
geometry_msgs/TwistWithCovariance velocity
"""


@pytest.fixture(scope="module")
def store() -> Any:  # noqa: ANN401 - the library is not typed
    """The library's types, and the one that it does not have yet, from ros2/common_interfaces."""
    found = ros_reader.typestore()
    found.register(
        rosbags.get_types_from_msg(VELOCITY_DEFINITION, "geometry_msgs/msg/VelocityWithCovarianceStamped")
    )
    return found


def vector(message: Any) -> list[float]:  # noqa: ANN401
    return [message.x, message.y, message.z]


@pytest.mark.parametrize("name", [name for name, made in PORTS.items() if made.ros_type])
def test_a_time_that_ros_cannot_hold_is_not_sent(name: str) -> None:
    """From 2038 on a second is no signed number of 32 bits."""
    one = port(name, **({"geometry": JANUS} if "geometry" in PORTS[name].model_fields else {}))
    beams = from_beams(MASKS["4 beams"]).beams
    assert one.encode(navigated(2**31 * SECOND - 1, beams=beams)) is not None
    assert one.encode(navigated(2**31 * SECOND, beams=beams)) is None
    assert "later than a ROS time holds" in str(one.reason)


def test_ros_velocity(store: Any) -> None:  # noqa: ANN401
    estimate = navigated()
    data = port("ros_velocity", frame_id="base", reference_frame_id="map").encode(estimate)
    message = store.deserialize_cdr(data, "geometry_msgs/msg/VelocityWithCovarianceStamped")
    stamp = message.header.stamp
    assert stamp.sec * SECOND + stamp.nanosec == START
    assert (message.header.frame_id, message.body_frame_id, message.reference_frame_id) == (
        "base",
        "base",
        "map",
    )
    np.testing.assert_array_equal(vector(message.velocity.twist.linear), FLU @ TRUTH)
    np.testing.assert_array_equal(vector(message.velocity.twist.angular), FLU @ [0.01, 0.02, -0.1])
    whole = message.velocity.covariance.reshape(6, 6)
    np.testing.assert_array_equal(whole[:3, :3], FLU @ estimate.covariance_m2ps2 @ FLU)
    np.testing.assert_array_equal(whole[3:, 3:], 100.0 * np.eye(3))
    assert not whole[:3, 3:].any()
    # The library writes the same bytes.
    again = store.serialize_cdr(message, "geometry_msgs/msg/VelocityWithCovarianceStamped")
    assert bytes(again) == data


@pytest.mark.parametrize("frame_id", ["a", "ab", "abc", "abcd", "abcdefgh"])
def test_ros_twist_is_aligned(store: Any, frame_id: str) -> None:  # noqa: ANN401
    """Names of every length: the numbers that follow stand at multiples of their size."""
    name = "geometry_msgs/msg/TwistWithCovarianceStamped"
    data = port("ros_twist", frame="frd", frame_id=frame_id).encode(from_beams(MASKS["3 beams"]))
    message = store.deserialize_cdr(data, name)
    np.testing.assert_allclose(vector(message.twist.twist.linear), TRUTH, atol=1e-12)
    assert vector(message.twist.twist.angular) == [0.0, 0.0, 0.0]
    assert bytes(store.serialize_cdr(message, name)) == data


@pytest.mark.parametrize("mask", [MASKS["2 opposite"], MASKS["2 neighbours"], MASKS["1 beam"]])
def test_a_partial_velocity_with_a_weak_prior_is_the_information_of_the_beams(
    store: Any,  # noqa: ANN401
    mask: tuple[int, ...],
) -> None:
    """Fused into a prior of σ 0.3 m/s it gives what the beams themselves give, to (0.3 / 100)²."""
    estimate = from_beams(mask)
    assert "unseen_sd_mps would state the rest" in str(port("ros_velocity").sends(estimate))
    data = port("ros_velocity", frame="frd", unseen_sd_mps=100.0).encode(estimate)
    message = store.deserialize_cdr(data, "geometry_msgs/msg/VelocityWithCovarianceStamped")
    sent = np.array(vector(message.velocity.twist.linear))
    covariance = message.velocity.covariance.reshape(6, 6)[:3, :3]
    prior, mean = 0.09 * np.eye(3), np.array([1.5, 0.0, 0.1])

    seen = np.array(mask, dtype=bool)
    rows = np.asarray(JANUS.directions_p)[seen]
    readings = JANUS.beam_velocities([TRUTH])[0][seen]
    gain = prior @ rows.T @ np.linalg.inv(rows @ prior @ rows.T + BEAM_SD**2 * np.eye(len(rows)))
    expected = mean + gain @ (readings - rows @ mean)
    fused = mean + prior @ np.linalg.inv(prior + covariance) @ (sent - mean)
    np.testing.assert_allclose(fused, expected, atol=5e-5)


@pytest.mark.parametrize("mask", list(MASKS.values()))
def test_ros_dvl(store: Any, mask: tuple[int, ...]) -> None:  # noqa: ANN401
    """The library reads it, and our reader of bags takes the same beams from it."""
    estimate = from_beams(mask)
    data = port("ros_dvl", geometry=JANUS).encode(estimate)
    message = store.deserialize_cdr(data, "marine_acoustic_msgs/msg/Dvl")
    assert bytes(store.serialize_cdr(message, "marine_acoustic_msgs/msg/Dvl")) == data
    assert (message.velocity_mode, message.num_good_beams, message.beam_velocities_valid) == (
        1,
        sum(mask),
        True,
    )
    np.testing.assert_allclose([vector(b) for b in message.beam_unit_vec], JANUS.directions_p)
    assert message.altitude == pytest.approx(30.0 * np.cos(np.deg2rad(20.0)))
    there = estimate.components
    np.testing.assert_array_equal(np.isfinite(vector(message.velocity)), there)
    covariance = message.velocity_covar.reshape(3, 3)
    np.testing.assert_array_equal(np.diag(covariance) == -1.0, ~there)
    decoder = ros_reader.FORMAT.decoder("port", PLAIN, 4)
    decoder.feed(data)
    (taken,) = decoder.take()
    table = taken.table
    assert table.valid.tolist() == [[bool(one) for one in mask]]
    assert estimate.beams is not None
    np.testing.assert_allclose(table.velocity_mps[0], estimate.beams.velocity_mps, rtol=1e-6)


def test_water_linked_with_the_velocity_restored() -> None:
    """Two beams and an inertial estimate: the report is valid, its beams are those that returned."""
    seen = from_beams(MASKS["2 neighbours"])
    small = np.diag([0.01, 0.02, 0.005]) ** 2
    estimate = navigated(beams=seen.beams, rank=2, covariance_m2ps2=small)
    one = port("waterlinked_json", geometry=JANUS)
    assert one.encode(navigated(START - SECOND // 5, beams=seen.beams, covariance_m2ps2=small)) is None
    assert one.reason == "no interval yet: the first estimate"
    data = one.encode(estimate)
    assert data is not None
    (report,) = waterlinked_client(data)
    assert report["velocity_valid"] is True
    assert [report["vx"], report["vy"], report["vz"]] == TRUTH.tolist()
    np.testing.assert_array_equal(report["covariance"], estimate.covariance_m2ps2)
    assert report["fom"] == pytest.approx(0.02)
    assert report["time"] == 200.0
    assert report["time_of_validity"] == START // 1000
    recording = waterlinked_reader.FORMAT.read(data, "port")
    assert recording.table.valid.tolist() == [[True, True, False, False]]
    np.testing.assert_allclose(recording.table.instrument_mps, [TRUTH])
    blind = navigated(START + SECOND, covariance_m2ps2=np.eye(3) * 0.25)
    assert one.sends(blind) == "σ is 0.500 m/s, above max_fom_mps, 0.4"


@pytest.mark.parametrize("mask", [(1, 1, 1, 1), (1, 1, 0, 0), (0, 0, 0, 0)])
def test_pd0_with_the_velocity_restored(mask: tuple[int, ...]) -> None:
    """A receiver that solves the four beams gets our velocity to PD0's 1 mm/s; with all beams those of the ping."""
    seen = from_beams(mask)
    velocity = TRUTH + np.array([0.1, 0.0, 0.0])
    still = np.zeros(3)
    estimate = navigated(beams=seen.beams, velocity_p_mps=velocity, omega_p_radps=still)
    data = port("pd0", geometry=JANUS, receiver_sd_mps=0.5).encode(estimate)
    assert data is not None
    table = pd0_reader.FORMAT.read(data, "port").table
    assert table.valid.all()
    fix = solve_velocity(JANUS, table.velocity_mps, table.valid, method="lc", beam_sd_mps=BEAM_SD)
    expected = TRUTH if all(mask) else velocity
    np.testing.assert_allclose(fix.velocity_p_mps[0], expected, atol=0.001 / np.sin(np.deg2rad(20.0)))


def checked(line: bytes) -> list[str]:
    """Fields of a sentence whose checksum is right."""
    assert line.startswith(b"$")
    assert line.endswith(b"\r\n")
    body, stated = line[1:-2].split(b"*")
    found = 0
    for byte in body:
        found ^= byte
    assert int(stated, 16) == found
    return body.decode().split(",")


def test_sentence_of_a_whole_velocity() -> None:
    estimate = navigated()
    data = port("sentence").encode(estimate)
    assert data is not None
    fields = checked(data)
    assert fields[:7] == ["PBLKV", "1", str(START), "navigation", "OK", "3", "7"]
    numbers = [float(field) for field in fields[7:]]
    np.testing.assert_array_equal(numbers[:3], TRUTH)
    np.testing.assert_array_equal(numbers[3:], estimate.covariance_m2ps2[np.triu_indices(3)])


@pytest.mark.parametrize("mask", [MASKS["2 opposite"], MASKS["2 neighbours"], MASKS["1 beam"]])
def test_sentences_of_a_partial_velocity(mask: tuple[int, ...]) -> None:
    """Empty fields for what is not determined, and the axes from which the information can be made again."""
    estimate = from_beams(mask)
    data = port("sentence").encode(estimate)
    assert data is not None
    first, *axes = [checked(line) for line in data.splitlines(keepends=True)]
    assert [field != "" for field in first[7:10]] == estimate.components.tolist()
    assert len(axes) == estimate.rank
    information, vector_sum = np.zeros((3, 3)), np.zeros(3)
    for fields in axes:
        values = np.array([float(field) for field in fields[5:]])
        information += np.outer(values[:3], values[:3]) / values[4]
        vector_sum += values[:3] * values[3] / values[4]
    rows = np.asarray(JANUS.directions_p)[np.array(mask, dtype=bool)]
    np.testing.assert_allclose(information, rows.T @ rows / BEAM_SD**2, atol=1e-9)
    np.testing.assert_allclose(vector_sum, rows.T @ (rows @ TRUTH) / BEAM_SD**2, atol=1e-9)


def test_ros_odometry(store: Any) -> None:  # noqa: ANN401
    """Against scipy: the pose in east-north-up, forward-left-up; drawn errors have the covariance of the message."""
    estimate = navigated()
    data = port("ros_odometry", frame_id="map", child_frame_id="base").encode(estimate)
    message = store.deserialize_cdr(data, "nav_msgs/msg/Odometry")
    assert bytes(store.serialize_cdr(message, "nav_msgs/msg/Odometry")) == data
    assert (message.header.frame_id, message.child_frame_id) == ("map", "base")
    assert estimate.position_t_m is not None
    assert estimate.attitude_t_p is not None
    assert estimate.navigation_covariance is not None
    north, east, down = estimate.position_t_m
    assert vector(message.pose.pose.position) == [east, north, -down]
    world = Rotation.from_matrix([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    body = Rotation.from_matrix(FLU)
    known = world * Rotation.from_quat(np.roll(estimate.attitude_t_p, -1)) * body
    q = message.pose.pose.orientation
    assert (known.inv() * Rotation.from_quat([q.x, q.y, q.z, q.w])).magnitude() < 1e-12

    # Small errors and rotations, north, east, down, drawn from their covariance: what of them the message holds.
    scale = 1e-5
    drawn = np.random.default_rng(5).multivariate_normal(
        np.zeros(6), scale**2 * estimate.navigation_covariance[:6, :6], 20_000, check_valid="ignore"
    )
    true = (
        world
        * Rotation.from_rotvec(drawn[:, 3:])
        * Rotation.from_quat(np.roll(estimate.attitude_t_p, -1))
        * body
    )
    turned = (true * known.inv()).as_rotvec()
    errors = np.hstack([world.apply(drawn[:, :3]), turned]) / scale
    covariance = message.pose.covariance.reshape(6, 6)
    sd = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(np.cov(errors.T) / np.outer(sd, sd), covariance / np.outer(sd, sd), atol=0.03)
    # The twist is that of ros_twist.
    twist = store.deserialize_cdr(
        port("ros_twist").encode(estimate), "geometry_msgs/msg/TwistWithCovarianceStamped"
    ).twist
    np.testing.assert_array_equal(message.twist.covariance, twist.covariance)
    assert vector(message.twist.twist.linear) == vector(twist.twist.linear)


def test_ros_tf(store: Any) -> None:  # noqa: ANN401
    """The pose of the odometry, as a transform."""
    estimate = navigated()
    data = port("ros_tf").encode(estimate)
    message = store.deserialize_cdr(data, "tf2_msgs/msg/TFMessage")
    assert bytes(store.serialize_cdr(message, "tf2_msgs/msg/TFMessage")) == data
    (found,) = message.transforms
    pose = store.deserialize_cdr(port("ros_odometry").encode(estimate), "nav_msgs/msg/Odometry").pose.pose
    assert (found.header.frame_id, found.child_frame_id) == ("odom", "base_link")
    assert vector(found.transform.translation) == vector(pose.position)
    assert found.transform.rotation == pose.orientation
