"""The error-state Kalman filter, in any chart: predict, gate, update; and the loop along a mission.

With `Additive` it is the multiplicative EKF, with `RightInvariant` the invariant one. What a rival does otherwise it
overrides.
"""

import time
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from benches.rivals import rotations
from benches.rivals.gate import Gate
from benches.rivals.held_start import HeldStart
from benches.rivals.propagation import noise, transition
from benches.rivals.sensors import Measurement, Sensors, velocity_measurement
from benches.rivals.state import (
    POSITION,
    Additive,
    Chart,
    Layout,
    at_start,
    covariance_at_start,
    velocity_rows,
)
from benches.rivals.strapdown import Earth, Increment, advance
from benches.rivals.timeline import PERIOD_NS, Positions, Stretch, stops
from partialdvl_bench.mission import Estimates, Mission

Floats = NDArray[np.float64]


class ErrorStateFilter:
    """State, covariance in the chart's errors, and the operations on them."""

    period_ns = PERIOD_NS
    """The longest stretch that is predicted at once."""

    def __init__(
        self,
        mission: Mission,
        chart: Chart | None = None,
        *,
        solved_velocity: bool = False,
        further_states: int = 0,
    ) -> None:
        self.mission, self.chart = mission, chart or Additive()
        self.solved_velocity = solved_velocity
        self.layout = Layout.of(mission, further_states)
        self.earth, self.sensors = Earth.of(mission.model.environment), Sensors(mission, self.layout)
        self.gate = Gate(mission.options)
        self.state = at_start(mission, self.layout)
        to_chart = np.linalg.inv(self.chart.additive(self.state))
        self.covariance: Floats = to_chart @ covariance_at_start(mission, self.layout) @ to_chart.T
        self.omega_p_radps = np.zeros(3)
        self.held, self.since_start_s = HeldStart(mission), 0.0

    def predict(self, stretch: Stretch) -> None:
        """Over a stretch of inertial samples."""
        if len(stretch.step_s) == 0:
            return
        before, duration = self.chart.additive(self.state), stretch.duration_s
        motion, increment = advance(
            self.state.motion,
            stretch,
            self.earth,
            accel_bias=self.state.accel_bias,
            gyro_bias=self.state.gyro_bias,
        )
        self.state = self.state.with_motion(motion)
        after = np.linalg.inv(self.chart.additive(self.state))
        phi = self.transition(increment, duration)
        q = self.process_noise(phi, duration)
        moved = after @ phi @ before
        self.covariance = moved @ self.covariance @ moved.T + after @ q @ after.T
        self.omega_p_radps = stretch.omega_p_radps[-1]
        self.since_start_s += stretch.duration_s

    def transition(self, increment: Increment, duration_s: float) -> Floats:
        """Of a stretch, in additive errors (n, n)."""
        return transition(self.layout, increment, duration_s, self.earth, self.mission.model)

    def process_noise(self, phi: Floats, duration_s: float) -> Floats:
        """Of a stretch, in additive errors (n, n)."""
        return noise(self.layout, phi, duration_s, self.mission.model)

    def measure(self, kind: str, value: Floats, positions: Positions | None) -> None:
        """The update with one reading."""
        measurement = self.measurement(kind, value, positions)
        if measurement is not None:
            self.update(kind, measurement)

    def measurement(self, kind: str, value: Floats, positions: Positions | None) -> Measurement | None:
        """A reading as the filter uses it; None for one that it cannot use."""
        if kind == "ping":
            if self.held.holds(np.isfinite(value)):
                return velocity_measurement(*self.held.velocity(self.since_start_s))
            solve = self.sensors.velocity if self.solved_velocity else self.sensors.beams
            return solve(value, self.omega_p_radps)
        if kind == "depth":
            return self.sensors.depth(value)
        if kind == "heading":
            return self.sensors.heading(value)
        if kind == "water":
            return None
        assert positions is not None
        return self.sensors.position(value, positions.sd_m)

    def update(self, kind: str, measurement: Measurement) -> None:
        """The update of the Kalman filter in the chart's errors, in Joseph's form."""
        innovation = measurement.innovation(measurement.predict(self.state))
        H = measurement.jacobian(self.state) @ self.chart.additive(self.state)
        S = H @ self.covariance @ H.T + measurement.cov
        keep = self.gate.passes(kind, innovation, np.diag(S))
        if not keep.any():
            return
        self.absorb(
            kind, innovation[keep], H[keep], S[np.ix_(keep, keep)], measurement.cov[np.ix_(keep, keep)]
        )

    def absorb(self, kind: str, innovation: Floats, H: Floats, S: Floats, R: Floats) -> None:
        """The update with rows that passed."""
        K = np.linalg.solve(S, H @ self.covariance).T
        self.correct(kind, K @ innovation)
        rest = np.eye(self.layout.size) - K @ H
        self.covariance = rest @ self.covariance @ rest.T + K @ R @ K.T

    def correct(self, _kind: str, correction: Floats) -> None:
        """Moves the state by the gain times the innovation (n,)."""
        self.state = self.chart.retract(self.state, correction)

    def current(self) -> tuple[Floats, Floats] | None:
        """The water's velocity, north and east (2,), and its covariance (2, 2); None where it is not estimated."""
        return None

    def additive_covariance(self) -> Floats:
        """Covariance (n, n) of the additive errors."""
        to_additive = self.chart.additive(self.state)
        out: Floats = to_additive @ self.covariance @ to_additive.T
        return out


