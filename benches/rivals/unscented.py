"""The unscented filter on the manifold, with a row for each beam.

Sources: S. J. Julier and J. K. Uhlmann, "Unscented Filtering and Nonlinear Estimation", Proc. IEEE 92 (2004) 401; on
manifolds, M. Brossard, A. Barrau and S. Bonnabel, "A Code for Unscented Kalman Filtering on Manifolds (UKF-M)", 2020.
Sigma points are drawn in a chart, flown by the strapdown, and measured; the process noise is added. What is kept up
of libraries takes vectors alone: an average of quaternions as vectors is no attitude.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benches.rivals.error_state import ErrorStateFilter, run
from benches.rivals.sensors import Measurement
from benches.rivals.state import Chart, RightInvariant, State
from benches.rivals.strapdown import Increment, Motion, advance
from benches.rivals.timeline import Stretch
from partialdvl_bench.mission import Estimates, Mission

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SigmaPoints:
    """Offsets (2n + 1, n) of zero mean, and their weights (2n + 1,) for means and for covariances.

    The points lie √3 standard deviations out, where the fourth moment of a normal distribution is met (Julier and
    Uhlmann: n + κ = 3); β = 2 is theirs for a normal distribution.
    """

    offsets: Floats
    mean: Floats
    cov: Floats

    SPREAD = 3.0
    BETA = 2.0

    @classmethod
    def of(cls, covariance: Floats) -> "SigmaPoints":
        """Of a covariance (n, n) that may have rows of zeros.

        Raises:
            numpy.linalg.LinAlgError: for a covariance that is not positive.
        """
        size = len(covariance)
        alive = np.diag(covariance) > 0.0
        root = np.zeros((size, size))
        root[np.ix_(alive, alive)] = np.linalg.cholesky(covariance[np.ix_(alive, alive)])
        columns = np.sqrt(cls.SPREAD) * root.T
        weight = 0.5 / cls.SPREAD
        mean = np.full(2 * size + 1, weight)
        mean[0] = 1.0 - size / cls.SPREAD
        cov = mean.copy()
        cov[0] += 1.0 - cls.SPREAD / size + cls.BETA
        return cls(np.concatenate([np.zeros((1, size)), columns, -columns]), mean, cov)


def moments(points: SigmaPoints, values: Floats, cross: Floats | None = None) -> tuple[Floats, Floats]:
    """Mean (m,) of values (2n + 1, m), and their covariance (m, m), or that with `cross` (2n + 1, k), as (k, m)."""
    mean: Floats = points.mean @ values
    other = values - mean if cross is None else cross
    cov: Floats = (points.cov[:, None] * other).T @ (values - mean)
    return mean, cov


class UnscentedFilter(ErrorStateFilter):
    """The filter's loop and sensors with sigma points in place of Jacobians.

    Sigma points need no short steps: they are flown from measurement to measurement, a second at most.
    """

    period_ns = 1_000_000_000

    def __init__(
        self,
        mission: Mission,
        chart: Chart | None = None,
        *,
        solved_velocity: bool = False,
        further_states: int = 0,
    ) -> None:
        super().__init__(
            mission,
            chart or RightInvariant(),
            solved_velocity=solved_velocity,
            further_states=further_states,
        )

    def predict(self, stretch: Stretch) -> None:
        """Every point is flown; the mean is where the centre arrives, moved by the mean of the errors about it."""
        if len(stretch.step_s) == 0:
            return
        points = SigmaPoints.of(self.covariance)
        spread = self.chart.retract(self.state, points.offsets)
        motion, increment = advance(
            spread.motion, stretch, self.earth, accel_bias=spread.accel_bias, gyro_bias=spread.gyro_bias
        )
        sensors = spread.sensors.copy()
        centre = Increment(increment.velocity_t_mps[0], increment.position_t_m[0], increment.rotation_s[0])
        phi = self.transition(centre, stretch.duration_s)
        sensors *= np.diag(phi)[9:]
        flown = State(motion, sensors, spread.beams)
        middle = State(
            Motion(motion.rotation[0], motion.velocity_t_mps[0], motion.position_t_m[0]),
            sensors[0],
            spread.beams,
        )
        errors = self.chart.difference(middle, flown)
        mean, self.covariance = moments(points, errors)
        self.state = self.chart.retract(middle, mean)
        after = np.linalg.inv(self.chart.additive(self.state))
        q = self.process_noise(phi, stretch.duration_s)
        self.covariance = _symmetric(self.covariance + after @ q @ after.T)
        self.omega_p_radps = stretch.omega_p_radps[-1]
        self.since_start_s += stretch.duration_s

    def update(self, kind: str, measurement: Measurement) -> None:
        """The gain is the covariance of errors and predictions over that of the predictions."""
        points = SigmaPoints.of(self.covariance)
        predicted = measurement.predict(self.chart.retract(self.state, points.offsets))
        # An angle is averaged about the centre's.
        about = -measurement.innovation(predicted) + measurement.innovation(predicted[0])
        mean, S = moments(points, about)
        S += measurement.cov
        innovation = measurement.innovation(predicted[0] + mean)
        keep = self.gate.passes(kind, innovation, np.diag(S))
        if not keep.any():
            return
        _, cross = moments(points, about[:, keep], points.offsets)
        S = S[np.ix_(keep, keep)]
        K = np.linalg.solve(S, cross.T).T
        self.correct(kind, K @ innovation[keep])
        self.covariance = _symmetric(self.covariance - K @ S @ K.T)


def estimate(mission: Mission) -> Estimates:
    """With sigma points in right-invariant errors."""
    return run(UnscentedFilter(mission), mission)


def _symmetric(matrix: Floats) -> Floats:
    out: Floats = 0.5 * (matrix + matrix.T)
    return out
