"""ROS 2: `geometry_msgs/VelocityWithCovarianceStamped` and `geometry_msgs/TwistWithCovarianceStamped`, as CDR.

Both hold the whole covariance, in double precision: nothing is lost. By default the axes are forward-left-up, as REP
103 has them for `base_link`: ours are forward-right-down, so y and z change their sign, and with them the covariances
of x with y and z.

A covariance cannot say that an axis is not determined. Below rank 3 nothing is sent, unless `unseen_sd_mps` states
the σ with which the axes that the beams do not determine are sent as zero: then the message is the information form of
the beams with a weak prior, and equals it as far as that σ is large against the receiver's own.

Source: ros2/common_interfaces, geometry_msgs; REP 103.
"""

from dataclasses import dataclass

import numpy as np

from bottomlock.ports.cdr import CdrWriter
from bottomlock.ports.estimate import Estimate, Floats
from bottomlock.ports.port import Port
from bottomlock.recordings.rotation import FLU_FROM_FRD

# Latest second of a ROS time, a signed 32-bit number.
_LATEST_S = 2**31 - 1


def later_than_a_ros_time(estimate: Estimate) -> str | None:
    """Why the time of an estimate cannot be sent."""
    if estimate.time_ns // 1_000_000_000 > _LATEST_S:
        return f"time_ns is {estimate.time_ns}, later than a ROS time holds"
    return None


@dataclass(kw_only=True, eq=False)
class RosTwist(Port):
    """`geometry_msgs/TwistWithCovarianceStamped`, for robot_localization and others.

    Args:
        frame: axes of the message, "flu" (REP 103) or "frd".
        frame_id: name of these axes: `base_link` for "flu".
        unseen_sd_mps: see the module; None sends nothing below rank 3.
        angular_sd_radps: σ of the angular rates in the message, which has no mark for "not stated": switch them off in
            the receiver. They are those of the gyros where they are known, and else zero.
        max_rate_hz: most messages a second; None for every estimate.
    """

    name = "ros_twist"
    ros_type = "geometry_msgs/msg/TwistWithCovarianceStamped"

    frame: str = "flu"
    frame_id: str = "base_link"
    unseen_sd_mps: float | None = None
    angular_sd_radps: float = 10.0

    def __post_init__(self) -> None:
        super().__post_init__()
        flu = self._one_of("frame", self.frame, ("flu", "frd")) == "flu"
        self._signs = FLU_FROM_FRD if flu else np.ones(3)
        self._frame_id = self._word("frame_id", self.frame_id)
        self._unseen = self._positive_or_none("unseen_sd_mps", self.unseen_sd_mps)
        self._angular = self._positive("angular_sd_radps", self.angular_sd_radps)

    def _refuses(self, estimate: Estimate) -> str | None:
        late = later_than_a_ros_time(estimate)
        if late:
            return late
        if estimate.complete or (self._unseen is not None and estimate.rank > 0):
            return None
        hint = "" if estimate.rank == 0 else "; unseen_sd_mps would state the rest"
        return f"the beams determine {estimate.rank} of 3 axes{hint}"

    def _velocity(self, estimate: Estimate) -> tuple[Floats, Floats]:
        """Velocity and covariance, platform axes, with the weak prior where there is one."""
        if estimate.complete or self._unseen is None:
            return estimate.velocity_p_mps, estimate.covariance_m2ps2
        axes, _, variance = estimate.observable_axes()
        null = np.eye(3) - axes.T @ axes
        return estimate.observed_velocity_p_mps, (axes.T * variance) @ axes + self._unseen**2 * null

    def _message(self, estimate: Estimate) -> bytes:
        writer = CdrWriter()
        writer.header(estimate.time_ns, self._frame_id)
        self._put_twist(writer, estimate)
        return bytes(writer)

    def _put_twist(self, writer: CdrWriter, estimate: Estimate) -> None:
        """`geometry_msgs/TwistWithCovariance`."""
        velocity, covariance = self._velocity(estimate)
        rates = np.zeros(3) if estimate.omega_p_radps is None else estimate.omega_p_radps
        whole = np.zeros((6, 6))
        whole[:3, :3] = covariance * np.outer(self._signs, self._signs)
        whole[3:, 3:] = self._angular**2 * np.eye(3)
        # Adding zero makes a plain zero of a negative one.
        writer.float64(*(velocity * self._signs + 0.0).tolist())
        writer.float64(*(rates * self._signs + 0.0).tolist())
        writer.float64(*(whole + 0.0).ravel().tolist())


@dataclass(kw_only=True, eq=False)
class RosVelocity(RosTwist):
    """`geometry_msgs/VelocityWithCovarianceStamped`: velocity of a body in a reference frame, in stated axes.

    Args:
        reference_frame_id: the frame in which the body moves.
        frame: as of `RosTwist`; the body's axes.
        frame_id: as of `RosTwist`; name of the body frame and of the axes.
        unseen_sd_mps: as of `RosTwist`.
        angular_sd_radps: as of `RosTwist`.
        max_rate_hz: as of `RosTwist`.
    """

    name = "ros_velocity"
    ros_type = "geometry_msgs/msg/VelocityWithCovarianceStamped"

    reference_frame_id: str = "odom"

    def __post_init__(self) -> None:
        super().__post_init__()
        self._reference = self._word("reference_frame_id", self.reference_frame_id)

    def _message(self, estimate: Estimate) -> bytes:
        writer = CdrWriter()
        writer.header(estimate.time_ns, self._frame_id)
        writer.string(self._frame_id)
        writer.string(self._reference)
        self._put_twist(writer, estimate)
        return bytes(writer)
