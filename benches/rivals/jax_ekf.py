"""The error-state Kalman filter of 20 states in JAX, over many runs at a time: tight coupling by `vmap` and `scan`.

The same equations as the kernel's `tc` with the covariance propagated at every inertial step and without its
treatment of outliers (docs/equations.md): F of Eq. 4 averaged over a step, Φ = I + F T, half of the noise before it and
half after, a row per beam (Eqs 15, 20 and 22), Joseph's form. Beside the beams a heading and a depth, whose bias is
taken for noise.

Float64 is switched on for the process by importing this module.
"""

import time
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from partialdvl_bench.mission import Estimates, Mission

jax.config.update("jax_enable_x64", True)  # noqa: FBT003 - JAX's own call

Floats = NDArray[np.float64]
Array = Any
"""A JAX array."""


class State(NamedTuple):
    """Position (tangent), attitude, velocity (platform), biases of accelerometers, gyros and beams, scale factor, P."""

    position: Array
    attitude: Array
    velocity: Array
    accel_bias: Array
    gyro_bias: Array
    beam_bias: Array
    scale: Array
    covariance: Array


class World(NamedTuple):
    """What all runs share."""

    earth_rate: Array
    gravity: Array
    noise: Array
    directions: Array
    levers: Array
    beam_sd: Array
    gates: Array
    heading_sd: Array
    depth_sd: Array
    depth_lever: Array


class Segment(NamedTuple):
    """Inertial means up to an epoch, (L, …) with steps of zero length behind them, and what was measured then."""

    dt: Array
    omega: Array
    force: Array
    beams: Array
    valid: Array
    depth: Array
    heading: Array


@dataclass(frozen=True, eq=False)
class Batch:
    """Missions with the same times, beside each other; the first axis of `starts` and of the readings is the run."""

    world: World
    starts: State
    segments: Segment
    on_grid: NDArray[np.bool_]
    grid_ns: NDArray[np.int64]


def estimate(mission: Mission) -> Estimates:
    """Velocity, position and attitude at the grid; the time is that of a second call, which needs no compilation."""
    batch = batch_of([mission])
    jax.block_until_ready(run(batch))
    began = time.perf_counter()
    states = jax.block_until_ready(run(batch))
    wall_s = time.perf_counter() - began
    at = {
        name: np.asarray(value)[0][batch.on_grid] for name, value in zip(State._fields, states, strict=True)
    }
    return Estimates(
        time_ns=mission.grid_ns,
        velocity_p_mps=at["velocity"],
        velocity_cov=at["covariance"][:, 6:9, 6:9],
        position_t_m=at["position"],
        position_cov=at["covariance"][:, :3, :3],
        attitude_t_p=at["attitude"],
        wall_s=wall_s,
    )


def run(batch: Batch) -> State:
    """The states of every run at every epoch: the fields of `State`, (runs, epochs, …)."""
    return _runs(batch.world, batch.starts, batch.segments)


def batch_of(missions: list[Mission]) -> Batch:
    """Missions of one world (sensors, times, start's sd) as arrays.

    Raises:
        ValueError: where the times differ.
    """
    first = missions[0]
    for other in missions[1:]:
        for name in ("imu", "pings", "depth", "heading"):
            if not np.array_equal(getattr(first, name).time_ns, getattr(other, name).time_ns):
                raise ValueError(f"{other.name}: times of {name} differ from those of {first.name}")
    epochs = _epochs(first)
    segments = [_segments(mission, epochs) for mission in missions]
    return Batch(
        world=_world(first),
        starts=_stacked([_start(mission) for mission in missions]),
        segments=Segment(
            segments[0].dt, *(jnp.stack(arrays) for arrays in list(zip(*segments, strict=True))[1:])
        ),
        on_grid=np.isin(epochs, first.grid_ns),
        grid_ns=first.grid_ns,
    )


def _epochs(mission: Mission) -> NDArray[np.int64]:
    streams = (mission.pings, mission.depth, mission.heading)
    times = np.unique(np.concatenate([*(stream.time_ns for stream in streams), mission.grid_ns]))
    return times[(times > mission.start.time_ns) & (times <= mission.imu.time_ns[-1])]


