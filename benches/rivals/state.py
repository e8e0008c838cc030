"""The state that the filters estimate, the order of its errors, and two sets of coordinates for them.

Errors are true minus estimate, and R = Exp([ρ ×]) R̂ with ρ in the tangent frame, as in the kernel
(docs/conventions.md); the velocity is in tangent axes here. A chart says how an error moves a state, and what a small
one is in additive errors.
"""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from benches.rivals import rotations
from benches.rivals.strapdown import Motion
from bottomlock.kernel.models import DepthModel, DvlModel, HeadingModel
from partialdvl_bench.mission import Mission

Floats = NDArray[np.float64]

POSITION, MISALIGNMENT, VELOCITY = slice(0, 3), slice(3, 6), slice(6, 9)
ACCEL_BIAS, GYRO_BIAS = slice(9, 12), slice(12, 15)
INERTIAL = 15


@dataclass(frozen=True)
class Layout:
    """Where the errors of the sensors stand: biases of the beams, the DVL's scale factor, bias of the depth sensor.

    After them come states that a filter has beside those, and last, where the model claims them, offset and walk of the
    heading sensor.
    """

    beams: int
    further: int = 0
    slow_heading: bool = False

    @classmethod
    def of(cls, mission: Mission, further: int = 0) -> "Layout":
        """For a mission's sensors."""
        heading = mission.model.heading
        slow = heading is not None and (heading.offset_sd_rad > 0.0 or heading.walk_sd_rad > 0.0)
        return cls(mission.geometry.beams, further, slow)

    @property
    def beam_bias(self) -> slice:
        """Biases of the beams."""
        return slice(INERTIAL, INERTIAL + self.beams)

    @property
    def scale_factor(self) -> int:
        """The DVL's scale factor."""
        return INERTIAL + self.beams

    @property
    def depth_bias(self) -> int:
        """Bias of the depth sensor."""
        return INERTIAL + self.beams + 1

    @property
    def size(self) -> int:
        """Number of errors."""
        return int(self.heading.stop)

    @property
    def others(self) -> slice:
        """The further states."""
        return slice(self.depth_bias + 1, self.depth_bias + 1 + self.further)

    @property
    def heading(self) -> slice:
        """Offset and walk of the heading sensor, or none."""
        return slice(self.others.stop, self.others.stop + 2 * self.slow_heading)


@dataclass(frozen=True, eq=False)
class State:
    """Motion, and the sensors' errors (..., n) in the order of the layout, from the accelerometers' biases on."""

    motion: Motion
    sensors: Floats
    beams: int

    @property
    def accel_bias(self) -> Floats:
        """Biases of the accelerometers (..., 3), m/s²."""
        return self.sensors[..., 0:3]

    @property
    def gyro_bias(self) -> Floats:
        """Biases of the gyros (..., 3), rad/s."""
        return self.sensors[..., 3:6]

    @property
    def beam_bias(self) -> Floats:
        """Biases of the beams (..., B), m/s."""
        return self.sensors[..., 6 : 6 + self.beams]

    @property
    def scale_factor(self) -> Floats:
        """The DVL's scale factor (...,)."""
        return self.sensors[..., 6 + self.beams]

    @property
    def depth_bias(self) -> Floats:
        """Bias of the depth sensor (...,), m."""
        return self.sensors[..., 7 + self.beams]

    def states(self, part: slice) -> Floats:
        """Sensors' errors and further states by their place in the layout (..., k)."""
        return self.sensors[..., part.start - 9 : part.stop - 9]

    @property
    def velocity_p_mps(self) -> Floats:
        """Velocity in platform axes (..., 3)."""
        out: Floats = np.einsum("...ji,...j->...i", self.motion.rotation, self.motion.velocity_t_mps)
        return out

    def with_motion(self, motion: Motion) -> "State":
        """The same errors of sensors with another motion."""
        return replace(self, motion=motion)


def at_start(mission: Mission, layout: Layout) -> State:
    """The state that a mission begins with; its sensors' errors are zero."""
    start = mission.start
    rotation = rotations.matrix(np.asarray(start.attitude_t_p, dtype=np.float64))
    motion = Motion(rotation, rotation @ start.velocity_p_mps, np.array(start.position_t_m, dtype=np.float64))
    return State(motion, np.zeros(layout.size - 9), layout.beams)


