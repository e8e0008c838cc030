"""VISION_POSITION_DELTA: ArduPilot's body-frame odometry."""

import math
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, model_validator

from bottomlock.kernel.models import Positive
from bottomlock.ports.estimate import Estimate, Floats
from bottomlock.ports.mavlink import MavlinkVelocity
from bottomlock.ports.over_bound import scalar_bound
from bottomlock.ports.port import incomplete
from bottomlock.recordings.rotation import rotation_vector
from bottomlock.units import ns_from_s

# Above the rounding of the confidence and of the autopilot's arithmetic, both in 32-bit floats.
_GUARD = 1e-6


class VisionPositionDelta(MavlinkVelocity):
    """VISION_POSITION_DELTA (11011), body axes: ArduPilot's body-frame odometry, as the makers of DVLs feed it.

    The autopilot divides the position delta by the interval, and takes one σ for all axes from the confidence,
    σ = min + (max - min) (1 - confidence / 100). It fuses a confidence of 0 with σ = max, so an estimate with a larger
    σ is not sent at all. The stamp is not used; it is the end of the interval.

    In mode velocity the delta is the velocity of the ping times the interval since the ping before. In mode navigation
    it is the integral of the estimates given since the last message, and σ the largest among them: errors within the
    interval are alike, and the σ of a mean is at most the largest of its parts.
    """

    name = "vision_position_delta"

    min_noise_mps: Positive = 0.1
    """EK3_VIS_VERR_MIN of the autopilot"""
    max_noise_mps: Positive = 0.9
    """EK3_VIS_VERR_MAX of the autopilot"""
    max_interval_s: Annotated[float, Field(gt=0, le=1e6)] = 2.0
    """a longer gap between estimates starts a new interval without a message"""

    @model_validator(mode="after")
    def _noise_has_a_range(self) -> Self:
        if self.max_noise_mps <= self.min_noise_mps:
            raise self.wrong("max_noise_mps", f"> min_noise_mps, {self.min_noise_mps}")
        return self

    def model_post_init(self, _context: Any, /) -> None:  # noqa: ANN401 - pydantic's
        """Begins without an interval."""
        super().model_post_init(_context)
        self._gap_ns = ns_from_s(self.max_interval_s)
        self._start: Estimate | None = None
        self._previous: Estimate | None = None
        self._delta_m = np.zeros(3)
        self._largest_m2ps2 = 0.0

    def confidence(self, sd_mps: float) -> float:
        """Confidence for which the autopilot takes no smaller σ than this; negative if there is none."""
        if sd_mps <= self.min_noise_mps * (1.0 - _GUARD):
            return 100.0
        return 100.0 * (
            1.0
            - (sd_mps - self.min_noise_mps + self.max_noise_mps * _GUARD)
            / (self.max_noise_mps - self.min_noise_mps)
        )

    def _refuses(self, estimate: Estimate) -> str | None:
        if reason := incomplete(estimate):
            return reason
        sd = math.sqrt(self._scalar(estimate))
        if self.confidence(sd) < 0.0:
            most = self.max_noise_mps
            return f"σ is {sd:.3f} m/s, above max_noise_mps, {most}: the autopilot would use that smaller one"
        return None

    def _waits(self, estimate: Estimate) -> str | None:
        if not self._goes_on(estimate):
            return "no interval yet: the first estimate, or the first after a gap or a reset"
        return super()._waits(estimate)

    def _goes_on(self, estimate: Estimate) -> bool:
        """Whether an interval from the estimate before to this one is part of a message."""
        before = self._previous
        return (
            before is not None
            and estimate.time_ns - before.time_ns <= self._gap_ns
            and estimate.reset_counter == before.reset_counter
            and estimate.mode == before.mode
        )

    def _interval(self, estimate: Estimate) -> tuple[Floats, float]:
        """Position delta and largest variance of the interval that ends with this estimate."""
        before = self._previous
        assert before is not None
        step_s = (estimate.time_ns - before.time_ns) / 1e9
        if estimate.mode == "velocity":
            return estimate.velocity_p_mps * step_s, self._scalar(estimate)
        mean = 0.5 * (before.velocity_p_mps + estimate.velocity_p_mps)
        return self._delta_m + mean * step_s, max(self._largest_m2ps2, self._scalar(estimate))

    def _message(self, estimate: Estimate) -> bytes:
        delta, variance = self._interval(estimate)
        start = self._previous if estimate.mode == "velocity" else self._start
        assert start is not None
        turn = np.zeros(3)
        if start.attitude_t_p is not None and estimate.attitude_t_p is not None:
            turn = rotation_vector(start.attitude_t_p, estimate.attitude_t_p)
        message = self._dialect.MAVLink_vision_position_delta_message(
            estimate.time_ns // 1000,
            estimate.time_ns // 1000 - start.time_ns // 1000,
            turn.tolist(),
            delta.tolist(),
            self.confidence(math.sqrt(variance)),
        )
        return self._pack(message)

    def _observe(self, estimate: Estimate, *, sent: bool) -> None:
        if not estimate.complete or self._refusal(estimate) is not None:
            self._start = self._previous = None
            return
        if sent or not self._goes_on(estimate):
            self._start, self._delta_m = estimate, np.zeros(3)
            self._largest_m2ps2 = self._scalar(estimate)
        else:
            self._delta_m, self._largest_m2ps2 = self._interval(estimate)
        self._previous = estimate

    def _scalar(self, estimate: Estimate) -> float:
        return scalar_bound(self._covariance(estimate))
