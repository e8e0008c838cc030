"""The vector UKF of rock-slam: velocities solved from beams, two layers of current, a bias of the profiler.

Source: S. Arnold and L. Medagoda, "Robust Model-Aided Inertial Localization for Autonomous Underwater Vehicles", ICRA
2018; their filter `PoseUKF` (rock-slam/slam-uwv_kalman_filters and its task, BSD-3), read and written anew:

- a cell of the water with weight w, its depth below the vehicle over that of the profile, is
  Rᵀ of (1 − w)(v − c) + w (v − c_below), and a bias, on the two level axes of the vehicle;
- c' = −c/τ for both layers, with noise 2σ²/τ and κ (v_x² + v_y² + (10 v_z)²), κ = scale · dt² at their IMU's step dt;
- a cell beyond 95 % of its two degrees of freedom is left out, other readings are not tested.

Not in it: the rows of forces with inertia and drag as states. A mission has no record of forces, and they too depend on
v − Rᵀc alone, which the water's beams measure (docs/observability.md#water-track). Acceleration, gravity and density of
the water are states there; here the inertial readings are integrated, as by all rivals.
"""

import numpy as np
from numpy.typing import NDArray

from benches.rivals import rotations
from benches.rivals.error_state import run
from benches.rivals.gate import Gate
from benches.rivals.sensors import Measurement
from benches.rivals.state import MISALIGNMENT, State
from benches.rivals.strapdown import Increment
from benches.rivals.timeline import Positions
from benches.rivals.unscented import UnscentedFilter
from partialdvl_bench.mission import Estimates, Mission

Floats = NDArray[np.float64]

ABOVE, BELOW, BIAS = slice(0, 2), slice(2, 4), slice(4, 6)
FURTHER = 6
LIMIT_MPS = 0.3
"""Long-term 1 sigma of the current, theirs to set: what the kernel's methods begin with."""
TIME_S = 21_600.0
"""Of the current, theirs to set: a quarter of a tide."""
SCALE, STEP_S = 1e-3, 0.01
"""Their example, 0.1 m/s in 100 m, and an IMU of 100 Hz: variance a second SCALE · STEP_S² · speed²."""
VERTICAL = 10.0
"""A change of depth counts as a way ten times as long."""
BIAS_SD_MPS, BIAS_TIME_S = 0.01, 3600.0
"""Of the profiler, theirs to set: a quarter of what the currents of single ensembles scatter by, for an hour."""
PROFILE_M = 30.0
"""Depth of their profile below the vehicle: the reach of an instrument of 600 kHz."""
GATE_95 = 5.991


class _OnlyWater(Gate):
    """Tests the two rows of a cell together and nothing else."""

    def passes(self, kind: str, innovation: Floats, variance: Floats) -> NDArray[np.bool_]:
        """All rows or none; correlations between the two are left to the noise."""
        good = kind != "water" or bool((innovation**2 / variance).sum() <= GATE_95)
        return np.full(len(innovation), good)


class PoseUkf(UnscentedFilter):
    """The unscented filter with their states of the water; flown from reading to reading."""

    period_ns = 10_000_000_000

    def __init__(self, mission: Mission) -> None:
        super().__init__(mission, solved_velocity=True, further_states=FURTHER)
        self.gate = _OnlyWater(mission.options)
        self.limit = np.array([LIMIT_MPS] * 4 + [BIAS_SD_MPS] * 2)
        self.time_s = np.array([TIME_S] * 4 + [BIAS_TIME_S] * 2)
        others = self.layout.others
        self.covariance[others, others] = np.diag(self.limit**2)

    def transition(self, increment: Increment, duration_s: float) -> Floats:
        """Currents and bias decay."""
        phi, others = super().transition(increment, duration_s), self.layout.others
        phi[others, others] = np.diag(np.exp(-duration_s / self.time_s))
        return phi

    def process_noise(self, phi: Floats, duration_s: float) -> Floats:
        """With the way made, of currents alone."""
        q, others = super().process_noise(phi, duration_s), self.layout.others
        way = self.state.motion.velocity_t_mps * [1.0, 1.0, VERTICAL]
        further = 2.0 * self.limit**2 / self.time_s
        further[:4] += SCALE * STEP_S**2 * float(way @ way)
        q[others, others] = np.diag(further * duration_s)
        return q

    def measurement(self, kind: str, value: Floats, positions: Positions | None) -> Measurement | None:
        """A cell of the water beside what all rivals read."""
        return self.cell(*value) if kind == "water" else super().measurement(kind, value, positions)

    def cell(self, beams_mps: Floats, sd_mps: Floats, range_m: Floats) -> Measurement | None:
        """Two level components of a cell; None where the beams that returned do not determine a velocity."""
        solved = self.sensors.velocity(beams_mps, self.omega_p_radps)
        if solved is None:
            return None
        kept = np.isfinite(beams_mps)
        directions = self.sensors.directions[kept]
        solve = np.linalg.pinv(directions)[:2]
        below_m = float(np.mean(range_m[kept] * directions[:, 2]))
        weight = min(max(below_m / PROFILE_M, 0.0), 1.0)

        def mean_t(state: State) -> Floats:
            water = state.states(self.layout.others)
            mean = (1.0 - weight) * water[..., ABOVE] + weight * water[..., BELOW]
            level: Floats = np.concatenate([mean, np.zeros_like(mean[..., :1])], axis=-1)
            return level

        def predict(state: State) -> Floats:
            along = np.einsum("...ji,...j->...i", state.motion.rotation, mean_t(state))
            bias = state.states(self.layout.others)[..., BIAS]
            found: Floats = (solved.predict(state) - along)[..., :2] + bias
            return found

        def rows(state: State) -> Floats:
            out, first, to_body = solved.jacobian(state), self.layout.others.start, state.motion.rotation.T
            out[:, MISALIGNMENT] -= to_body @ rotations.skew(mean_t(state))
            out[:, first : first + 2] = -(1.0 - weight) * to_body[:, :2]
            out[:, first + 2 : first + 4] = -weight * to_body[:, :2]
            out[:2, first + 4 : first + 6] = np.eye(2)
            return out[:2]

        return Measurement(solved.value[:2], predict, rows, (solve * sd_mps[kept] ** 2) @ solve.T)

    def current(self) -> tuple[Floats, Floats]:
        """That at the vehicle."""
        first = self.layout.others.start
        block = slice(first, first + 2)
        return self.state.sensors[first - 9 : first - 7].copy(), self.covariance[block, block].copy()


def estimate(mission: Mission) -> Estimates:
    """With the water where it returns."""
    return run(PoseUkf(mission), mission)
