"""ROS 2, as CDR: velocities and twists with covariance of geometry_msgs, the odometry of nav_msgs, and its transform.

The first two hold the whole covariance, in double precision. By default the axes are forward-left-up, as REP 103 has
them for `base_link`: ours are forward-right-down, so y and z change their sign, and with them the covariances
of x with y and z.

A covariance cannot say that an axis is not determined. Below rank 3 nothing is sent, unless `unseen_sd_mps` states
the σ with which the axes that the beams do not determine are sent as zero: then the message is the information form of
the beams with a weak prior, and equals it as far as that σ is large against the receiver's own.

`nav_msgs/Odometry` and `tf2_msgs/TFMessage` have the pose of `base_link` in `odom`, whose axes are east, north, up.
With A from north-east-down to east-north-up, B from forward-left-up to forward-right-down, the attitude is A R B, the
position A p and, as both errors have tangent axes, the covariance of position and rotation diag(A, A) P diag(A, A)':
the rotation is about the fixed axes of the world, as the message has it. The twist is that of `ros_twist`.

Source: ros2/common_interfaces, geometry_msgs and nav_msgs; ros2/geometry2, tf2_msgs; REP 103 and 105.
"""

from typing import Literal

import numpy as np

from bottomlock.kernel.models import Positive
from bottomlock.ports.cdr import CdrWriter
from bottomlock.ports.estimate import Estimate, Floats
from bottomlock.ports.port import FrameName, Port
from bottomlock.recordings.rotation import FLU_FROM_FRD, QUATERNION_ENU_NED, QUATERNION_FLU_FRD, product

# Latest second of a ROS time, a signed 32-bit number.
_LATEST_S = 2**31 - 1


def later_than_a_ros_time(estimate: Estimate) -> str | None:
    """Why the time of an estimate cannot be sent."""
    if estimate.time_ns // 1_000_000_000 > _LATEST_S:
        return f"time_ns is {estimate.time_ns}, later than a ROS time holds"
    return None


class TwistPort(Port):
    """Base of the messages with a twist.

    The message has no mark for angular rates that are not stated: they are those of the gyros where they are known, and
    else zero. Switch them off in the receiver.
    """

    angular_sd_radps: Positive = 10.0
    """σ of the angular rates in the message"""

    @property
    def _signs(self) -> Floats:
        """(3,) from platform axes to those of the message."""
        return FLU_FROM_FRD

    def _velocity(self, estimate: Estimate) -> tuple[Floats, Floats]:
        """Velocity and covariance, platform axes."""
        return estimate.velocity_p_mps, estimate.covariance_m2ps2

    def _put_twist(self, writer: CdrWriter, estimate: Estimate) -> None:
        """`geometry_msgs/TwistWithCovariance`."""
        velocity, covariance = self._velocity(estimate)
        rates = np.zeros(3) if estimate.omega_p_radps is None else estimate.omega_p_radps
        whole = np.zeros((6, 6))
        whole[:3, :3] = covariance * np.outer(self._signs, self._signs)
        whole[3:, 3:] = self.angular_sd_radps**2 * np.eye(3)
        # Adding zero makes a plain zero of a negative one.
        writer.float64(*(velocity * self._signs + 0.0).tolist())
        writer.float64(*(rates * self._signs + 0.0).tolist())
        writer.float64(*(whole + 0.0).ravel().tolist())


