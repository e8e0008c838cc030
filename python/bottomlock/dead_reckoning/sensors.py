"""Dead reckoning from the readings of simulated sensors, each estimate from readings up to its time alone.

From the latest reading of a reference the gyros turn the attitude on. Roll and pitch are those of an attitude sensor;
without one the gyros' own, drawn to the vertical of the accelerometers. Yaw is that of a heading sensor, else that of
the attitude sensor.

While the velocity along the vehicle's axes stays, f − ω × v is the reaction to gravity. Its tilt is taken out with the
time constant τ (`LEVEL_TIME_S`): a gyro bias leaves τ times itself, an accelerometer bias its ratio to gravity.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from bottomlock.dead_reckoning.track import (
    AttitudeErrors,
    Begin,
    DepthAid,
    Reckoned,
    StructureFunction,
    Velocities,
    VelocityErrors,
    dead_reckon,
)
from bottomlock.kernel import STATUS, BeamGeometry, solve_velocity
from bottomlock.kernel.models import DepthModel, DvlModel, InitialState, MagnetometerModel, Model
from bottomlock.recordings.streams import Attitudes, Depths, Flags, Floats, Times

LEVEL_TIME_S = 30.0
"""Longer than a turn of a vehicle's speed, short enough for gyros of 100 deg/h: 0.8 deg."""
STEP_S = 0.1
"""Inertial readings are summed up over this."""
LONGEST_HOLD_S = 1e4


@dataclass(frozen=True, eq=False)
class Sensors:
    """Readings of one run or mission.

    Attributes:
        imu_ns, omega_p_radps, force_p_mps2: inertial readings, (n,) and (n, 3) each.
        ping_ns, beam_mps, beam_valid: pings, (k,) and (k, B) each.
        depths: of the depth sensor; None without one.
        attitudes: of an attitude sensor; None without one.
        heading_ns, heading_rad: of a heading sensor, (h,) each; empty without one.
    """

    imu_ns: Times
    omega_p_radps: Floats
    force_p_mps2: Floats
    ping_ns: Times
    beam_mps: Floats
    beam_valid: Flags
    depths: Depths | None
    attitudes: Attitudes | None
    heading_ns: Times
    heading_rad: Floats


def reckon(
    geometry: BeamGeometry,
    model: Model,
    start: InitialState,
    sensors: Sensors,
    sample_ns: Times,
    *,
    depth_lever_p_m: Floats,
) -> Reckoned:
    """Position, velocity and attitude at `sample_ns` (T,), rising times after the start.

    Args:
        geometry: the beams.
        model: what the sensors claim.
        start: the state that every method begins with; its 1 sigma is that of the model.
        sensors: an attitude or a heading sensor is among them.
        sample_ns: times of the estimates.
        depth_lever_p_m: (3,) of the depth sensor from the IMU.
    """
    dvl, B = model.of(DvlModel), np.asarray(geometry.directions_p)
    velocities = _velocities(geometry, sensors, dvl.beam_noise_sd_mps)
    depths, depth = sensors.depths, None
    if depths is not None and len(depths.time_ns):
        sd_m = float(np.hypot(model.of(DepthModel).sd_m, model.of(DepthModel).bias_sd_m))
        depth = DepthAid(Depths(sample_ns, _latest(depths, sample_ns)), sd_m, depth_lever_p_m)
    return dead_reckon(
        velocities,
        attitudes_of(sensors, start, model, velocities),
        Begin(
            start.time_ns,
            np.asarray(start.position_t_m),
            np.asarray(start.velocity_p_mps),
            np.asarray(model.initial.position_sd_m),
            np.asarray(model.initial.velocity_sd_mps),
        ),
        sample_ns,
        velocity_errors=VelocityErrors(
            dvl.scale_factor_sd,
            np.asarray(dvl.beam_bias_sd_mps**2 * np.linalg.inv(B.T @ B)),
            _change(model, sensors.ping_ns),
        ),
        attitude_errors=attitude_errors(sensors, model),
        omega_p_radps=sensors.omega_p_radps[np.searchsorted(sensors.imu_ns, sample_ns, side="right") - 1],
        lever_p_m=np.asarray(geometry.lever_arms_p_m).mean(axis=0),
        depth=depth,
    )


def _velocities(geometry: BeamGeometry, sensors: Sensors, beam_sd_mps: float) -> Velocities:
    """Of the pings whose beams determine one."""
    sd = np.full(geometry.beams, beam_sd_mps)
    values = np.where(sensors.beam_valid, sensors.beam_mps, 0.0)
    fixes = solve_velocity(geometry, values, sensors.beam_valid, method="lc", beam_sd_mps=sd)
    whole = fixes.status == STATUS.index("fix")
    return Velocities(sensors.ping_ns[whole], fixes.velocity_p_mps[whole], fixes.cov_m2ps2[whole])


def attitudes_of(sensors: Sensors, start: InitialState, model: Model, velocities: Velocities) -> Attitudes:
    """The attitude from the start on, every `STEP_S`."""
    time_ns, C = _levelled(sensors, start, model, velocities)
    attitude = own = Rotation.from_matrix(C)
    reference = sensors.attitudes
    if reference is not None and len(reference.time_ns):
        latest = np.searchsorted(reference.time_ns, time_ns, side="right") - 1
        known = latest >= 0
        then = Attitudes(time_ns, own).at(reference.time_ns)
        since = then[latest[known]].inv() * own[known]
        attitude = Rotation.concatenate([own[~known], reference.attitude[latest[known]] * since])
    if len(sensors.heading_ns):
        yaw = np.unwrap(np.arctan2(C[:, 1, 0], C[:, 0, 0]))
        off = sensors.heading_rad - np.interp(sensors.heading_ns, time_ns, yaw)
        off = (off + np.pi) % (2.0 * np.pi) - np.pi
        latest = np.searchsorted(sensors.heading_ns, time_ns, side="right")
        angles = attitude.as_euler("ZYX")
        angles[:, 0] = yaw + np.concatenate([[0.0], off])[latest]
        attitude = Rotation.from_euler("ZYX", angles)
    return Attitudes(time_ns, attitude)