def _segments(mission: Mission, epochs: NDArray[np.int64]) -> Segment:
    """Inertial means cut at the epochs, padded to the longest segment."""
    imu, start_ns = mission.imu, mission.start.time_ns
    ends = np.union1d(imu.time_ns[imu.time_ns > start_ns], epochs)
    ends = ends[ends <= epochs[-1]]
    dt_s = np.diff(ends, prepend=start_ns) * 1e-9
    source = np.searchsorted(imu.time_ns, ends)
    segment = np.searchsorted(epochs, ends)
    length = int(np.bincount(segment).max())
    place = np.arange(len(ends)) - np.searchsorted(segment, segment)
    dt = np.zeros((len(epochs), length))
    omega, force = np.zeros((2, len(epochs), length, 3))
    dt[segment, place] = dt_s
    omega[segment, place], force[segment, place] = imu.omega_p_radps[source], imu.force_p_mps2[source]
    # Where the last steps of a segment are empty, the rate at its end is that of the last step.
    last = np.bincount(segment)[:, None] - 1
    empty = np.arange(length) > last
    omega[empty] = np.take_along_axis(omega, last[..., None], axis=1).repeat(length, axis=1)[empty]
    readings = np.nan_to_num(mission.pings.velocity_mps) / mission.geometry.sound_speed_scale
    return Segment(
        jnp.array(dt),
        jnp.array(omega),
        jnp.array(force),
        jnp.array(_at(epochs, mission.pings.time_ns, readings, 0.0)),
        jnp.array(_at(epochs, mission.pings.time_ns, mission.pings.valid, False)),  # noqa: FBT003
        jnp.array(_at(epochs, mission.depth.time_ns, mission.depth.value, np.nan)),
        jnp.array(_at(epochs, mission.heading.time_ns, mission.heading.value, np.nan)),
    )


def _at(epochs: Any, time_ns: Any, values: Any, absent: Any) -> NDArray[Any]:  # noqa: ANN401 - numbers or flags
    """The values at the epochs, `absent` where there is none."""
    out = np.full((len(epochs), *values.shape[1:]), absent, values.dtype)
    kept = np.isin(time_ns, epochs)
    out[np.searchsorted(epochs, time_ns[kept])] = values[kept]
    return out


def _world(mission: Mission) -> World:
    model, options, geometry = mission.model, mission.options, mission.geometry
    environment, imu, dvl = model.environment, model.imu, model.dvl
    latitude = environment.latitude_rad
    walks = np.array([dvl.beam_bias_walk_mps_rts, dvl.scale_factor_walk_rts]) * options.estimate_dvl
    noise = [imu.accel_noise_mps_rts, imu.gyro_noise_rad_rts, imu.accel_bias_walk_mps2_rts]
    rows = np.arange(1, geometry.beams + 1)
    joint = options.gate == "joint"
    return World(
        earth_rate=environment.earth_rate_radps * jnp.array([np.cos(latitude), 0.0, -np.sin(latitude)]),
        gravity=jnp.array(environment.gravity_mps2),
        noise=jnp.array([*noise, imu.gyro_bias_walk_radps_rts, *walks]) ** 2,
        directions=jnp.array(geometry.directions_p),
        levers=jnp.array(geometry.lever_arms_p_m),
        beam_sd=jnp.array(dvl.beam_noise_sd_mps / geometry.sound_speed_scale),
        gates=jnp.array(chi2.ppf(options.gate_probability, rows) if joint else np.full(len(rows), np.inf)),
        heading_sd=jnp.array(model.heading.sd_rad if model.heading else 1.0),
        depth_sd=jnp.array(np.hypot(model.depth.sd_m, model.depth.bias_sd_m)),
        depth_lever=jnp.array(options.depth_lever_p_m),
    )


def _start(mission: Mission) -> State:
    start, model = mission.start, mission.model
    initial, imu, dvl = model.initial, model.imu, model.dvl
    sd = np.concatenate(
        [
            *(initial.position_sd_m, initial.attitude_sd_rad, initial.velocity_sd_mps),
            np.repeat([imu.accel_bias_sd_mps2, imu.gyro_bias_sd_radps], 3),
            np.repeat([dvl.beam_bias_sd_mps, dvl.scale_factor_sd], [4, 1]) * mission.options.estimate_dvl,
        ]
    )
    return State(
        *(jnp.array(value) for value in (start.position_t_m, start.attitude_t_p, start.velocity_p_mps)),
        *(jnp.zeros(size) for size in (3, 3, 4)),
        jnp.zeros(()),
        jnp.diag(jnp.array(sd) ** 2),
    )


def _stacked(states: list[State]) -> State:
    return State(*(jnp.stack(values) for values in zip(*states, strict=True)))


@jax.jit
def _runs(world: World, starts: State, segments: Segment) -> State:
    axes = Segment(None, *[0] * (len(Segment._fields) - 1))
    return jax.vmap(_one_run, in_axes=(None, 0, axes))(world, starts, segments)


def _one_run(world: World, start: State, segments: Segment) -> State:
    def epoch(state: State, segment: Segment) -> tuple[State, State]:
        steps = (segment.dt, segment.omega, segment.force)
        state, _ = jax.lax.scan(partial(_step, world), state, steps)
        state = _measured(world, state, segment)
        return state, state

    return jax.lax.scan(epoch, start, segments)[1]


