"""ROS 2: `nav_msgs/Odometry` and `tf2_msgs/TFMessage`, as CDR: the pose of `base_link` in `odom`, and its motion.

The world's axes are east, north, up, the body's forward, left, up (REP 103). With A from north-east-down to
east-north-up and B from forward-left-up to forward-right-down, the attitude is A R B, the position A p and, as both
errors have tangent axes, the covariance of position and rotation diag(A, A) P diag(A, A)': the rotation is about the
fixed axes of the world, as the message has it. The twist is in body axes, with the covariance of `ros_twist`.

Source: ros2/common_interfaces, nav_msgs and geometry_msgs; ros2/geometry2, tf2_msgs; REP 103 and 105.
"""

import numpy as np

from bottomlock.ports.cdr import CdrWriter
from bottomlock.ports.estimate import Estimate, Floats
from bottomlock.ports.port import FrameName, Port
from bottomlock.ports.ros_velocity import TwistPort, later_than_a_ros_time
from bottomlock.recordings.rotation import QUATERNION_ENU_NED, QUATERNION_FLU_FRD, product

ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def pose_enu_flu(estimate: Estimate) -> tuple[Floats, Floats]:
    """Position (3,) east, north, up, m, and unit quaternion (4,), scalar first, forward-left-up to east-north-up."""
    assert estimate.position_t_m is not None  # of mode navigation
    assert estimate.attitude_t_p is not None
    attitude = product(product(QUATERNION_ENU_NED, estimate.attitude_t_p), QUATERNION_FLU_FRD)
    return ENU_FROM_NED @ estimate.position_t_m, attitude if attitude[0] >= 0.0 else -attitude


def _no_pose(estimate: Estimate) -> str | None:
    """Why an estimate has no pose in a message."""
    if estimate.mode != "navigation":
        return "mode velocity has no pose, which this message holds"
    return later_than_a_ros_time(estimate)


def _put_orientation(writer: CdrWriter, attitude: Floats) -> None:
    """`geometry_msgs/Quaternion`, scalar last."""
    w, x, y, z = attitude.tolist()
    writer.float64(x, y, z, w)


class RosOdometry(TwistPort):
    """`nav_msgs/Odometry`: pose in `frame_id`, twist in `child_frame_id`, with covariances (mode navigation)."""

    name = "ros_odometry"
    ros_type = "nav_msgs/msg/Odometry"

    frame_id: FrameName = "odom"
    """the world's frame, east-north-up from the origin: `odom`, or `map` where positions are measured"""
    child_frame_id: FrameName = "base_link"
    """the body's, forward-left-up"""

    def _refuses(self, estimate: Estimate) -> str | None:
        return _no_pose(estimate)

    def _message(self, estimate: Estimate) -> bytes:
        assert estimate.navigation_covariance is not None
        position, attitude = pose_enu_flu(estimate)
        turn = np.kron(np.eye(2), ENU_FROM_NED)
        covariance = turn @ estimate.navigation_covariance[:6, :6] @ turn.T
        writer = CdrWriter()
        writer.header(estimate.time_ns, self.frame_id)
        writer.string(self.child_frame_id)
        writer.float64(*(position + 0.0).tolist())
        _put_orientation(writer, attitude)
        writer.float64(*(covariance + 0.0).ravel().tolist())
        self._put_twist(writer, estimate)
        return bytes(writer)


class RosTransform(Port):
    """`tf2_msgs/TFMessage` for `/tf`: where the body is in the world's frame (mode navigation)."""

    name = "ros_tf"
    ros_type = "tf2_msgs/msg/TFMessage"

    frame_id: FrameName = "odom"
    """as of `RosOdometry`"""
    child_frame_id: FrameName = "base_link"
    """as of `RosOdometry`"""

    def _refuses(self, estimate: Estimate) -> str | None:
        return _no_pose(estimate)

    def _message(self, estimate: Estimate) -> bytes:
        position, attitude = pose_enu_flu(estimate)
        writer = CdrWriter()
        writer.uint32(1)
        writer.header(estimate.time_ns, self.frame_id)
        writer.string(self.child_frame_id)
        writer.float64(*(position + 0.0).tolist())
        _put_orientation(writer, attitude)
        return bytes(writer)
