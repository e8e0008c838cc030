"""VISION_SPEED_ESTIMATE: ArduPilot's external navigation."""

import math

import numpy as np

from bottomlock.kernel.models import Positive
from bottomlock.ports.estimate import Estimate, Floats
from bottomlock.ports.mavlink import MavlinkVelocity
from bottomlock.ports.over_bound import scalar_bound, single_at_least
from bottomlock.recordings.rotation import matrix, skew


class VisionSpeedEstimate(MavlinkVelocity):
    """VISION_SPEED_ESTIMATE (103), north-east-down: ArduPilot's external navigation.

    Firmware since March 2026 makes one σ of the covariance, older firmware uses its own. The message holds σ² I with
    σ² the largest eigenvalue, so that the largest entry, the mean of the diagonal and its sum are no less than that.
    Mode navigation only: the rotation needs an attitude, and its error is part of the covariance.
    """

    name = "vision_speed_estimate"

    receiver_noise_mps: Positive | None = None
    """σ that the receiver uses whatever is sent (VISO_VEL_M_NSE of firmware that ignores the covariance): an estimate
    with a larger σ is not sent; None for firmware that uses the covariance"""

    def _tangent(self, estimate: Estimate) -> tuple[Floats, float]:
        """Velocity (3,) in tangent axes, and the bound of its covariance.

        δv_t = R δv_p - [v_t x] ρ, since R_true = Exp([ρ x]) R (docs/conventions.md).
        """
        assert estimate.attitude_t_p is not None
        assert estimate.navigation_covariance is not None
        turn = matrix(estimate.attitude_t_p)
        velocity = turn @ estimate.velocity_p_mps
        jacobian = np.hstack((-skew(velocity), turn))
        covariance = jacobian @ estimate.navigation_covariance[3:, 3:] @ jacobian.T * self.variance_factor
        return velocity, single_at_least(scalar_bound(0.5 * (covariance + covariance.T)))

    def _refuses(self, estimate: Estimate) -> str | None:
        if estimate.mode != "navigation":
            return "mode velocity has no attitude with a covariance, which north-east-down needs"
        sd = math.sqrt(self._tangent(estimate)[1])
        return self._above(sd, self.receiver_noise_mps)

    def _message(self, estimate: Estimate) -> bytes:
        velocity, variance = self._tangent(estimate)
        covariance = (np.eye(3) * variance).ravel().tolist()
        message = self._dialect.MAVLink_vision_speed_estimate_message(
            estimate.time_ns // 1000, *velocity.tolist(), covariance, estimate.reset_counter
        )
        return self._pack(message)
