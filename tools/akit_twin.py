"""The A-KIT sections with an exact truth: the recorded motion, with sensors simulated on it.

The truth is what the recorded inertial readings navigate to from the reference's first state. Every sensor is read on
it and given the errors that the case claims, so that a filter's errors are its own and not the reference's.
"""

from dataclasses import replace

import numpy as np
import polars as pl

from bottomlock.config.scenario_sections import ImuErrors
from bottomlock.kernel import EARTH_RATE_RADPS, local_earth
from bottomlock.recordings.axes import from_quaternions
from bottomlock.recordings.streams import Beams, Depths, ReferenceStates
from bottomlock.replay import rerun
from bottomlock.replay.case import Case
from bottomlock.replay.level import level_axes
from bottomlock.replay.random_errors import case_key
from bottomlock.replay.reading import read_streams
from bottomlock.replay.run import replay_case
from bottomlock.replay.streams import Streams

NO_ERRORS = ImuErrors(
    accel_bias_mg=0.0, gyro_bias_deg_per_h=0.0, accel_noise_mps_per_rt_h=0.0, gyro_noise_deg_per_rt_h=0.0
)
VELOCITY_NOISE_MPS = 0.01
"""White noise of a beam beside the closure's, as the cases assume it of the recorded velocity."""
READINGS_PER_SAMPLE = 100


def twin_runs(case: Case) -> pl.DataFrame:
    """The table of runs of a case whose streams are simulated on the recorded motion.

    Args:
        case: of `akit_case`, with depth, noise from a closure and drawn starts. Every draw has a seed of its own.
    """
    streams = exact_streams(case)
    assert case.depth is not None
    claimed = case.imu.errors
    case = case.model_copy(
        update={
            "imu": case.imu.model_copy(update={"errors": NO_ERRORS, "degrade": claimed}),
            "depth": case.depth.model_copy(update={"lever_arm_m": (0.0, 0.0, 0.0)}),
        }
    )
    parts = []
    for draw in range(case.replay.runs):
        one = case.with_overrides(runs=1, seed=case.replay.seed + draw)
        runs = replay_case(one, streams=_with_errors(one, streams)).runs
        parts.append(runs.with_columns(run=pl.lit(draw, dtype=pl.Int64)))
    return pl.concat(parts)


def exact_streams(case: Case) -> Streams:
    """The streams of a case, read without error on the path that its inertial readings navigate to."""
    recorded = read_streams(case)
    alone = case.model_copy(
        update={
            "depth": None,
            "replay": case.replay.model_copy(update={"methods": ("ins",), "smooth": False}),
            "start": case.start.model_copy(update={"draw": False}),
            "dvl": case.dvl.model_copy(update={"noise": type(case.dvl.noise)()}),
        }
    )
    prepared = rerun.prepare(alone, recorded, 0)
    imu_ns = recorded.inertial.time_ns
    time_ns = imu_ns[np.searchsorted(imu_ns, prepared.alignment.time_ns) :]
    states = rerun.run_methods(alone, replace(prepared, sample_time_ns=time_ns), None).result
    position, velocity = states["position_t_m"][0], states["velocity_p_mps"][0]
    attitude = from_quaternions(states["attitude_t_p"][0])
    pings = np.unique(np.searchsorted(time_ns, recorded.beams.time_ns).clip(0, len(time_ns) - 1))
    latitude = recorded.latitude_rad
    earth = EARTH_RATE_RADPS * np.array([np.cos(latitude), 0.0, -np.sin(latitude)])
    inertial_rate = recorded.inertial.omega_p_radps[np.searchsorted(imu_ns, time_ns[pings])]
    beams = recorded.instrument.geometry.beam_velocities(
        velocity[pings], omega_tp_p_radps=inertial_rate - attitude[pings].inv().apply(earth)
    )
    sd = np.tile(recorded.instrument.beam_sd_mps, (len(pings), 1))
    samples = slice(None, None, READINGS_PER_SAMPLE)
    # A recording's depth is below the sea, and its attitude against level and north, at the vehicle.
    environment = prepared.model.environment
    depth_m = local_earth(environment, position[samples])["depth_m"]
    of_place = level_axes(environment, position[samples]).inv() * attitude[samples]
    return replace(
        recorded,
        beams=Beams(time_ns[pings], np.asarray(beams), np.ones(beams.shape, dtype=np.bool_), sd),
        depths=Depths(time_ns[samples], np.asarray(depth_m)),
        reference=ReferenceStates(time_ns[samples], position[samples], velocity[samples], of_place),
    )


def _with_errors(case: Case, streams: Streams) -> Streams:
    """DVL and depth with errors drawn as the case claims them: scale, biases, white noise."""
    assert streams.depths is not None
    assert case.depth is not None
    draw = np.random.default_rng([case.replay.seed, case_key(case.name)])
    claimed, beams, depths = case.dvl.errors, streams.beams, streams.depths
    scale = 1.0 + 1e-2 * claimed.scale_factor_percent * draw.standard_normal()
    bias = claimed.beam_bias_mps * draw.standard_normal(beams.velocity_mps.shape[1])
    noise = VELOCITY_NOISE_MPS * draw.standard_normal(beams.velocity_mps.shape)
    depth_noise = case.depth.sd_m * draw.standard_normal(depths.depth_m.shape)
    return replace(
        streams,
        beams=replace(beams, velocity_mps=scale * beams.velocity_mps + bias + noise),
        depths=replace(depths, depth_m=depths.depth_m + depth_noise),
    )
