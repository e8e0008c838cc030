"""The lost velocity as the last one or a moving average, fed to a loosely coupled INS as if it were measured.

The baseline that learned regressors of lost beams are compared with, e.g. M. Yona and I. Klein, "MissBeamNet:
Learning Missing Doppler Velocity Log Beam Measurements", 2024. A velocity needs three beams; with fewer, the last
velocity that was solved (or the mean of the last few) takes its place. Its claimed covariance is that of a solved one
and a random walk since, with a rate from the steps between the velocities so far. Its error repeats from ping to
ping, which the filter does not know.
"""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from benches.rivals.error_state import ErrorStateFilter, run
from benches.rivals.sensors import Measurement, velocity_measurement
from benches.rivals.timeline import Positions, Stretch
from partialdvl_bench.mission import Estimates, Mission

Floats = NDArray[np.float64]

WINDOW = 5
"""Velocities in the moving average: five seconds; our choice, made before the first run."""


class VelocityMemory:
    """The last velocities that were solved, and how fast they walk."""

    def __init__(self, window: int, first_walk_m2ps3: float) -> None:
        self.velocities: deque[tuple[float, Floats]] = deque(maxlen=window)
        self.walk_m2ps3 = np.full(3, first_walk_m2ps3)
        self.steps = 0
        self.cov_m2ps2 = np.zeros((3, 3))

    def take(self, time_s: float, velocity_p_mps: Floats, cov_m2ps2: Floats) -> None:
        """Another velocity that was solved."""
        if self.velocities:
            before_s, before = self.velocities[-1]
            # The mean over all steps so far, the first guess being one of them.
            self.steps += 1
            rate = (velocity_p_mps - before) ** 2 / (time_s - before_s)
            self.walk_m2ps3 += (rate - self.walk_m2ps3) / (self.steps + 1)
        self.velocities.append((time_s, velocity_p_mps))
        self.cov_m2ps2 = cov_m2ps2

    def held(self, time_s: float) -> tuple[Floats, Floats] | None:
        """Mean of the window (3,), and its covariance at a time (3, 3); None before the first velocity."""
        if not self.velocities:
            return None
        age_s = time_s - float(np.mean([at for at, _ in self.velocities]))
        mean = np.mean([velocity for _, velocity in self.velocities], axis=0)
        return mean, self.cov_m2ps2 + np.diag(self.walk_m2ps3 * age_s)


def memory_at_start(mission: Mission, window: int) -> VelocityMemory:
    """Of the velocity that the mission begins with."""
    sd = np.array(mission.model.initial.velocity_sd_mps)
    memory = VelocityMemory(window, float(sd[0]) ** 2)
    memory.take(0.0, np.array(mission.start.velocity_p_mps, dtype=np.float64), np.diag(sd**2))
    return memory


class HeldVelocityFilter(ErrorStateFilter):
    """The loosely coupled EKF that takes the memory's velocity where the beams determine none."""

    def __init__(self, mission: Mission, window: int) -> None:
        super().__init__(mission, solved_velocity=True)
        self.held.waits = False
        self.memory = memory_at_start(mission, window)
        self.time_s = 0.0

    def predict(self, stretch: Stretch) -> None:
        """Keeps the time."""
        super().predict(stretch)
        self.time_s += stretch.duration_s

    def measurement(self, kind: str, value: Floats, positions: Positions | None) -> Measurement | None:
        """A solved velocity is remembered; without one, the memory's is used."""
        measured = super().measurement(kind, value, positions)
        if kind != "ping":
            return measured
        if measured is not None:
            self.memory.take(self.time_s, measured.value, measured.cov)
            return measured
        held = self.memory.held(self.time_s)
        return None if held is None else velocity_measurement(*held)


def estimate(mission: Mission) -> Estimates:
    """With the last velocity."""
    return run(HeldVelocityFilter(mission, 1), mission)


def estimate_moving_average(mission: Mission) -> Estimates:
    """With the mean of the last `WINDOW` velocities."""
    return run(HeldVelocityFilter(mission, WINDOW), mission)
