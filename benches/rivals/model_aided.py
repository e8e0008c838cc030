"""INS aided by a kinetic model of the vehicle, with the sea current estimated.

Source: Ø. Hegrenæs and O. Hallingstad, "Model-Aided INS With Sea Current Estimation for Robust Underwater
Navigation", IEEE J. Oceanic Engineering 36 (2011) 316. The model's velocity through the water is a measurement, each
second, of the INS's velocity less the current. The current, north and east, and the model's error are states, each a
first-order Markov process, beside those of the beam-level EKF; beams come in as they return.

A mission has no record of fins and shaft. With `estimate_with_controls` they are given, as in the paper. `estimate`
does without: the fins follow from what the gyros show, and the shaft is at the trim of the speed at the start.
"""

import zlib

import numpy as np
from numpy.typing import NDArray

from benches.rivals import rotations
from benches.rivals.error_state import ErrorStateFilter, run
from benches.rivals.kinetic_model import Controls, KineticModel, perturbed
from benches.rivals.sensors import Measurement
from benches.rivals.state import VELOCITY, State, velocity_rows
from benches.rivals.strapdown import Increment, Motion
from benches.rivals.timeline import Stretch
from bottomlock.errors import DataError
from bottomlock.plant import Vehicle, load_vehicle
from bottomlock.plant.trim import trim
from partialdvl_bench.mission import Estimates, Mission

Floats = NDArray[np.float64]

COEFFICIENT_SD = 0.1
"""How wrong the model's coefficients are, 1 sigma; the draw is that of the mission's name."""
MODEL_SD_MPS = np.array([0.15, 0.05, 0.05])
"""Of the model's velocity with known commands, 1 sigma: surge is off by half of what drag and thrust are, of 2 m/s."""
UNKNOWN_SHAFT_SD_MPS = 0.3
"""More of it in surge where the shaft is not known: the current's 1 sigma, which the controller makes up for."""
MODEL_TIME_S = 300.0
MODEL_NOISE_MPS = 0.02
EVERY_S = 1.0
VEHICLES = ("tauv", "remus100")
HOVERING = ("bluerov2_heavy",)
FURTHER = 5
"""Current north and east, and the model's error in platform axes."""


