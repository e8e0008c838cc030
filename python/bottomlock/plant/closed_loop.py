"""Closed loop: many runs side by side, each controlled on its own navigation estimate.

At every control step `navigate` is called with the truth of the step just integrated, from which it simulates the
sensors and runs the filters; it returns the estimate of each vehicle. Guidance and control then use that estimate.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from bottomlock.config.scenario import EARTH_RATE_RADPS
from bottomlock.errors import ScenarioError
from bottomlock.kernel import models
from bottomlock.plant import model
from bottomlock.plant.control import offset_and_heading
from bottomlock.plant.equations import to_tangent
from bottomlock.plant.flight import euler_rad, inertial_measurements
from bottomlock.plant.hovering_vehicle import AnyVehicle
from bottomlock.plant.maths import ARRAY, FloatArray, IntArray
from bottomlock.plant.mission import Mission
from bottomlock.plant.path import guide_rows, next_segment
from bottomlock.plant.swim import (
    FASTEST_IN_A_STEP,
    Integration,
    sampled,
    samples_and_steps,
    steps_per_tick,
)
from bottomlock.plant.trim import check_stability, start_state
from bottomlock.truth import EllipsoidPath, sample_times_ns


@dataclass(frozen=True)
class TruthBlock:
    """The truth of all runs over one control step: the samples after the step before, up to its own end.

    The first block holds the sample at time zero alone.

    Attributes:
        time_ns: (S,).
        position_t_m: (runs, S, 3).
        attitude_t_p: (runs, S, 4), scalar first.
        velocity_p_mps, omega_p_radps, force_p_mps2: (runs, S, 3); omega is inertial.
    """

    time_ns: IntArray
    position_t_m: FloatArray
    attitude_t_p: FloatArray
    velocity_p_mps: FloatArray
    omega_p_radps: FloatArray
    force_p_mps2: FloatArray


@dataclass(frozen=True)
class Estimate:
    """Navigation estimate at a block's end: position (runs, 3), attitude (runs, 4), velocity (runs, 3)."""

    position_t_m: FloatArray
    attitude_t_p: FloatArray
    velocity_p_mps: FloatArray


Navigate: TypeAlias = Callable[[TruthBlock], Estimate]


def navigation_error(block: TruthBlock, estimate: Estimate) -> FloatArray:
    """True minus estimated at the block's end, (runs, 9): position_t m, velocity_t m/s, roll, pitch, yaw rad.

    Raises:
        ScenarioError: naming run and time, for an estimate that is not finite.
    """
    true = (block.position_t_m[:, -1], block.attitude_t_p[:, -1], block.velocity_p_mps[:, -1])
    angles = euler_rad(true[1]) - euler_rad(estimate.attitude_t_p)
    angles -= 2.0 * np.pi * np.round(angles / (2.0 * np.pi))
    velocity = _tangent(true[1], true[2]) - _tangent(estimate.attitude_t_p, estimate.velocity_p_mps)
    error = np.concatenate([true[0] - estimate.position_t_m, velocity, angles], axis=1)
    if not np.isfinite(error).all():
        run = int(np.flatnonzero(~np.isfinite(error).all(axis=1))[0])
        raise ScenarioError(
            f"the estimate at {block.time_ns[-1] * 1e-9:.2f} s is not finite",
            place=f"run {run}",
            expected="finite position, attitude and velocity",
        )
    return error


def _tangent(attitude_t_p: FloatArray, velocity_p: FloatArray) -> FloatArray:
    q0, q1, q2, q3 = attitude_t_p.T
    u, v, w = velocity_p.T
    return np.stack(to_tangent(q0, q1, q2, q3, u, v, w), axis=1)


