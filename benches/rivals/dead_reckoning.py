"""Dead reckoning with DVL and attitude: gyros turn the attitude from the start on, the velocity is integrated.

The textbook's method, e.g. R. K. Brokloff, "Matrix Algorithm for Doppler Sonar Navigation", OCEANS 1994. With fewer
than three beams the last velocity, or a moving average, is held (`held_velocity`). Nothing is estimated but what is
integrated. The claimed covariance is a random walk: of the velocity between pings, and so of the position; and the
uncertain heading across the way from the start.
"""

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from benches.rivals import rotations
from benches.rivals.held_velocity import WINDOW, memory_at_start
from benches.rivals.sensors import Sensors
from benches.rivals.state import at_start
from benches.rivals.strapdown import Earth, Motion, advance
from benches.rivals.timeline import PERIOD_NS, Stretch, stops
from bottomlock.kernel.models import DvlModel
from partialdvl_bench.mission import Estimates, Mission

Floats = NDArray[np.float64]


class DeadReckoner:
    """Attitude, the velocity that is held, and the position."""

    period_ns = PERIOD_NS
    """The longest stretch that is advanced at once."""

    def __init__(self, mission: Mission, window: int) -> None:
        initial = mission.model.initial
        self.mission, self.sensors = mission, Sensors(mission)
        self.earth = Earth.of(mission.model.environment)
        self.start = at_start(mission, self.sensors.layout)
        self.rotation, self.position_t_m = self.start.motion.rotation, self.start.motion.position_t_m
        self.velocity_p_mps = np.array(mission.start.velocity_p_mps, dtype=np.float64)
        self.velocity_cov = np.diag(np.square(initial.velocity_sd_mps))
        self.walked_cov = np.diag(np.square(initial.position_sd_m))
        self.memory = memory_at_start(mission, window)
        self.omega_p_radps, self.time_s = np.zeros(3), 0.0

    def advance(self, stretch: Stretch) -> None:
        """Turns by the gyros, moves by the velocity that is held, at the attitude in the middle."""
        if len(stretch.step_s) == 0:
            return
        still, duration = Motion(self.rotation, np.zeros(3), np.zeros(3)), stretch.duration_s
        turned, increment = advance(still, stretch, self.earth, accel_bias=np.zeros(3), gyro_bias=np.zeros(3))
        self.position_t_m = self.position_t_m + increment.rotation_s @ self.velocity_p_mps
        self.rotation, self.omega_p_radps = turned.rotation, stretch.omega_p_radps[-1]
        self.time_s += duration
        walk = np.diag(self.memory.walk_m2ps3 * duration)
        self.velocity_cov = self.velocity_cov + walk
        # A velocity is held for about a second, and so is its error.
        self.walked_cov = self.walked_cov + self.rotation @ self.velocity_cov @ self.rotation.T * duration

    def measure(self, kind: str, value: Floats) -> None:
        """A reading; all but pings of the bottom are left out."""
        if kind == "ping":
            self.ping(value)

    def ping(self, beams_mps: Floats) -> None:
        """The velocity that the beams determine, or the one that is held."""
        solved = self.sensors.velocity(beams_mps, self.omega_p_radps)
        if solved is not None:
            # Less what the lever arms add: the prediction of a vehicle that turns on the spot.
            turning = solved.predict(self.start.with_motion(Motion(self.rotation, np.zeros(3), np.zeros(3))))
            self.velocity_p_mps = solved.value - turning
            self.velocity_cov = self._cov(solved.cov)
            self.memory.take(self.time_s, self.velocity_p_mps, self.velocity_cov)
            return
        held = self.memory.held(self.time_s)
        if held is not None:
            self.velocity_p_mps, self.velocity_cov = held

    def _cov(self, of_noise: Floats) -> Floats:
        """Of a solved velocity: the noise and the biases of the beams, and the scale factor along the velocity."""
        dvl, velocity = self.mission.model.of(DvlModel), self.velocity_p_mps
        biased = 1.0 + (dvl.beam_bias_sd_mps / dvl.beam_noise_sd_mps) ** 2
        return biased * of_noise + dvl.scale_factor_sd**2 * np.outer(velocity, velocity)

    def position_cov(self) -> Floats:
        """Random walk, and the uncertain heading across the way from the start; the gyros' bias acts on half of it."""
        imu, initial = self.mission.model.imu, self.mission.model.initial
        heading_var = (
            float(initial.attitude_sd_rad[2]) ** 2
            + (0.5 * imu.gyro_bias_sd_radps * self.time_s) ** 2
            + imu.gyro_noise_rad_rts**2 * self.time_s / 3.0
        )
        north, east, _ = self.position_t_m - self.start.motion.position_t_m
        across = np.array([-east, north, 0.0])
        return self.walked_cov + heading_var * np.outer(across, across)


def estimate(mission: Mission) -> Estimates:
    """Holds the last velocity where the beams determine none."""
    return dead_reckoned(mission, lambda: DeadReckoner(mission, window=1))


def estimate_moving_average(mission: Mission) -> Estimates:
    """Holds the mean of the last velocities where the beams determine none."""
    return dead_reckoned(mission, lambda: DeadReckoner(mission, window=WINDOW))


def dead_reckoned(mission: Mission, make: Callable[[], DeadReckoner]) -> Estimates:
    """Velocity, position and attitude at the grid's times."""
    began, reckoner = time.perf_counter(), make()
    rows = len(mission.grid_ns)
    velocity, position, attitude = np.empty((rows, 3)), np.empty((rows, 3)), np.empty((rows, 4))
    velocity_cov, position_cov = np.empty((rows, 3, 3)), np.empty((rows, 3, 3))
    for stop in stops(mission, period_ns=reckoner.period_ns):
        reckoner.advance(stop.stretch)
        for kind, value in stop.readings:
            reckoner.measure(kind, value)
        if stop.grid_row is None:
            continue
        row = stop.grid_row
        velocity[row], velocity_cov[row] = reckoner.velocity_p_mps, reckoner.velocity_cov
        position[row], position_cov[row] = reckoner.position_t_m, reckoner.position_cov()
        attitude[row] = rotations.quaternion(reckoner.rotation)
    return Estimates(
        time_ns=mission.grid_ns,
        velocity_p_mps=velocity,
        velocity_cov=velocity_cov,
        position_t_m=position,
        position_cov=position_cov,
        attitude_t_p=attitude,
        wall_s=time.perf_counter() - began,
    )