def _step(world: World, state: State, reading: tuple[Array, Array, Array]) -> tuple[State, None]:
    """A strapdown step over a mean, and the covariance over it."""
    dt, omega, force = reading
    omega, force = omega - state.gyro_bias, force - state.accel_bias
    before = _rotation(state.attitude)
    frame = jnp.concatenate([jnp.ones(1), -0.5 * dt * world.earth_rate])
    turned = _product(frame / jnp.linalg.norm(frame), _product(state.attitude, _exp(omega * dt)))
    attitude = turned / jnp.linalg.norm(turned)
    after = _rotation(attitude)
    velocity_t = before @ state.velocity
    gain_t = 0.5 * dt * (before @ force + after @ force) + jnp.array([0.0, 0.0, 1.0]) * world.gravity * dt
    coriolis = jnp.cross(2.0 * dt * world.earth_rate, velocity_t + 0.5 * gain_t)
    new_velocity_t = velocity_t + gain_t - coriolis
    position = state.position + 0.5 * dt * (velocity_t + new_velocity_t)
    velocity = after.T @ new_velocity_t
    rows = (
        0.5
        * dt
        * (
            _dynamics(world, before, state.velocity, velocity_t, omega)
            + _dynamics(world, after, velocity, new_velocity_t, omega)
        )
    )
    noise = 0.5 * dt * _noise(world, 0.5 * (before + after), 0.5 * (state.velocity + velocity))
    covariance = _propagated(state.covariance + noise, rows) + noise
    moved = state._replace(position=position, attitude=attitude, velocity=velocity, covariance=covariance)
    return moved, None


def _propagated(covariance: Array, rows: Array) -> Array:
    """Φ P Φᵀ, where Φ − I has nine rows."""
    top = covariance[:9] + rows @ covariance
    corner = top[:, :9] + top @ rows.T
    side = top[:, 9:]
    return jnp.block([[0.5 * (corner + corner.T), side], [side.T, covariance[9:, 9:]]])


def _dynamics(world: World, rotation: Array, velocity: Array, velocity_t: Array, omega: Array) -> Array:
    """The rows of F (Eq. 4) that are not zero, (9, 20)."""
    zero, one = jnp.zeros((3, 3)), jnp.eye(3)
    earth_t = _skew(world.earth_rate)
    gravity = _skew(jnp.array([0.0, 0.0, 1.0]) * world.gravity)
    by_misalignment = rotation.T @ gravity + _skew(velocity) @ rotation.T @ earth_t
    coriolis = _skew(omega + rotation.T @ world.earth_rate)
    dvl = jnp.zeros((9, 5))
    blocks = [
        [zero, -_skew(velocity_t), rotation, zero, zero],
        [zero, -earth_t, zero, zero, -rotation],
        [zero, by_misalignment, -coriolis, -one, -_skew(velocity)],
    ]
    return jnp.hstack([jnp.block(blocks), dvl])


def _noise(world: World, rotation: Array, velocity: Array) -> Array:
    """G Q Gᵀ (Eqs 6, 10 and 11)."""
    accel, gyro, accel_bias, gyro_bias, beam_bias, scale = world.noise
    across = gyro * _skew(velocity) @ rotation.T
    out = jnp.zeros((20, 20))
    out = out.at[3:6, 3:6].set(gyro * jnp.eye(3))
    out = out.at[6:9, 6:9].set(accel * jnp.eye(3) + gyro * _skew(velocity) @ _skew(velocity).T)
    out = out.at[6:9, 3:6].set(across).at[3:6, 6:9].set(across.T)
    walks = jnp.repeat(jnp.array([0, 1, 2, 3]), jnp.array([3, 3, 4, 1]), total_repeat_length=11)
    return out.at[9:, 9:].set(jnp.diag(jnp.stack([accel_bias, gyro_bias, beam_bias, scale])[walks]))