class ModelAidedFilter(ErrorStateFilter):
    """The beam-level EKF with the model's velocity as a measurement."""

    def __init__(self, mission: Mission, vehicle: Vehicle, controls: Controls | None) -> None:
        super().__init__(mission, further_states=FURTHER)
        # The model gives a velocity from the start on.
        self.held.waits = False
        gravity = mission.model.environment.gravity_mps2
        wrong = perturbed(vehicle, COEFFICIENT_SD, zlib.crc32(mission.name.encode()))
        self.controls, self.model = controls, KineticModel(wrong, gravity, mission.start.velocity_p_mps)
        self.time_s = self.since_s = 0.0
        # Speed through the water goes with the shaft's, so a trim at cruise tells that at the speed of the start.
        cruise = vehicle.limits.cruise_speed
        held = trim(vehicle, cruise, gravity)
        speed = float(
            np.clip(mission.start.velocity_p_mps[0], vehicle.limits.min_speed, vehicle.limits.max_speed)
        )
        self.shaft_rps, self.model.modes_rad = held.shaft_rps * speed / cruise, np.array(held.modes_rad)
        self.model_sd = MODEL_SD_MPS.copy()
        if controls is None:
            self.model_sd[0] = float(np.hypot(self.model_sd[0], UNKNOWN_SHAFT_SD_MPS))
        water = mission.options.water
        self.further_sd = np.array([water.current_sd_mps, water.current_sd_mps, *self.model_sd])
        self.further_time_s = np.array([water.current_time_s] * 2 + [MODEL_TIME_S] * 3)
        others = self.layout.others
        self.covariance[others, others] = np.diag(self.further_sd**2)
        self.before_radps: Floats | None = None

    def predict(self, stretch: Stretch) -> None:
        """The model moves with the navigation's rates and attitude."""
        super().predict(stretch)
        if len(stretch.step_s) == 0:
            return
        duration = stretch.duration_s
        decay = np.exp(-duration / self.further_time_s)
        sensors = self.state.sensors.copy()
        others = self.layout.others
        sensors[others.start - 9 : others.stop - 9] *= decay
        self.state = State(self.state.motion, sensors, self.state.beams)
        omega = stretch.step_s @ stretch.omega_p_radps / duration - self.state.gyro_bias
        attitude = rotations.quaternion(self.state.motion.rotation)
        self.time_s += duration
        self.since_s += duration
        if self.controls is not None:
            fins, shaft = self.controls.at(self.mission.start.time_ns + round(1e9 * self.time_s))
        else:
            alpha = np.zeros(3) if self.before_radps is None else (omega - self.before_radps) / duration
            shaft = self.shaft_rps
            fins = self.model.fins_that_turn(attitude, omega, alpha, shaft)
        self.before_radps = omega
        self.model.advance(attitude, omega, fins, shaft, duration)
        if self.since_s >= EVERY_S - 1e-6:
            self.since_s = 0.0
            self.update("model", self.model_velocity())

    def model_velocity(self) -> Measurement:
        """U = Rᵀ (v − c) + e."""

        def through_water(state: State) -> State:
            current = np.zeros_like(state.motion.velocity_t_mps)
            current[..., :2] = state.states(self.layout.others)[..., :2]
            motion = state.motion
            moving = Motion(motion.rotation, motion.velocity_t_mps - current, motion.position_t_m)
            return state.with_motion(moving)

        def predict(state: State) -> Floats:
            return through_water(state).velocity_p_mps + state.states(self.layout.others)[..., 2:]

        def rows(state: State) -> Floats:
            out, first = velocity_rows(through_water(state)), self.layout.others.start
            out[:, first : first + 2] = -out[:, VELOCITY][:, :2]
            out[:, first + 2 : self.layout.others.stop] = np.eye(3)
            return out

        return Measurement(self.model.velocity_p_mps, predict, rows, MODEL_NOISE_MPS**2 * np.eye(3))

    def transition(self, increment: Increment, duration_s: float) -> Floats:
        """The further states decay."""
        phi, others = super().transition(increment, duration_s), self.layout.others
        phi[others, others] = np.diag(np.exp(-duration_s / self.further_time_s))
        return phi

    def process_noise(self, phi: Floats, duration_s: float) -> Floats:
        """What keeps the further states at their 1 sigma."""
        q, others = super().process_noise(phi, duration_s), self.layout.others
        q[others, others] = np.diag(self.further_sd**2 * -np.expm1(-2.0 * duration_s / self.further_time_s))
        return q

    def current(self) -> tuple[Floats, Floats]:
        """The current's states."""
        first = self.layout.others.start
        block = slice(first, first + 2)
        return self.state.sensors[first - 9 : first - 7].copy(), self.covariance[block, block].copy()


def estimate(mission: Mission) -> Estimates:
    """Without a record of fins and shaft; the vehicle is that with which the mission's name begins.

    The kinetic model is of a vehicle with fins: one with thrusters is navigated without, by the beam-level EKF alone.

    Raises:
        DataError: for a mission whose name begins with no packaged vehicle.
    """
    name = mission.name.split("-")[0]
    if name in HOVERING:
        return run(ErrorStateFilter(mission), mission)
    if name not in VEHICLES:
        raise DataError(
            f"mission {mission.name}: no packaged vehicle is called '{name}' ({', '.join(VEHICLES)});"
            " give one to estimate_with_controls"
        )
    vehicle = load_vehicle(name)
    if not isinstance(vehicle, Vehicle):
        raise DataError(f"mission {mission.name}: vehicle '{name}' has thrusters, the kinetic model has fins")
    return run(ModelAidedFilter(mission, vehicle, None), mission)


def estimate_with_controls(mission: Mission, vehicle: Vehicle, controls: Controls | None) -> Estimates:
    """As in the paper: with the fins and the shaft that the vehicle's controller knows."""
    return run(ModelAidedFilter(mission, vehicle, controls), mission)