def grid_rows(rival: ErrorStateFilter, mission: Mission, positions: Positions | None = None) -> Iterator[int]:
    """Flies the rival along the mission: its state stands at the row of the grid that is given, until it breaks."""
    for stop in stops(mission, positions, rival.period_ns):
        try:
            rival.predict(stop.stretch)
            for kind, value in stop.readings:
                rival.measure(kind, value, positions)
        except np.linalg.LinAlgError:
            return
        if stop.grid_row is not None:
            yield stop.grid_row


def run(rival: ErrorStateFilter, mission: Mission, positions: Positions | None = None) -> Estimates:
    """The rival along the mission; a filter that stops being finite answers NaN from there on."""
    began = time.perf_counter()
    rows = len(mission.grid_ns)
    velocity, position = np.full((rows, 3), np.nan), np.full((rows, 3), np.nan)
    velocity_cov, position_cov = np.full((rows, 3, 3), np.nan), np.full((rows, 3, 3), np.nan)
    attitude = np.full((rows, 4), np.nan)
    current, current_cov = np.full((rows, 2), np.nan), np.full((rows, 2, 2), np.nan)
    for row in grid_rows(rival, mission, positions):
        covariance, state = rival.additive_covariance(), rival.state
        if not np.isfinite(covariance).all():
            break
        rows_of_velocity = velocity_rows(state)
        velocity[row], position[row] = state.velocity_p_mps, state.motion.position_t_m
        velocity_cov[row] = rows_of_velocity @ covariance @ rows_of_velocity.T
        position_cov[row] = covariance[POSITION, POSITION]
        attitude[row] = rotations.quaternion(state.motion.rotation)
        water = rival.current()
        if water is not None:
            current[row], current_cov[row] = water
    return Estimates(
        time_ns=mission.grid_ns,
        velocity_p_mps=velocity,
        velocity_cov=velocity_cov,
        position_t_m=position,
        position_cov=position_cov,
        attitude_t_p=attitude,
        current_t_mps=None if rival.current() is None else current,
        current_cov=None if rival.current() is None else current_cov,
        wall_s=time.perf_counter() - began,
    )


def estimate(mission: Mission) -> Estimates:
    """The multiplicative EKF with a row for each beam: what the adaptive and the invariant filter are built on."""
    return run(ErrorStateFilter(mission), mission)
