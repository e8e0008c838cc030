"""The beam-level EKF with tests of single beams and a heavy-tailed update, as our filters treat outliers.

Closure of redundant beams and Baarda's test of each beam (W. Baarda, "A Testing Procedure for Use in Geodetic
Networks", 1968), then noise of Student's t with a weight for each beam (G. Agamennoni, J. I. Nieto and E. M. Nebot,
"Approximate Inference in State-Space Models With Heavy-Tailed Noise", IEEE Trans. Signal Processing 60 (2012) 5024).
Probabilities and degrees of freedom are those of the mission's options. Written from docs/robust.md, with none of the
kernel.

What the kernel does beyond it, it does not: five sigma of beams that were accepted before, and the error that a
rejection has to agree on (docs/robust.md, bursts of wrong beams). After five pings that are rejected whole, the next is
taken, with its weights.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space
from scipy.stats import chi2

from benches.rivals.error_state import ErrorStateFilter, run
from benches.rivals.gate import Gate
from benches.rivals.sensors import Measurement
from benches.rivals.timeline import Positions
from bottomlock.kernel.models import Robust
from partialdvl_bench.mission import Estimates, Mission

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

ITERATIONS = 500
STANDSTILL = 1e-9
"""Relative change of a weight below which the weights have converged."""


def screened(
    innovation: Floats, S: Floats, directions: Floats, *, closure_gate: float | None, beam_gate: float | None
) -> Flags:
    """Which beams (m,) are left: while a test fails, the beam with the largest w² is removed.

    Args:
        innovation: of the beams (m,), m/s.
        S: its covariance (m, m).
        directions: of the beams (m, 3).
        closure_gate: probability with which the closure of a good ping passes; None for no test.
        beam_gate: probability with which a good beam passes; None for no test.
    """
    keep = np.ones(len(innovation), dtype=np.bool_)
    while keep.any():
        z, cov = innovation[keep], S[np.ix_(keep, keep)]
        information = np.linalg.inv(cov)
        w2 = (information @ z) ** 2 / np.diag(information)
        redundant = null_space(directions[keep].T)
        closure, degrees = redundant.T @ z, redundant.shape[1]
        fails = beam_gate is not None and bool((w2 > chi2.ppf(beam_gate, 1)).any())
        if closure_gate is not None and degrees:
            size = closure @ np.linalg.solve(redundant.T @ cov @ redundant, closure)
            fails = fails or bool(size > chi2.ppf(closure_gate, degrees))
        if not fails:
            break
        keep[np.flatnonzero(keep)[int(np.argmax(w2))]] = False
    return keep


def student_t_variance(innovation: Floats, hph: Floats, variance: Floats, degrees: float) -> Floats:
    """Variances D/w (m,) of beams with Student's noise, whose scale squared is `variance` (m,).

    w = (ν + 1)/(ν + E[n²]/D), iterated with the update; D is the variance times (ν + 3)/(ν + 1).
    """
    spread = variance * (degrees + 3.0) / (degrees + 1.0)
    weights = np.ones(len(innovation))
    for _ in range(ITERATIONS):
        R = spread / weights
        information = np.linalg.inv(hph + np.diag(R))
        noise = R * (information @ innovation)
        square = noise**2 + R - R**2 * np.diag(information)
        before, weights = weights, (degrees + 1.0) / (degrees + square / spread)
        if np.abs(weights / before - 1.0).max() < STANDSTILL:
            break
    out: Floats = spread / weights
    return out


class RobustFilter(ErrorStateFilter):
    """The beam-level EKF whose pings are screened and weighted."""

    def __init__(self, mission: Mission) -> None:
        super().__init__(mission)
        self.robust = mission.options.robust or Robust()
        self.returned: Flags = np.zeros(mission.geometry.beams, dtype=np.bool_)
        self.rejected = 0

    def measurement(self, kind: str, value: Floats, positions: Positions | None) -> Measurement | None:
        """Notes which beams the rows are of."""
        if kind == "ping":
            self.returned = np.isfinite(value)
        return super().measurement(kind, value, positions)

    def update(self, kind: str, measurement: Measurement) -> None:
        """Of a ping the beams that are left, each with the variance of its weight."""
        if kind != "ping" or not self.returned.any():
            super().update(kind, measurement)
            return
        innovation = measurement.innovation(measurement.predict(self.state))
        H = measurement.jacobian(self.state) @ self.chart.additive(self.state)
        hph = H @ self.covariance @ H.T
        keep = screened(
            innovation,
            hph + measurement.cov,
            self.sensors.directions[self.returned],
            closure_gate=self.robust.closure_gate,
            beam_gate=self.robust.beam_gate,
        )
        self.rejected = 0 if keep.any() else self.rejected + 1
        if self.rejected > Gate.REJECTIONS:
            keep[:] = True
        if not keep.any():
            return
        innovation, H, hph = innovation[keep], H[keep], hph[np.ix_(keep, keep)]
        variance = student_t_variance(
            innovation, hph, np.diag(measurement.cov)[keep], self.robust.student_t_degrees
        )
        R = np.diag(variance)
        self.absorb(kind, innovation, H, hph + R, R)


def estimate(mission: Mission) -> Estimates:
    """With a row for each beam that is left."""
    return run(RobustFilter(mission), mission)