def covariance_at_start(mission: Mission, layout: Layout) -> Floats:
    """Covariance of the additive errors at the start, as the model claims it: of the velocity in platform axes."""
    model = mission.model
    sd = np.zeros(layout.size)
    sd[POSITION], sd[MISALIGNMENT] = model.initial.position_sd_m, model.initial.attitude_sd_rad
    sd[VELOCITY] = model.initial.velocity_sd_mps
    sd[ACCEL_BIAS], sd[GYRO_BIAS] = model.imu.accel_bias_sd_mps2, model.imu.gyro_bias_sd_radps
    if mission.options.estimate_dvl:
        dvl = model.of(DvlModel)
        sd[layout.beam_bias], sd[layout.scale_factor] = dvl.beam_bias_sd_mps, dvl.scale_factor_sd
    sd[layout.depth_bias] = model.of(DepthModel).bias_sd_m
    if layout.slow_heading:
        sd[layout.heading] = model.of(HeadingModel).offset_sd_rad, model.of(HeadingModel).walk_sd_rad
    # v_t = R v_p: the error of the attitude at the start turns the velocity, too (δv_t = R δv_p − [v_t ×] ρ).
    state = at_start(mission, layout)
    to_tangent = np.eye(layout.size)
    to_tangent[VELOCITY, VELOCITY] = state.motion.rotation
    to_tangent[VELOCITY, MISALIGNMENT] = -rotations.skew(state.motion.velocity_t_mps)
    out: Floats = to_tangent @ np.diag(sd**2) @ to_tangent.T
    return out


def velocity_rows(state: State) -> Floats:
    """Rows (3, n) of the velocity in platform axes in additive errors: δv_p = Rᵀ (δv + [v ×] ρ)."""
    rows = np.zeros((3, 9 + state.sensors.shape[-1]))
    transposed = state.motion.rotation.T
    rows[:, VELOCITY] = transposed
    rows[:, MISALIGNMENT] = transposed @ rotations.skew(state.motion.velocity_t_mps)
    return rows


class Chart(Protocol):
    """Coordinates of the error about a state."""

    def retract(self, state: State, error: Floats) -> State:
        """The state moved by an error (..., n)."""

    def difference(self, state: State, other: State) -> Floats:
        """The error (..., n) that moves `state` to `other`."""

    def additive(self, state: State) -> Floats:
        """The matrix (n, n) that takes a small error in this chart to an additive one."""


class Additive:
    """Errors of position, attitude and velocity each by itself: the multiplicative EKF of the textbooks."""

    def retract(self, state: State, error: Floats) -> State:
        """Adds; the attitude is turned."""
        motion = state.motion
        return State(
            Motion(
                rotations.exp(error[..., MISALIGNMENT]) @ motion.rotation,
                motion.velocity_t_mps + error[..., VELOCITY],
                motion.position_t_m + error[..., POSITION],
            ),
            state.sensors + error[..., 9:],
            state.beams,
        )

    def difference(self, state: State, other: State) -> Floats:
        """Subtracts; of the attitudes the rotation vector between."""
        mine, yours = state.motion, other.motion
        turned = yours.rotation @ np.swapaxes(mine.rotation, -1, -2)
        return np.concatenate(
            [
                yours.position_t_m - mine.position_t_m,
                rotations.log(turned),
                yours.velocity_t_mps - mine.velocity_t_mps,
                other.sensors - state.sensors,
            ],
            axis=-1,
        )

    def additive(self, state: State) -> Floats:
        """The identity."""
        return np.eye(9 + state.sensors.shape[-1])


class RightInvariant:
    """Errors of attitude, velocity and position as one element of SE₂(3), (R, v, p) = Exp(ξ) (R̂, v̂, p̂).

    Biases are added. Source: Barrau and Bonnabel 2017; with DVL and depth, Potokar, Norman and Mangelson 2021.
    """

    def retract(self, state: State, error: Floats) -> State:
        """Turns and shifts attitude, velocity and position together."""
        motion, misalignment = state.motion, error[..., MISALIGNMENT]
        turn, spread = rotations.exp(misalignment), rotations.left_jacobian(misalignment)
        return State(
            Motion(
                turn @ motion.rotation,
                _apply(turn, motion.velocity_t_mps) + _apply(spread, error[..., VELOCITY]),
                _apply(turn, motion.position_t_m) + _apply(spread, error[..., POSITION]),
            ),
            state.sensors + error[..., 9:],
            state.beams,
        )

    def difference(self, state: State, other: State) -> Floats:
        """The logarithm of the one over the other."""
        mine, yours = state.motion, other.motion
        turn = yours.rotation @ np.swapaxes(mine.rotation, -1, -2)
        misalignment = rotations.log(turn)
        spread = rotations.left_jacobian(misalignment)

        def part(of_other: Floats, of_mine: Floats) -> Floats:
            solved = np.linalg.solve(spread, (of_other - _apply(turn, of_mine))[..., None])
            return np.asarray(solved[..., 0], dtype=np.float64)

        return np.concatenate(
            [
                part(yours.position_t_m, mine.position_t_m),
                misalignment,
                part(yours.velocity_t_mps, mine.velocity_t_mps),
                other.sensors - state.sensors,
            ],
            axis=-1,
        )

    def additive(self, state: State) -> Floats:
        """δv = ν − [v ×] ρ and δp = π − [p ×] ρ."""
        out = np.eye(9 + state.sensors.shape[-1])
        out[VELOCITY, MISALIGNMENT] = -rotations.skew(state.motion.velocity_t_mps)
        out[POSITION, MISALIGNMENT] = -rotations.skew(state.motion.position_t_m)
        return out


def _apply(matrix: Floats, vector: Floats) -> Floats:
    out: Floats = (matrix @ vector[..., None])[..., 0]
    return out
