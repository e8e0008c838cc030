"""Dead reckoning on a mission: the gyros turn the attitude from the start on, the heading sensor gives its yaw.

The reckoning is that of `replay/dead_reckoning.py`. Each estimate is from readings up to its time alone: a heading
holds until the next one, turned on by the gyros, and so does a depth.
"""

import time

import numpy as np
from scipy.spatial.transform import Rotation

from bottomlock.bench.mission import Estimates, Mission, Scalars
from bottomlock.kernel import STATUS, solve_velocity
from bottomlock.replay.axes import from_quaternions, quaternions
from bottomlock.replay.dead_reckoning import Begin, DepthAid, Velocities, dead_reckon
from bottomlock.replay.dead_reckoning_sd import AttitudeErrors, StructureFunction, VelocityErrors
from bottomlock.replay.streams import Attitudes, Depths, Floats, Times

LONGEST_HOLD_S = 1e4


def estimate(mission: Mission) -> Estimates:
    """The estimates at the grid's times."""
    began = time.perf_counter()
    model, geometry, start = mission.model, mission.geometry, mission.start
    B, dvl = np.asarray(geometry.directions_p), model.dvl
    reckoned = dead_reckon(
        _velocities(mission),
        Attitudes(*_attitude(mission)),
        Begin(
            start.time_ns,
            start.position_t_m,
            start.velocity_p_mps,
            np.asarray(model.initial.position_sd_m),
            np.asarray(model.initial.velocity_sd_mps),
        ),
        mission.grid_ns,
        velocity_errors=VelocityErrors(
            dvl.scale_factor_sd,
            np.asarray(dvl.beam_bias_sd_mps**2 * np.linalg.inv(B.T @ B)),
            _change(mission),
        ),
        attitude_errors=_attitude_errors(mission),
        omega_p_radps=mission.imu.omega_p_radps[
            np.searchsorted(mission.imu.time_ns, mission.grid_ns, side="right") - 1
        ],
        lever_p_m=np.asarray(geometry.lever_arms_p_m).mean(axis=0),
        depth=DepthAid(
            Depths(mission.grid_ns, _latest(mission.depth, mission.grid_ns)),
            float(np.hypot(model.depth.sd_m, model.depth.bias_sd_m)),
            np.asarray(mission.options.depth_lever_p_m),
        ),
    )
    return Estimates(
        time_ns=mission.grid_ns,
        velocity_p_mps=reckoned.velocity_p_mps,
        velocity_cov=reckoned.velocity_cov_m2ps2,
        position_t_m=reckoned.position_t_m,
        position_cov=reckoned.position_cov_m2,
        attitude_t_p=quaternions(reckoned.attitude),
        wall_s=time.perf_counter() - began,
    )


def _velocities(mission: Mission) -> Velocities:
    """Of the pings whose beams determine one."""
    pings = mission.pings
    sd = np.full(mission.geometry.beams, mission.model.dvl.beam_noise_sd_mps)
    values = np.where(pings.valid, pings.velocity_mps, 0.0)
    fixes = solve_velocity(mission.geometry, values, pings.valid, method="lc", beam_sd_mps=sd)
    whole = fixes.status == STATUS.index("fix")
    return Velocities(pings.time_ns[whole], fixes.velocity_p_mps[whole], fixes.cov_m2ps2[whole])


def _attitude(mission: Mission) -> tuple[Times, Rotation]:
    """The start turned by the gyros, less the Earth's rate, with the yaw of the latest heading."""
    imu, start, environment = mission.imu, mission.start, mission.model.environment
    after = imu.time_ns > start.time_ns
    times = np.concatenate([[start.time_ns], imu.time_ns[after]])
    step_s = np.diff(times)[:, None] * 1e-9
    latitude = environment.latitude_rad
    earth = environment.earth_rate_radps * np.array([np.cos(latitude), 0.0, -np.sin(latitude)])
    turns = Rotation.from_rotvec(imu.omega_p_radps[after] * step_s).as_matrix()
    back = Rotation.from_rotvec(-earth * step_s).as_matrix()
    C = np.empty((len(times), 3, 3))
    C[0] = from_quaternions(start.attitude_t_p).as_matrix()
    for k in range(len(turns)):
        C[k + 1] = back[k] @ C[k] @ turns[k]
    heading = mission.heading
    if mission.model.heading is None or not len(heading.time_ns):
        return times, Rotation.from_matrix(C)
    yaw = np.unwrap(np.arctan2(C[:, 1, 0], C[:, 0, 0]))
    off = heading.value - np.interp(heading.time_ns, times, yaw)
    off = (off + np.pi) % (2.0 * np.pi) - np.pi
    latest = np.searchsorted(heading.time_ns, times, side="right")
    correction = np.concatenate([[0.0], off])[latest]
    return times, Rotation.from_euler("z", correction[:, None]) * Rotation.from_matrix(C)


def _attitude_errors(mission: Mission) -> AttitudeErrors:
    """Level of the start; of the yaw the heading sensor's slow errors, and its noise, held until the next reading."""
    level, _, yaw = mission.model.initial.attitude_sd_rad
    if mission.model.heading is None or len(mission.heading.time_ns) < 2:
        return AttitudeErrors(offset_sd_rad=(level, level, yaw))
    heading = mission.model.heading
    return AttitudeErrors(
        offset_sd_rad=(level, level, heading.offset_sd_rad),
        walk_sd_rad=(0.0, 0.0, heading.walk_sd_rad),
        white_sd_rad=(0.0, 0.0, heading.sd_rad),
        walk_time_s=heading.walk_time_s,
        white_held_s=float(np.median(np.diff(mission.heading.time_ns))) * 1e-9,
    )


def _change(mission: Mission) -> StructureFunction:
    """A random walk of the velocity, by its uncertainty at the start in each second: nothing of it is measured yet."""
    rate = float(np.max(mission.model.initial.velocity_sd_mps)) ** 2
    usual_s = float(np.median(np.diff(mission.pings.time_ns))) * 1e-9
    ends = np.array([0.0, LONGEST_HOLD_S])
    return StructureFunction(ends, np.repeat(rate * ends[:, None], 3, axis=1), usual_s)


def _latest(readings: Scalars, time_ns: Times) -> Floats:
    """The latest reading at each time; the first before it."""
    row = np.maximum(np.searchsorted(readings.time_ns, time_ns, side="right") - 1, 0)
    return readings.value[row]
