"""The invariant filter with every update iterated: Gauss and Newton's method on the posterior.

Source: B. M. Bell and F. W. Cathey, "The Iterated Kalman Filter Update as a Gauss-Newton Method", IEEE Trans. Automatic
Control 38 (1993) 294. In the study of convergence, to tell what the sigma points gain from what an iteration does.
"""

import numpy as np

from benches.rivals.error_state import ErrorStateFilter, run
from benches.rivals.sensors import Measurement
from benches.rivals.state import RightInvariant
from partialdvl_bench.mission import Estimates, Mission

ITERATIONS = 4


class IteratedFilter(ErrorStateFilter):
    """Each update linearised anew where the one before ended; the gate sees the first."""

    def update(self, kind: str, measurement: Measurement) -> None:
        """The error about the prior after the last iteration is the correction."""
        prior, P = self.state, self.covariance
        correction, keep = np.zeros(self.layout.size), np.ones(len(measurement.value), dtype=bool)
        for iteration in range(ITERATIONS):
            state = self.chart.retract(prior, correction)
            innovation = measurement.innovation(measurement.predict(state))
            H = measurement.jacobian(state) @ self.chart.additive(state)
            S = H @ P @ H.T + measurement.cov
            if iteration == 0:
                keep = self.gate.passes(kind, innovation, np.diag(S))
                if not keep.any():
                    return
            H, S = H[keep], S[np.ix_(keep, keep)]
            K = np.linalg.solve(S, H @ P).T
            correction = K @ (innovation[keep] + H @ correction)
        self.correct(kind, correction)
        rest = np.eye(self.layout.size) - K @ H
        R = measurement.cov[np.ix_(keep, keep)]
        self.covariance = rest @ P @ rest.T + K @ R @ K.T


def estimate(mission: Mission) -> Estimates:
    """In right-invariant errors, with a row for each beam."""
    return run(IteratedFilter(mission, RightInvariant()), mission)
