"""What live use makes of messages of ROS 2: axes, times, marks of what is missing, and mistakes of a configuration."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from bottomlock.io.ros_messages import LATER_DVL
from bottomlock.kernel import normal_gravity_mps2
from bottomlock.live.readings import PingReader, RosReader
from bottomlock.live.sections import DepthSection
from tests.io.test_ros_messages import store_of
from tests.ros import dive
from tests.ros_messages import Messages

pytest.importorskip("rosbags", reason="needs rosbags (extra ros)")

TIME_NS = 1_790_000_000_123_456_789
MESSAGES = Messages()


def bytes_of(topic: str, message: Any) -> bytes:  # noqa: ANN401
    return bytes(MESSAGES.store.serialize_cdr(message, dive.TYPES[topic]))


def reading(form: str, topic: str, message: Any, **settings: Any) -> Any:  # noqa: ANN401
    (found,) = RosReader(form, **settings).feed(bytes_of(topic, message))
    return found


def skipped(form: str, topic: str, message: Any) -> str:  # noqa: ANN401
    reader = RosReader(form)
    assert reader.feed(bytes_of(topic, message)) == []
    ((why, number),) = dict(reader.skipped).items()
    assert (number, reader.records) == (1, 1)
    return why


def test_inertial_axes() -> None:
    """At rest REP 103's IMU feels +g up; a turn to the left is positive about up."""
    found = reading("ros-imu", "/imu", MESSAGES.imu(TIME_NS, (0.1, 0.2, 0.3), (0.5, 0.25, 9.81)))
    assert found.time_ns == TIME_NS
    assert found.omega_radps == (0.1, -0.2, -0.3)
    assert found.force_mps2 == (0.5, -0.25, -9.81)


def test_inertial_readings_that_are_none() -> None:
    message = MESSAGES.imu(TIME_NS, (0.1, math.nan, 0.3), (0.5, 0.25, 9.81))
    assert skipped("ros-imu", "/imu", message) == "numbers that are not finite"
    message = MESSAGES.imu(TIME_NS, (0.1, 0.2, 0.3), (0.5, 0.25, 9.81))
    message.angular_velocity_covariance[0] = -1.0
    assert skipped("ros-imu", "/imu", message) == "no rates or no accelerations, by their covariance"
    assert skipped("ros-attitude", "/imu", message) == "no orientation, by its covariance"
    message.orientation_covariance[0] = 0.0
    assert skipped("ros-attitude", "/imu", message) == "no unit quaternion"


def test_attitude_keeps_the_frames_of_its_driver() -> None:
    """Scalar last in the message, first here; `attitude.frame` turns it."""
    message = MESSAGES.imu(TIME_NS, (0.0, 0.0, 0.0), (0.0, 0.0, 9.81))
    message.orientation_covariance[0] = 0.0
    for part, number in zip("xyzw", (0.1, 0.5, -0.5, 0.7), strict=True):
        setattr(message.orientation, part, number)
    found = reading("ros-attitude", "/imu", message)
    assert found.attitude_t_s == (0.7, 0.1, 0.5, -0.5)


def test_pressure_and_depth() -> None:
    """The depth of a pressure, and one as it is."""
    depth = reading(
        "ros-pressure",
        "/pressure",
        MESSAGES.pressure(TIME_NS, dive.pressure_pa(12.5)),
        depth=DepthSection(),
        gravity_mps2=normal_gravity_mps2(math.radians(dive.LATITUDE_DEG)),
    )
    assert depth.time_ns == TIME_NS
    assert depth.depth_m == pytest.approx(12.5, abs=1e-9)
    number = MESSAGES.store.types["std_msgs/msg/Float64"](data=7.25)
    data = bytes(MESSAGES.store.serialize_cdr(number, "std_msgs/msg/Float64"))
    assert RosReader("ros-depth").feed(data)[0].depth_m == 7.25  # type: ignore[union-attr]


def test_acoustic_positions() -> None:
    """East, north, up with variances, as north, east, down with 1 sigma; covariances of zero state none."""
    message = MESSAGES.usbl(TIME_NS, north=3.0, east=-4.0, down=5.0)
    found = reading("ros-pose", "/usbl", message)
    assert found.position_t_m == (3.0, -4.0, 5.0)
    assert found.sd_m == (1.0, 1.1, 1.5)
    message.pose.covariance[:] = 0.0
    assert reading("ros-pose", "/usbl", message).sd_m is None