def _levelled(
    sensors: Sensors, start: InitialState, model: Model, velocities: Velocities
) -> tuple[Times, Floats]:
    """(n,) times and (n, 3, 3) attitudes of the gyros from the start, drawn to the vertical of the accelerometers."""
    after = sensors.imu_ns > start.time_ns
    imu_ns = sensors.imu_ns[after]
    step_ns = np.diff(imu_ns, prepend=start.time_ns)
    first = np.arange(0, len(imu_ns), max(1, round(STEP_S / (float(np.median(step_ns)) * 1e-9))))
    last = np.append(first[1:], len(imu_ns)) - 1
    time_ns = np.concatenate([[start.time_ns], imu_ns[last]])
    step_s = np.diff(time_ns) * 1e-9
    environment = model.environment
    latitude = environment.latitude_rad
    earth = environment.earth_rate_radps * np.array([np.cos(latitude), 0.0, -np.sin(latitude)])
    turned = np.add.reduceat(sensors.omega_p_radps[after] * (step_ns * 1e-9)[:, None], first)
    turns = Rotation.from_rotvec(turned).as_matrix()
    back = Rotation.from_rotvec(-earth * step_s[:, None]).as_matrix()
    force = np.add.reduceat(sensors.force_p_mps2[after], first) / (last - first + 1)[:, None]
    held = np.concatenate([[start.velocity_p_mps], velocities.velocity_p_mps])
    latest = held[np.searchsorted(velocities.time_ns, time_ns[1:], side="right")]
    up = force - np.cross(turned / step_s[:, None], latest)
    # The mean of a step, seen from its end.
    up -= 0.5 * np.cross(turned, up)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    share = -np.expm1(-step_s / LEVEL_TIME_S)
    C = np.empty((len(time_ns), 3, 3))
    C[0] = Rotation.from_quat(start.attitude_t_p, scalar_first=True).as_matrix()
    for k in range(len(step_s)):
        now = back[k] @ C[k] @ turns[k]
        # u × (0, 0, −1), with u where the platform has up, turns u to the true one.
        x, y, _ = share[k] * (now @ up[k])
        C[k + 1] = now + np.array([x * now[2], y * now[2], -x * now[0] - y * now[1]])
    return time_ns, C


def attitude_errors(sensors: Sensors, model: Model) -> AttitudeErrors:
    """What the sources of level and yaw claim; white noise holds until the next reading."""
    heading, own, held_s = model.heading, sensors.attitudes, 0.0
    if own is not None and len(own.time_ns) > 1:
        compass = model.of(MagnetometerModel)
        level = (compass.roll_pitch_offset_sd_rad, compass.roll_pitch_walk_sd_rad, compass.roll_pitch_sd_rad)
        constant = (compass.yaw_offset_sd_rad, compass.yaw_semicircular_sd_rad, compass.yaw_quadrantal_sd_rad)
        yaw = (math.hypot(*constant), compass.yaw_walk_sd_rad, compass.yaw_sd_rad)
        walk_time_s, held_s = compass.walk_time_s, _interval_s(own.time_ns)
    else:
        imu, initial = model.imu, model.initial.attitude_sd_rad
        parts = (
            initial[0],
            imu.gyro_bias_sd_radps * LEVEL_TIME_S,
            imu.accel_bias_sd_mps2 / model.environment.gravity_mps2,
        )
        level, yaw = (float(np.linalg.norm(parts)), 0.0, 0.0), (initial[2], 0.0, 0.0)
        walk_time_s = AttitudeErrors().walk_time_s
    if heading is not None and len(sensors.heading_ns) > 1:
        constant = (heading.offset_sd_rad, heading.semicircular_sd_rad, heading.quadrantal_sd_rad)
        yaw = (math.hypot(*constant), heading.walk_sd_rad, heading.sd_rad)
        walk_time_s, held_s = heading.walk_time_s, _interval_s(sensors.heading_ns)
    offset, walk, white = ((one, one, other) for one, other in zip(level, yaw, strict=True))
    return AttitudeErrors(offset, walk, white, walk_time_s, held_s or None)


def _interval_s(time_ns: Times) -> float:
    return float(np.median(np.diff(time_ns))) * 1e-9


def _change(model: Model, ping_ns: Times) -> StructureFunction:
    """A random walk of the velocity, by its uncertainty at the start in each second: nothing of it is measured yet."""
    rate = float(np.max(model.initial.velocity_sd_mps)) ** 2
    ends = np.array([0.0, LONGEST_HOLD_S])
    return StructureFunction(ends, np.repeat(rate * ends[:, None], 3, axis=1), _interval_s(ping_ns))


def _latest(depths: Depths, time_ns: Times) -> Floats:
    """The latest depth at each time; the first before it."""
    row = np.maximum(np.searchsorted(depths.time_ns, time_ns, side="right") - 1, 0)
    return depths.depth_m[row]
