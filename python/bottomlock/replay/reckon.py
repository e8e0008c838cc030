"""Dead reckoning along a case: whole velocities of its pings, its attitude stream, and the errors that both claim."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from bottomlock.dead_reckoning.track import (
    FEWEST,
    AttitudeErrors,
    Begin,
    DepthAid,
    StructureFunction,
    Velocities,
    VelocityErrors,
    dead_reckon,
    structure_function,
    white_noise,
)
from bottomlock.kernel import STATUS, integrate_segments
from bottomlock.kernel.models import DvlModel
from bottomlock.recordings.axes import quaternions
from bottomlock.recordings.stream_sections import AttitudeStream, ImuStream
from bottomlock.recordings.streams import Attitudes, Flags, Floats, Inertial
from bottomlock.replay.beam_noise import measure_noise
from bottomlock.replay.case import Case
from bottomlock.replay.rerun import PreparedRun
from bottomlock.replay.robust_fix import screen_beams, solve_scaled

HOLE_S, CARRIED_S = 5.0, 0.2
"""Gap between attitudes that the gyros bridge, and the interval of what they make of it."""


def whole_velocities(prepared: PreparedRun, valid: Flags) -> Velocities:
    """Velocities by weighted least squares of the pings whose valid beams determine them, without outliers.

    The noise is that of the closure of the pings as recorded, or the claimed one where nothing measures it.

    Args:
        prepared: the run.
        valid: (E, B) which beams returned.
    """
    instrument, beams, pings = prepared.streams.instrument, prepared.streams.beams, prepared.pings
    times, values, sd = beams.time_ns[pings], beams.velocity_mps[pings], instrument.beam_sd_mps
    values = np.where(beams.valid[pings], values, 0.0)
    noise = measure_noise(instrument.geometry, values, beams.valid[pings], sd)
    screened = screen_beams(instrument.geometry, times, values, valid, sd, noise)
    fixes = solve_scaled(
        instrument.geometry, values, screened.valid, screened.factor, method="lc", beam_sd_mps=sd
    )
    whole = fixes.status == STATUS.index("fix")
    return Velocities(times[whole], fixes.velocity_p_mps[whole], fixes.cov_m2ps2[whole])


@dataclass(frozen=True, eq=False)
class FromLog:
    """What the whole velocities of a log as recorded show: how they change with time, and their noise, m²/s², (3,)."""

    change: StructureFunction
    noise_var_m2ps2: Floats


def measured(prepared: PreparedRun) -> FromLog | None:
    """Change and noise of the velocity, from all pings as recorded; None for too few whole ones.

    The noise is what is white from ping to ping, where that is more than the beams claim.
    """
    whole = whole_velocities(prepared, prepared.streams.beams.valid[prepared.pings])
    if len(whole.time_ns) < FEWEST:
        return None
    claimed = np.median(np.diagonal(whole.cov_m2ps2, axis1=1, axis2=2), axis=0)
    noise_var = np.asarray(np.maximum(claimed, white_noise(whole.velocity_p_mps)))
    change = structure_function(whole.time_ns, whole.velocity_p_mps, noise_var)
    assert change is not None  # there are enough
    return FromLog(change, noise_var)


def _at_least(velocities: Velocities, noise_var_m2ps2: Floats) -> Velocities:
    """The velocities with no less noise than the log shows."""
    claimed = np.diagonal(velocities.cov_m2ps2, axis1=1, axis2=2)
    more = np.maximum(noise_var_m2ps2 - claimed, 0.0)
    return replace(velocities, cov_m2ps2=velocities.cov_m2ps2 + more[:, :, None] * np.eye(3))


def reckon(
    case: Case, prepared: PreparedRun, valid: Flags, log: FromLog | None
) -> Mapping[str, Floats] | None:
    """States of dead reckoning under the names of the kernel's; None without an attitude or what the log shows.

    Args:
        case: the case.
        prepared: the run.
        valid: (E, B) which beams returned.
        log: of `measured`.
    """
    attitudes, alignment = prepared.streams.attitudes, prepared.alignment
    if case.attitude is None or attitudes is None or len(attitudes.time_ns) < 2 or log is None:
        return None
    dvl, instrument = prepared.model.of(DvlModel), prepared.streams.instrument
    B = np.asarray(instrument.geometry.directions_p)
    depths, depth = prepared.streams.depths, case.depth
    if isinstance(case.imu, ImuStream):
        attitudes = carried(attitudes, prepared.readings)
    reckoned = dead_reckon(
        _at_least(whole_velocities(prepared, valid), log.noise_var_m2ps2),
        attitudes,
        Begin(
            alignment.time_ns,
            np.asarray(alignment.position_t_m),
            np.asarray(alignment.velocity_p_mps),
            np.asarray(alignment.position_sd_m),
            np.asarray(alignment.velocity_sd_mps),
        ),
        prepared.sample_time_ns,
        velocity_errors=VelocityErrors(
            dvl.scale_factor_sd, np.asarray(dvl.beam_bias_sd_mps**2 * np.linalg.inv(B.T @ B)), log.change
        ),
        attitude_errors=attitude_errors(case.attitude),
        lever_p_m=np.asarray(instrument.geometry.lever_arms_p_m).mean(axis=0),
        depth=None
        if depth is None or depths is None
        else DepthAid(depths, float(np.hypot(depth.sd_m, depth.bias_m)), np.array(depth.lever_arm_m)),
    )
    attitude_sd = np.broadcast_to(reckoned.attitude_sd_rad, reckoned.position_t_m.shape)
    sd = [
        np.sqrt(np.diagonal(P, axis1=1, axis2=2))
        for P in (reckoned.position_cov_m2, reckoned.velocity_cov_m2ps2)
    ]
    return {
        "position_t_m": reckoned.position_t_m,
        "attitude_t_p": quaternions(reckoned.attitude),
        "velocity_p_mps": reckoned.velocity_p_mps,
        "sd": np.concatenate([sd[0], attitude_sd, sd[1]], axis=1),
    }


def carried(attitudes: Attitudes, inertial: Inertial) -> Attitudes:
    """The attitudes with those that the gyros make of the reading before a hole, every `CARRIED_S` within it.

    What the gyros miss the reading after the hole by is spread evenly over it; after the last reading nothing is.
    """
    time_ns, C = attitudes.time_ns, attitudes.attitude
    ends_ns = np.append(time_ns[1:], max(int(inertial.time_ns[-1]) + 1, int(time_ns[-1])))
    holes = np.flatnonzero(ends_ns - time_ns > HOLE_S * 1e9)
    times, turns = [time_ns], [C]
    for k in holes:
        rows = slice(*np.searchsorted(inertial.time_ns, [time_ns[k], ends_ns[k]]))
        read_ns = inertial.time_ns[rows]
        if len(read_ns) < 2:
            continue
        segment = integrate_segments(
            read_ns, inertial.force_p_mps2[rows], inertial.omega_p_radps[rows], len(read_ns)
        )
        path = C[k] * Rotation.from_matrix(segment["rotation"][0])
        missed = (C[k + 1] * path[-1].inv()).as_rotvec() if k + 1 < len(C) else np.zeros(3)
        path = Rotation.from_rotvec(np.linspace(0.0, 1.0, len(read_ns))[:, None] * missed) * path
        kept = slice(1, -1, max(round(CARRIED_S / float(np.median(np.diff(read_ns)) * 1e-9)), 1))
        times.append(read_ns[kept])
        turns.append(path[kept])
    if len(times) == 1:
        return attitudes
    joined = np.concatenate(times)
    order = np.argsort(joined, kind="stable")
    return Attitudes(joined[order], Rotation.concatenate(turns)[order])


def attitude_errors(stream: AttitudeStream) -> AttitudeErrors:
    """What a case claims of its attitude: offset, walk and white noise; a 1 sigma alone is that of an offset.

    Errors of an attitude reference last. As white noise they would leave nothing of themselves on a way of minutes.
    """

    def axes(level_deg: float, yaw_deg: float) -> tuple[float, float, float]:
        level, yaw = np.deg2rad([level_deg, yaw_deg])
        return level, level, yaw

    single = axes(stream.roll_pitch_sd_deg, stream.yaw_sd_deg)
    offset = axes(stream.roll_pitch_offset_sd_deg, stream.yaw_constant_sd_deg)
    walk = axes(stream.roll_pitch_walk_sd_deg, stream.yaw_walk_sd_deg)
    # Level and yaw are claimed apart: one may have its slow part stated and the other not.
    slow = [o > 0.0 or w > 0.0 for o, w in zip(offset, walk, strict=True)]
    return AttitudeErrors(
        offset_sd_rad=[o if known else s for o, s, known in zip(offset, single, slow, strict=True)],
        walk_sd_rad=walk,
        white_sd_rad=[s if known else 0.0 for s, known in zip(single, slow, strict=True)],
        walk_time_s=stream.walk_time_s,
    )
