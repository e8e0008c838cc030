"""ODOMETRY: PX4's external vision, and ArduPilot's external navigation."""

import math
from typing import Literal, Self

from pydantic import model_validator

from bottomlock.kernel.models import Positive
from bottomlock.ports.estimate import Estimate, Floats
from bottomlock.ports.mavlink import MavlinkVelocity
from bottomlock.ports.over_bound import diagonal_bound, scalar_bound, single_at_least
from bottomlock.ports.port import incomplete

_LOCAL_NED, _BODY_FRD, _LOCAL_FRD = 1, 12, 20
_ESTIMATOR_VIO = 3
# Upper triangle of a 6 x 6 matrix, row by row: where its diagonal stands.
_DIAGONAL = (0, 6, 11, 15, 18, 20)


class Odometry(MavlinkVelocity):
    """ODOMETRY (331): velocity in body axes with three variances, for PX4, or one σ, for ArduPilot.

    PX4 uses the three variances and needs three finite axes; after 1 s of rejections it resets its velocity to the one
    that is sent. An axis that the beams do not determine therefore carries our inertial estimate with its own, large
    variance, and below rank 3 nothing is sent without one. ArduPilot ignores the covariance, turns the velocity by the
    quaternion of the message and takes the pose too.
    """

    name = "odometry"

    receiver: Literal["px4", "ardupilot"] = "px4"
    """decides the local frame (NED or FRD) and what is needed"""
    receiver_noise_mps: Positive | None = None
    """σ that ArduPilot uses (VISO_VEL_M_NSE): an estimate with a larger σ is not sent; not with px4"""
    pose: bool = False
    """whether PX4 gets position and attitude, with over-bounded variances; else they are NaN, which PX4 does not use;
    ArduPilot always gets them"""

    @model_validator(mode="after")
    def _noise_is_ardupilots(self) -> Self:
        if (self.receiver == "ardupilot") != (self.receiver_noise_mps is not None):
            expected = "VISO_VEL_M_NSE with 'ardupilot' and nothing with 'px4'"
            raise self.wrong("receiver_noise_mps", expected, f" with receiver '{self.receiver}'")
        return self

    @property
    def _pose(self) -> bool:
        return self.pose or self.receiver == "ardupilot"

    def _refuses(self, estimate: Estimate) -> str | None:
        if reason := incomplete(estimate):
            return reason
        if self._pose and estimate.mode != "navigation":
            return "mode velocity has no pose, which this receiver takes"
        sd = math.sqrt(scalar_bound(self._covariance(estimate)))
        return self._above(sd, self.receiver_noise_mps)

    def _message(self, estimate: Estimate) -> bytes:
        velocity = _single(diagonal_bound(self._covariance(estimate)))
        position, attitude, pose = [math.nan] * 3, [math.nan] * 4, [math.nan] * 6
        if self._pose:
            assert estimate.position_t_m is not None
            assert estimate.attitude_t_p is not None
            assert estimate.navigation_covariance is not None
            position, attitude = estimate.position_t_m.tolist(), estimate.attitude_t_p.tolist()
            pose = _single(diagonal_bound(estimate.navigation_covariance[:6, :6] * self.variance_factor))
        rates = [math.nan] * 3 if estimate.omega_p_radps is None else estimate.omega_p_radps.tolist()
        message = self._dialect.MAVLink_odometry_message(
            time_usec=estimate.time_ns // 1000,
            frame_id=_LOCAL_FRD if self.receiver == "ardupilot" else _LOCAL_NED,
            child_frame_id=_BODY_FRD,
            **dict(zip(("x", "y", "z"), position, strict=True)),
            q=attitude,
            **dict(zip(("vx", "vy", "vz"), estimate.velocity_p_mps.tolist(), strict=True)),
            **dict(zip(("rollspeed", "pitchspeed", "yawspeed"), rates, strict=True)),
            pose_covariance=_triangle(pose),
            # The rates are those of the gyros; no receiver uses a variance of them.
            velocity_covariance=_triangle([*velocity, *[math.nan] * 3]),
            reset_counter=estimate.reset_counter,
            estimator_type=_ESTIMATOR_VIO,
            quality=quality(estimate),
        )
        return self._pack(message)


def quality(estimate: Estimate) -> int:
    """Quality of ODOMETRY: 100, 67, 34 for three, two, one axes by the beams, 17 by the water alone, 1 by neither."""
    if estimate.state == "WATER":
        return 17
    return 1 + 33 * estimate.rank


def _single(values: Floats) -> list[float]:
    return [single_at_least(value) for value in values.tolist()]


def _triangle(diagonal: list[float]) -> list[float]:
    """Upper triangle (21,) of a diagonal 6 x 6 matrix; NaN first for an unknown one, as the definition asks."""
    triangle = [0.0] * 21
    for place, value in zip(_DIAGONAL, diagonal, strict=True):
        triangle[place] = value
    return triangle
