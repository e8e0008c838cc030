"""Measurements as (prediction, Jacobian, noise): beams, velocity solved from beams, depth, heading, position.

A prediction is a function of states with any leading axes; a Jacobian is of additive errors
(benches/rivals/state.py).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benches.rivals import rotations
from benches.rivals.state import GYRO_BIAS, MISALIGNMENT, POSITION, Layout, State, velocity_rows
from benches.rivals.strapdown import Earth
from bottomlock.kernel.models import DepthModel, DvlModel
from partialdvl_bench.mission import Mission

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Measurement:
    """Values (m,), their prediction from a state (..., m), Jacobian (m, n) and covariance (m, m)."""

    value: Floats
    predict: Callable[[State], Floats]
    jacobian: Callable[[State], Floats]
    cov: Floats
    angle: bool = False

    def innovation(self, predicted: Floats) -> Floats:
        """Measured minus predicted; of an angle the shorter way round."""
        difference = self.value - predicted
        return rotations.wrapped(difference) if self.angle else difference

    def row(self, keep: NDArray[np.bool_]) -> "Measurement":
        """Some of the rows."""
        return Measurement(
            self.value[keep],
            lambda state: self.predict(state)[..., keep],
            lambda state: self.jacobian(state)[keep],
            self.cov[np.ix_(keep, keep)],
            self.angle,
        )


class Sensors:
    """The sensors of a mission."""

    def __init__(self, mission: Mission, layout: Layout | None = None) -> None:
        self.mission = mission
        self.layout = layout or Layout.of(mission)
        self.earth = Earth.of(mission.model.environment)
        # Directions with what the wrong sound speed multiplies; lever arms.
        self.directions = mission.geometry.sound_speed_scale * mission.geometry.directions_p
        self.levers = mission.geometry.lever_arms_p_m
        self.beam_var = mission.model.of(DvlModel).beam_noise_sd_mps ** 2

    def beams(self, velocity_mps: Floats, omega_p_radps: Floats) -> Measurement | None:
        """A row for each beam that returned (B,), NaN where none; None without any.

        y = b · [(1 + SF) Rᵀ v + ω_tp × l] + bias, with ω_tp from the gyro's last reading.
        """
        keep = np.isfinite(velocity_mps)
        if not keep.any():
            return None
        full = Measurement(
            velocity_mps,
            lambda state: self._beam_velocities(state, omega_p_radps),
            self._beam_rows,
            self.beam_var * np.eye(len(velocity_mps)),
        )
        return full.row(keep)

    def velocity(self, velocity_mps: Floats, omega_p_radps: Floats) -> Measurement | None:
        """The velocity that the beams determine by least squares; None where they do not determine all of it."""
        beams = self.beams(velocity_mps, omega_p_radps)
        keep = np.isfinite(velocity_mps)
        directions = self.directions[keep]
        if beams is None or np.linalg.matrix_rank(directions) < 3:
            return None
        solve = np.linalg.pinv(directions)
        return Measurement(
            solve @ beams.value,
            lambda state: beams.predict(state) @ solve.T,
            lambda state: solve @ beams.jacobian(state),
            solve @ beams.cov @ solve.T,
        )

    def depth(self, depth_m: Floats) -> Measurement:
        """p_z + (R l)_z + bias = depth."""
        lever = np.asarray(self.mission.options.depth_lever_p_m)

        def rows(state: State) -> Floats:
            out = _position_rows(state, lever)[2:]
            out[:, self.layout.depth_bias] = 1.0
            return out

        return Measurement(
            depth_m,
            lambda state: (
                state.motion.position_t_m[..., 2:]
                + (state.motion.rotation @ lever)[..., 2:]
                + state.depth_bias[..., None]
            ),
            rows,
            np.array([[self.mission.model.of(DepthModel).sd_m ** 2]]),
        )

    def position(self, position_t_m: Floats, sd_m: float) -> Measurement:
        """P + R l, l the lever arm of the acoustic transponder."""
        lever = np.asarray(self.mission.options.acoustic_position_lever_p_m)
        return Measurement(
            position_t_m,
            lambda state: state.motion.position_t_m + state.motion.rotation @ lever,
            lambda state: _position_rows(state, lever),
            sd_m**2 * np.eye(3),
        )

    def heading(self, heading_rad: Floats) -> Measurement | None:
        """Angle of the bow, with offset and walk where they are states; None where the model has no heading sensor."""
        model = self.mission.model.heading
        if model is None:
            return None

        def rows(state: State) -> Floats:
            out = np.zeros((1, self.layout.size))
            north, east, down = state.motion.rotation[:, 0]
            level = north * north + east * east
            # δ(R e_x) = ρ × R e_x
            out[0, MISALIGNMENT] = [-north * down / level, -east * down / level, 1.0]
            out[0, self.layout.heading] = 1.0
            return out

        return Measurement(
            heading_rad,
            lambda state: (
                rotations.yaw_rad(state.motion.rotation) + state.states(self.layout.heading).sum(axis=-1)
            )[..., None],
            rows,
            np.array([[model.sd_rad**2]]),
            angle=True,
        )

    def _rate(self, state: State, omega_p_radps: Floats) -> Floats:
        turned = np.einsum("...ji,j->...i", state.motion.rotation, self.earth.rate_t_radps)
        out: Floats = omega_p_radps - state.gyro_bias - turned
        return out

    def _beam_velocities(self, state: State, omega_p_radps: Floats) -> Floats:
        scaled = (1.0 + state.scale_factor[..., None]) * state.velocity_p_mps
        rate = self._rate(state, omega_p_radps)
        turning = np.cross(rate[..., None, :], self.levers)
        out: Floats = ((scaled[..., None, :] + turning) * self.directions).sum(axis=-1) + state.beam_bias
        return out

    def _beam_rows(self, state: State) -> Floats:
        rows: Floats = (1.0 + state.scale_factor) * self.directions @ velocity_rows(state)
        # ω × l with δω = −δb_g − Rᵀ [ω_ie ×] ρ: b · (l × δb_g), and the Earth's part
        by_gyro = np.cross(self.directions, self.levers)
        rows[:, GYRO_BIAS] += by_gyro
        rows[:, MISALIGNMENT] += by_gyro @ state.motion.rotation.T @ rotations.skew(self.earth.rate_t_radps)
        rows[:, self.layout.beam_bias] = np.eye(self.layout.beams)
        rows[:, self.layout.scale_factor] = self.directions @ state.velocity_p_mps
        return rows


def velocity_measurement(velocity_p_mps: Floats, cov_m2ps2: Floats) -> Measurement:
    """The velocity in platform axes, whatever it comes from."""

    def predict(state: State) -> Floats:
        return state.velocity_p_mps

    return Measurement(velocity_p_mps, predict, velocity_rows, cov_m2ps2)


def _position_rows(state: State, lever: Floats) -> Floats:
    rows = np.zeros((3, 9 + state.sensors.shape[-1]))
    rows[:, POSITION] = np.eye(3)
    rows[:, MISALIGNMENT] = -rotations.skew(state.motion.rotation @ lever)
    return rows