def _measured(world: World, state: State, segment: Segment) -> State:
    """The updates of an epoch: beams, depth, heading."""
    # A segment ends with its last step or with empty ones behind it.
    last_dt = segment.dt[jnp.sum(segment.dt > 0.0) - 1]
    terms = _beam_rows(world, state, segment.omega[-1] - state.gyro_bias, last_dt, segment)
    state = _update(state, *terms, segment.valid, world.gates)
    rotation = _rotation(state.attitude)
    lever = rotation @ world.depth_lever
    row = jnp.zeros((1, 20)).at[0, 2].set(1.0).at[0, 3].set(lever[1]).at[0, 4].set(-lever[0])
    has_depth = jnp.isfinite(segment.depth)
    residual = jnp.where(has_depth, segment.depth - (state.position[2] + lever[2]), 0.0)
    gate = world.gates[:1]
    state = _update(state, residual[None], row, jnp.eye(1) * world.depth_sd**2, has_depth[None], gate)
    rotation = _rotation(state.attitude)
    yaw = jnp.arctan2(rotation[1, 0], rotation[0, 0])
    slope = -rotation[2, 0] / jnp.hypot(rotation[0, 0], rotation[1, 0])
    row = jnp.zeros((1, 20)).at[0, 3].set(jnp.cos(yaw) * slope).at[0, 4].set(jnp.sin(yaw) * slope)
    row = row.at[0, 5].set(1.0)
    has_heading = jnp.isfinite(segment.heading)
    difference = jnp.where(has_heading, segment.heading - yaw, 0.0)
    residual = jnp.arctan2(jnp.sin(difference), jnp.cos(difference))
    return _update(state, residual[None], row, jnp.eye(1) * world.heading_sd**2, has_heading[None], gate)


def _beam_rows(world: World, state: State, omega: Array, last_dt: Array, segment: Segment) -> Any:  # noqa: ANN401
    """Residual, Jacobian and noise of the beams (Eqs 15, 20 and 22)."""
    rotation, directions = _rotation(state.attitude), world.directions
    across = jnp.cross(world.levers, directions)
    omega_tp = omega - rotation.T @ world.earth_rate
    along = directions @ state.velocity
    biases = jnp.concatenate([state.beam_bias, jnp.zeros(4)])[: len(directions)]
    expected = (1.0 + state.scale) * along + across @ omega_tp + biases
    rows = jnp.zeros((len(directions), 20))
    rows = rows.at[:, 3:6].set(-across @ rotation.T @ _skew(world.earth_rate))
    rows = rows.at[:, 6:9].set((1.0 + state.scale) * directions)
    rows = rows.at[:, 12:15].set(-across).at[:, 15:19].set(jnp.eye(len(directions), 4)).at[:, 19].set(along)
    gyro_variance = world.noise[1] / last_dt
    noise = jnp.eye(len(directions)) * world.beam_sd**2 + gyro_variance * across @ across.T
    return segment.beams - expected, rows, noise


def _update(state: State, residual: Array, rows: Array, noise: Array, valid: Array, gates: Array) -> State:
    """Joseph's form with the rows that are valid; all are left out where the NIS is beyond the gate."""
    pairs = valid[:, None] & valid[None]
    residual, rows = jnp.where(valid, residual, 0.0), jnp.where(valid[:, None], rows, 0.0)
    noise = jnp.where(pairs, noise, jnp.eye(len(residual)))
    crossed = state.covariance @ rows.T
    innovation = rows @ crossed + noise
    gain = jnp.linalg.solve(innovation, crossed.T).T
    nis = residual @ jnp.linalg.solve(innovation, residual)
    count = jnp.sum(valid)
    used = (count > 0) & (nis <= gates[jnp.maximum(count - 1, 0)])
    gain = jnp.where(used, gain, 0.0)
    left = jnp.eye(20) - gain @ rows
    covariance = left @ state.covariance @ left.T + gain @ noise @ gain.T
    error = gain @ residual
    attitude = _product(_exp(error[3:6]), state.attitude)
    return State(
        state.position + error[:3],
        attitude / jnp.linalg.norm(attitude),
        state.velocity + error[6:9],
        state.accel_bias + error[9:12],
        state.gyro_bias + error[12:15],
        state.beam_bias + error[15:19],
        state.scale + error[19],
        0.5 * (covariance + covariance.T),
    )


def _skew(a: Array) -> Array:
    zero = jnp.zeros(())
    return jnp.stack([zero, -a[2], a[1], a[2], zero, -a[0], -a[1], a[0], zero]).reshape(3, 3)


def _product(a: Array, b: Array) -> Array:
    vector = a[0] * b[1:] + b[0] * a[1:] + jnp.cross(a[1:], b[1:])
    return jnp.concatenate([(a[0] * b[0] - a[1:] @ b[1:])[None], vector])


def _exp(vector: Array) -> Array:
    """The quaternion of a rotation vector of up to about a radian: series to the tenth power."""
    square = 0.25 * vector @ vector
    cosine = 1.0 + square * (-1 / 2 + square * (1 / 24 + square * (-1 / 720 + square / 40_320)))
    half_sinc = 0.5 + square * (-1 / 12 + square * (1 / 240 + square * (-1 / 10_080 + square / 725_760)))
    return jnp.concatenate([cosine[None], half_sinc * vector])


def _rotation(q: Array) -> Array:
    w, x, y, z = q
    return jnp.stack(
        [
            *(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            *(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
            *(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
        ]
    ).reshape(3, 3)