def fix(status: int, latitude: float = 43.0) -> bytes:
    types = MESSAGES.store.types
    message = types["sensor_msgs/msg/NavSatFix"](
        header=MESSAGES.header(TIME_NS, "gps"),
        status=types["sensor_msgs/msg/NavSatStatus"](status=status, service=1),
        latitude=latitude,
        longitude=-7.5,
        altitude=33.0,
        position_covariance=np.zeros(9),
        position_covariance_type=0,
    )
    return bytes(MESSAGES.store.serialize_cdr(message, "sensor_msgs/msg/NavSatFix"))


def test_gps() -> None:
    reader = RosReader("ros-navsat")
    (found,) = reader.feed(fix(0))
    assert (found.time_ns, found.latitude_deg, found.longitude_deg, found.height_m) == (  # type: ignore[union-attr]
        TIME_NS,
        43.0,
        -7.5,
        33.0,
    )
    assert reader.feed(fix(-1)) == reader.feed(fix(0, 91.0)) == []
    assert dict(reader.skipped) == {
        "no fix, by its status": 1,
        "numbers that are no latitude and longitude": 1,
    }


def report(lost: tuple[int, ...] = (), *, later: bool = False, validity_us: int = 0, **changed: Any) -> bytes:  # noqa: ANN401
    """A `dvl_msgs/DVL` with what a report of an A50 has, in its later version too."""
    store = store_of(LATER_DVL) if later else store_of()
    types = store.types
    beams = [
        types["dvl_msgs/msg/DVLBeam"](
            id=k, velocity=0.1 * (k + 1), distance=12.0 + k, rssi=-30.0, nsd=-90.0, valid=k not in lost
        )
        for k in range(4)
    ]
    fields: dict[str, Any] = {
        "header": MESSAGES.header(TIME_NS, "dvl"),
        "time": 250.0,
        "velocity": types["geometry_msgs/msg/Vector3"](x=1.0, y=0.1, z=0.05),
        "fom": 0.01,
        "altitude": 11.0,
        "beams": beams,
        "velocity_valid": not lost,
        "status": 0,
        "form": "json_v3.1",
    }
    if later:
        fields |= {
            "covariance": np.arange(9.0),
            "time_of_validity": validity_us,
            "time_of_transmission": validity_us + 50_000,
        }
    return bytes(store.serialize_cdr(types["dvl_msgs/msg/DVL"](**(fields | changed)), "dvl_msgs/msg/DVL"))


@pytest.mark.parametrize("later", [False, True])
def test_the_message_of_water_linked_s_drivers(later: bool) -> None:
    """Both versions; the time of validity where the later one has it; repeats are stale."""
    reader = PingReader("ros-dvl-msgs", 4)
    (ping,) = reader.feed(report((2,), later=later))
    assert ping.time_ns == TIME_NS
    assert ping.valid.tolist() == [True, True, False, True]
    np.testing.assert_allclose(ping.velocity_mps[ping.valid], [0.1, 0.2, 0.4])
    np.testing.assert_allclose(ping.range_m, [12.0, 13.0, 14.0, 15.0])
    assert ping.instrument_valid is False
    (again,) = reader.feed(report((2,), later=later))
    assert again.stale
    assert not again.valid.any()
    if later:
        (ping,) = reader.feed(report(later=True, validity_us=1_790_000_000_000_001))
        assert ping.time_ns == 1_790_000_000_000_001_000


def test_beams_that_are_none() -> None:
    """No transducers, as a driver sends them without a lock: a ping with every beam lost. Two of one number: none."""
    reader = PingReader("ros-dvl-msgs", 4)
    (ping,) = reader.feed(report(beams=[]))
    assert not ping.valid.any()
    types = store_of().types
    one = types["dvl_msgs/msg/DVLBeam"](id=1, velocity=0.1, distance=12.0, rssi=-30.0, nsd=-90.0, valid=True)
    assert reader.feed(report(beams=[one, one])) == []
    assert reader.feed(b"\x00\x01\x00\x00") == []
    assert dict(reader.skipped) == {
        "transducers are not a list with ids 0 to 3": 1,
        "no dvl_msgs/DVL: ends within 'sec'": 1,
    }