class RosTwist(TwistPort):
    """`geometry_msgs/TwistWithCovarianceStamped`, for robot_localization and others."""

    name = "ros_twist"
    ros_type = "geometry_msgs/msg/TwistWithCovarianceStamped"

    frame: Literal["flu", "frd"] = "flu"
    """axes of the message, of the body: flu is REP 103"""
    frame_id: FrameName = "base_link"
    """name of these axes: `base_link` for flu"""
    unseen_sd_mps: Positive | None = None
    """see the module; None sends nothing below rank 3"""

    @property
    def _signs(self) -> Floats:
        return FLU_FROM_FRD if self.frame == "flu" else np.ones(3)

    def _refuses(self, estimate: Estimate) -> str | None:
        late = later_than_a_ros_time(estimate)
        if late:
            return late
        if estimate.complete or (self.unseen_sd_mps is not None and estimate.rank > 0):
            return None
        hint = "" if estimate.rank == 0 else "; unseen_sd_mps would state the rest"
        return f"the beams determine {estimate.rank} of 3 axes{hint}"

    def _velocity(self, estimate: Estimate) -> tuple[Floats, Floats]:
        """Velocity and covariance, platform axes, with the weak prior where there is one."""
        if estimate.complete or self.unseen_sd_mps is None:
            return estimate.velocity_p_mps, estimate.covariance_m2ps2
        axes, _, variance = estimate.observable_axes()
        null = np.eye(3) - axes.T @ axes
        return estimate.observed_velocity_p_mps, (axes.T * variance) @ axes + self.unseen_sd_mps**2 * null

    def _message(self, estimate: Estimate) -> bytes:
        writer = CdrWriter()
        writer.header(estimate.time_ns, self.frame_id)
        self._put_twist(writer, estimate)
        return bytes(writer)


class RosVelocity(RosTwist):
    """`geometry_msgs/VelocityWithCovarianceStamped`: velocity of a body in a reference frame, in stated axes."""

    name = "ros_velocity"
    ros_type = "geometry_msgs/msg/VelocityWithCovarianceStamped"

    reference_frame_id: FrameName = "odom"
    """the frame in which the body moves"""

    def _message(self, estimate: Estimate) -> bytes:
        writer = CdrWriter()
        writer.header(estimate.time_ns, self.frame_id)
        writer.string(self.frame_id)
        writer.string(self.reference_frame_id)
        self._put_twist(writer, estimate)
        return bytes(writer)


ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


class PosePort(Port):
    """Base of the messages with a pose (mode navigation)."""

    frame_id: FrameName = "odom"
    """the world's frame, east-north-up from the origin: `odom`, or `map` where positions are measured"""
    child_frame_id: FrameName = "base_link"
    """the body's, forward-left-up"""

    def _refuses(self, estimate: Estimate) -> str | None:
        if estimate.mode != "navigation":
            return "mode velocity has no pose, which this message holds"
        return later_than_a_ros_time(estimate)

    def _put_pose(self, writer: CdrWriter, estimate: Estimate) -> None:
        """Header, name of the body's frame, position and `geometry_msgs/Quaternion`, scalar last."""
        assert estimate.position_t_m is not None  # of mode navigation
        assert estimate.attitude_t_p is not None
        attitude = product(product(QUATERNION_ENU_NED, estimate.attitude_t_p), QUATERNION_FLU_FRD)
        w, x, y, z = (attitude if attitude[0] >= 0.0 else -attitude).tolist()
        position = ENU_FROM_NED @ estimate.position_t_m
        writer.header(estimate.time_ns, self.frame_id)
        writer.string(self.child_frame_id)
        writer.float64(*(position + 0.0).tolist(), x, y, z, w)


class RosOdometry(PosePort, TwistPort):
    """`nav_msgs/Odometry`: pose in `frame_id`, twist in `child_frame_id`, with covariances (mode navigation)."""

    name = "ros_odometry"
    ros_type = "nav_msgs/msg/Odometry"

    def _message(self, estimate: Estimate) -> bytes:
        assert estimate.navigation_covariance is not None
        turn = np.kron(np.eye(2), ENU_FROM_NED)
        covariance = turn @ estimate.navigation_covariance[:6, :6] @ turn.T
        writer = CdrWriter()
        self._put_pose(writer, estimate)
        writer.float64(*(covariance + 0.0).ravel().tolist())
        self._put_twist(writer, estimate)
        return bytes(writer)


class RosTransform(PosePort):
    """`tf2_msgs/TFMessage` for `/tf`: where the body is in the world's frame (mode navigation)."""

    name = "ros_tf"
    ros_type = "tf2_msgs/msg/TFMessage"

    def _message(self, estimate: Estimate) -> bytes:
        writer = CdrWriter()
        writer.uint32(1)
        self._put_pose(writer, estimate)
        return bytes(writer)