class VehicleGroup:
    """Vehicles of several runs of one mission, integrated side by side; each state is an array (runs,).

    Raises:
        ScenarioError: for fewer than one run.
    """

    def __init__(
        self,
        vehicle: AnyVehicle,
        mission: Mission,
        *,
        runs: int,
        latitude_rad: float,
        gravity_mps2: float,
        earth_rate_radps: float = EARTH_RATE_RADPS,
        imu_rate_hz: float = 150.0,
        earth: Literal["ellipsoid", "tangent_plane"] = "tangent_plane",
    ) -> None:
        if runs < 1:
            raise ScenarioError(place="runs", expected=f"at least 1, got {runs}")
        self.mission = mission
        self.runs = runs
        self._latitude_rad, self._gravity_mps2 = latitude_rad, gravity_mps2
        self._earth_rate_radps = earth_rate_radps
        environment = models.Environment(
            latitude_rad=latitude_rad, gravity_mps2=gravity_mps2, earth_rate_radps=earth_rate_radps
        )
        self._paths = [EllipsoidPath(environment) for _ in range(runs if earth == "ellipsoid" else 0)]
        self._parts, steps_per_sample = samples_and_steps(vehicle, gravity_mps2, imu_rate_hz)
        if steps_per_sample > 1:
            least_hz = check_stability(vehicle, gravity_mps2) / FASTEST_IN_A_STEP
            raise ScenarioError(
                f"{imu_rate_hz:g} is too slow for one step of vehicle {vehicle.name} to a sample",
                place="imu",
                key="rate_hz",
                expected=f"at least {math.ceil(least_hz)} Hz in the loop",
            )
        step_s = self._parts / imu_rate_hz
        per_tick = steps_per_tick(step_s)
        steps = int(-(-mission.duration_s // (per_tick * step_s))) * per_tick
        start = [np.full(runs, value) for value in start_state(vehicle, mission, gravity_mps2)]
        self._run = Integration(
            vehicle, mission, ARRAY, start, gravity_mps2=gravity_mps2, step_s=step_s, steps=steps
        )
        self._step_s, self._time_ns = step_s, sample_times_ns(steps * step_s, imu_rate_hz)
        self._motion = model.motion_through_water(vehicle, gravity_mps2)
        self._guides = guide_rows(mission.segments)
        self._index = np.zeros(runs, dtype=np.int64)
        self._error = np.zeros((runs, 9))

    @property
    def finished(self) -> bool:
        """True when the mission's duration has been integrated."""
        return self._run.step >= self._run.steps

    @property
    def state(self) -> FloatArray:
        """The current state, (runs, size), in the layout of `model`."""
        return np.stack(self._run.state, axis=1)

    @property
    def segment(self) -> IntArray:
        """The path segment that each run follows, (runs,)."""
        return self._index.copy()

    def set_navigation_error(self, error: FloatArray) -> None:
        """Set the navigation error (runs, 9) of guidance and control until the next call."""
        self._error = np.asarray(error, dtype=np.float64)
        self._run.slope = []

    def start(self) -> TruthBlock:
        """The truth at time zero."""
        return self._block(self.state[:, None, :], 0)

    def swim_step(self) -> TruthBlock:
        """Integrate to the next guidance tick (0.2 s) and return the truth in between."""
        estimated = (self.state[:, :2] - self._error[:, :2]).tolist()
        for run, place in enumerate(estimated):
            self._index[run] = next_segment(self._guides, int(self._index[run]), *place)
        segment = tuple(np.array(self._guides)[self._index].T)
        first_sample = self._run.step * self._parts + 1
        parts = self._run.tick(segment, tuple(self._error.T))  # type: ignore[arg-type]
        joints, slopes = (np.moveaxis(np.array(part), 2, 1) for part in parts)
        samples = sampled(joints, slopes, self._step_s, self._parts)[1:]
        return self._block(np.moveaxis(samples, 0, 1), first_sample)

    def _block(self, samples: FloatArray, first_sample: int) -> TruthBlock:
        count = samples.shape[1]
        which = np.arange(first_sample, first_sample + count)
        times = which * (self._step_s / self._parts)
        rows = np.tile(self.mission.timetable(times), (self.runs, 1))
        flat = samples.reshape(-1, samples.shape[-1])
        omega, force = inertial_measurements(
            flat,
            self._motion(flat, rows)[0],
            latitude_rad=self._latitude_rad,
            gravity_mps2=self._gravity_mps2,
            earth_rate_radps=self._earth_rate_radps,
        )
        shape = (self.runs, count, 3)
        arrays = {
            "position_t_m": samples[..., 0:3].copy(),
            "attitude_t_p": samples[..., 3:7].copy(),
            "velocity_p_mps": samples[..., 7:10].copy(),
            "omega_p_radps": omega.reshape(shape),
            "force_p_mps2": force.reshape(shape),
        }
        for run, path in enumerate(self._paths):
            for name, part in path.follow({name: array[run] for name, array in arrays.items()}).items():
                arrays[name][run] = part
        return TruthBlock(time_ns=self._time_ns[which], **arrays)


def fly_on_estimate(group: VehicleGroup, navigate: Navigate) -> Iterator[TruthBlock]:
    """Integrate a group to the end, controlled on the estimates of `navigate`, yielding the truth block by block.

    `navigate` is called once per block, first with the truth at time zero; its error is held until the next block.

    Raises:
        ScenarioError: naming run and time, for an estimate that is not finite.
    """
    block = group.start()
    group.set_navigation_error(navigation_error(block, navigate(block)))
    yield block
    while not group.finished:
        block = group.swim_step()
        group.set_navigation_error(navigation_error(block, navigate(block)))
        yield block


def cross_track_m(mission: Mission, segment: IntArray, position_t_m: FloatArray) -> FloatArray:
    """Cross-track distance from the segment in use, positive right: segments (...,), positions (..., 3) -> (...,) m.

    Lines and arcs are extended beyond their ends: a vehicle far off its path is measured against the segment that it
    follows, not against the nearest.
    """
    start = np.array([part.row() for part in mission.segments])[segment]
    north, east = position_t_m[..., 0], position_t_m[..., 1]
    offset, _ = offset_and_heading(north, east, tuple(np.moveaxis(start, -1, 0)), ARRAY)
    return np.asarray(offset)
