"""The kernel's functions with valid arguments of each, small enough that a call takes well under a millisecond."""

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from bottomlock import kernel
from tests.drawn_log import drawn_log
from tests.oracle import truth
from tests.property import settings

STEP_NS = 50_000_000
NONE = np.empty(0, dtype=np.int64)
JANUS = kernel.BeamGeometry.janus(0.52, configuration="+", lever_arms_p_m=np.tile([-1.8, 0.0, 0.1], (4, 1)))
THREE = kernel.BeamGeometry.from_angles(np.full(3, 0.4), np.array([0.0, 2.1, 4.2]))
MOTION = truth.make(yaw=truth.figure_eight_yaw, seconds=1.0, rate_hz=20.0)
MODEL: dict[str, Any] = settings.table_2() | {
    "dvl_outliers": {"outlier_fraction": 0.05, "outlier_factor": 20.0},
    "acoustic_position": {
        "sd_m": 1.0, "sd_per_range": 0.01, "transceiver_t_m": [0.0, 0.0, 0.0], "outlier_fraction": 0.1,
        "outlier_factor": 10.0,
    },
    "thrust": {
        "scale_sd": [0.1, 0.1, 0.0], "true_scale_error": 0.0, "slip_sd_mps": [0.02, 0.03, 0.0], "slip_time_s": 5.0,
        "noise_sd_mps": 0.01,
    },
}  # fmt: skip
"""Table 2 with every sensor."""
OPTIONS: dict[str, Any] = {
    **kernel.DEFAULT_OPTIONS, "imu_sampling": "averaged", "water_track": True, "thrust": "velocity",
    "levers": {key: [0.3, 0.0, -0.4] for key in kernel.DEFAULT_OPTIONS["levers"]},
}  # fmt: skip
OTHERS: dict[str, Any] = OPTIONS | {
    "imu_sampling": "instantaneous", "gate": "per_row", "covariance_period_ns": 0, "information_port": "full",
    "estimate_dvl": False, "thrust": "all",
}  # fmt: skip
START: dict[str, Any] = {
    "time_ns": 0, "position_t_m": np.zeros(3), "attitude_t_p": np.array([1.0, 0.0, 0.0, 0.0]),
    "velocity_p_mps": np.array([1.0, 0.0, 0.0]), "accel_bias_p_mps2": np.zeros(3), "gyro_bias_p_radps": np.zeros(3),
    "dvl_bias_mps": np.zeros(4), "dvl_scale_factor": 0.0,
}  # fmt: skip


@dataclass(frozen=True)
class Call:
    """A call.

    Attributes:
        name: of the function.
        make: the function, of a new object where it is the method of one.
        arguments: valid ones.
        may_lack: keys of the result whose numbers need not be finite.
        ignored: beginning of the places whose values the function does not read.
    """

    name: str
    make: Callable[[], Callable[..., Any]]
    arguments: dict[str, Any]
    may_lack: tuple[str, ...] = ()
    ignored: str = "-"


def function(
    name: str,
    of: Callable[..., Any],
    *may_lack: str,
    ignored: str = "-",
    **arguments: Any,  # noqa: ANN401
) -> Call:
    """A call of a function without a state."""
    return Call(name, lambda: of, arguments, may_lack, ignored)


def geometries() -> list[Call]:
    """Beams by each constructor, what they read, and pings solved."""
    common: dict[str, Any] = {
        "lever_arms_p_m": np.tile([0.5, 0.0, 0.1], (4, 1)), "mounting_rpy_rad": np.array([0.01, -0.02, 0.7]),
        "sound_speed_scale": 1.01,
    }  # fmt: skip
    angles: dict[str, Any] = {"tilt_rad": np.full(4, 0.4), "azimuth_rad": np.array([0.1, 1.6, 3.2, 4.7])}
    velocity = np.array([[1.5, -0.3, 0.0], [-1.0, 0.2, 0.1]])
    calls = [
        function("janus", kernel.BeamGeometry.janus, tilt_rad=0.4, configuration="x", **common),
        function("from_angles", kernel.BeamGeometry.from_angles, **angles, **common),
        function("BeamGeometry", kernel.BeamGeometry, directions_d=JANUS.directions_p, **common),
        function(
            "beam_velocities", JANUS.beam_velocities, velocity_p_mps=velocity, beam_bias_mps=np.full(4, 0.005),
            omega_tp_p_radps=np.array([[0.0, 0.01, 0.1]] * 2), scale_factor=0.003,
        ),
    ]  # fmt: skip
    for made in (JANUS, THREE):
        valid = np.arange(2 * made.beams).reshape(2, -1) % 3 > 0
        calls += [
            function(
                "solve_velocity", kernel.solve_velocity, "velocity_p_mps", "cov_m2ps2", geometry=made,
                velocity_mps=made.beam_velocities(velocity), valid=valid, method=method,
                beam_sd_mps=np.full(made.beams, 0.042), prior_velocity_p_mps=velocity + 0.1,
                prior_cov_m2ps2=np.tile(np.diag([0.01, 0.02, 0.01]), (2, 1, 1)), omega_tp_p_radps=np.zeros((2, 3)),
                virtual_beam_factor=1.0, nullified_sway_var_m2ps2=1e-3, weak_sway_var_m2ps2=2.0,
            )
            for method in kernel.FIX_METHODS
        ]  # fmt: skip
    return calls


@functools.cache
def schedule() -> dict[str, Any]:
    """Every sensor once or more within the motion."""
    epochs, lost = MOTION["time_ns"], np.ones((4, 4), dtype=bool)
    lost[1, 0] = False
    return {
        "dvl_time_ns": epochs[[4, 8, 12, 16]], "beam_valid": lost, "depth_time_ns": epochs[5::5],
        "depth_offset_m": np.full(len(epochs[5::5]), 0.01), "magnetometer_time_ns": epochs[6::6] + 77,
        "yaw_offset_rad": np.full(len(epochs[6::6]), 0.02), "gps_time_ns": epochs[7::7],
        "gps_received": np.array([True, False]), "acoustic_position_time_ns": epochs[9::9],
        "acoustic_position_received": np.array([True, True]), "sample_time_ns": epochs[[10, 20]],
    }  # fmt: skip


@functools.cache
def log_and_start() -> tuple[dict[str, Any], dict[str, Any]]:
    """The motion as a recorded log, and its start."""
    given: Any = {"truth": MOTION, "model": MODEL, "schedule": schedule()}
    streams = kernel.simulate_sensors(JANUS, **given, seed=1, trajectory_key=2, run=0)
    times = streams["magnetometer_time_ns"]
    log = drawn_log(
        streams, "gps", "acoustic_position", beam_sd_mps=np.full(streams["dvl_valid"].shape, 0.042),
        heading_time_ns=times, heading_rad=np.zeros(len(times)), attitude_time_ns=times,
        attitude_t_p=np.tile([1.0, 0.0, 0.0, 0.0], (len(times), 1)),
        acoustic_position_sd_m=np.full((len(streams["acoustic_position_time_ns"]), 3), 1.0),
    )  # fmt: skip
    return log, START | {key: streams["initial"][key] for key in list(START)[:4]}


def batches() -> list[Call]:
    """Runs of methods, streams of a run, a log, and vehicles side by side."""
    keys: dict[str, Any] = {"seed": 1, "trajectory_key": 2}
    world: dict[str, Any] = {"geometry": JANUS, "simulated": MODEL, "assumed": MODEL}
    log, start = log_and_start()
    lacking = ("nis_mean", "final_bias_error", "final_bias_sd")
    calls = []
    for options, methods in ((OPTIONS, ["tc", "sway_current"]), (OTHERS, ["elc", "weak_sway"])):
        calls += [
            function(
                "run_batch", kernel.run_batch, *lacking, truth=MOTION, options=options, schedule=schedule(),
                methods=methods, first_run=0, runs=1, threads=1, **world, **keys,
            ),
            function(
                "replay_log", kernel.replay_log, "nis", "innovation_mps", "innovation_sd_mps", "beam_weight",
                "current_t_mps", "current_covariance", geometry=JANUS, model=MODEL, options=options, methods=methods,
                log=log, start=start, sample_time_ns=np.array([500_000_000, 1_000_000_000]), smooth=True,
                covariances=True, threads=1, covariance=np.diag(np.full(20, 0.01)),
            ),
        ]  # fmt: skip
    streams: dict[str, Any] = {
        "geometry": JANUS,
        "truth": MOTION,
        "model": MODEL,
        "schedule": schedule(),
        "run": 3,
    }
    streams |= {"imu_sampling": "averaged", "options": OPTIONS} | keys
    lost = "dvl_velocity_mps"
    calls.append(Call("simulate_sensors", lambda: kernel.simulate_sensors, streams, (lost,), "options."))
    begin = {key: MOTION[key][:1] for key in ("position_t_m", "attitude_t_p", "velocity_p_mps")}
    loop = world | keys | {
        "options": OPTIONS, "methods": ["tc"], "start": begin | {"time_ns": 0}, "vehicle_per_method": False,
        "first_run": 0, "threads": 1,
    }  # fmt: skip
    part = {key: values[None, :6] for key, values in MOTION.items() if key != "time_ns"}
    times = MOTION["time_ns"]
    segment = {
        "truth": part | {"time_ns": times[:6]},
        "schedule": {
            "dvl_time_ns": times[3:4], "beam_valid": np.ones((1, 4), dtype=bool), "depth_time_ns": times[2:3],
            "magnetometer_time_ns": NONE, "gps_time_ns": NONE, "sample_time_ns": times[5:6],
        },
    }  # fmt: skip
    calls += [
        function("ClosedLoop", kernel.ClosedLoop, **loop),
        Call("advance", lambda: kernel.ClosedLoop(**loop).advance, segment),
        Call("estimate", lambda: kernel.ClosedLoop(**loop).estimate, {"method": 0}),
    ]
    return calls


def navigators() -> list[Call]:
    """Navigators, and a push of each kind to one that has had two readings and a ping."""
    made: dict[str, Any] = {
        "geometry": JANUS, "model": MODEL, "initial": START, "covariance": np.diag(np.full(kernel.STATES, 0.01)),
    }  # fmt: skip
    calls = []
    for method, options in (("tc", OPTIONS), ("sway_current", OTHERS)):
        whole = made | {"method": method, "options": options}
        calls.append(function("Navigator", kernel.Navigator, **whole))
        calls += [
            Call(name, functools.partial(_push, whole, name), given) for name, given in pushes().items()
        ]
    return calls


def _push(whole: dict[str, Any], name: str) -> Callable[..., Any]:
    navigator = kernel.Navigator(**whole)
    first = pushes()
    for time_ns in (0, STEP_NS):
        navigator.push_imu(**first["push_imu"] | {"time_ns": time_ns})
    navigator.push_beams(**first["push_beams"] | {"time_ns": STEP_NS})
    push: Callable[..., Any] = getattr(navigator, name)
    return push


@functools.cache
def pushes() -> dict[str, dict[str, Any]]:
    """Valid arguments of every push, a step after the second reading."""
    three, force = np.array([0.3, -0.2, 0.1]), np.array([0.0, 0.0, -9.8])
    valid, beams = np.array([True, True, False, True]), np.array([0.4, -0.3, 0.1, 0.2])
    given: dict[str, dict[str, Any]] = {
        "push_imu": {"omega_p_radps": 0.1 * three, "force_p_mps2": force + 0.1 * three},
        "push_imu_block": {
            "time_ns": STEP_NS * np.arange(2, 5), "omega_p_radps": np.tile(0.1 * three, (3, 1)),
            "force_p_mps2": np.tile(force, (3, 1)),
        },
        "push_beams": {"velocity_mps": beams, "valid": valid, "sd_mps": np.full(4, 0.042)},
        "push_water_track": {"velocity_mps": beams, "valid": valid, "sd_mps": np.full(4, 0.06)},
        "push_velocity": {"velocity_p_mps": 0.5 * three, "cov_m2ps2": np.diag([0.01, 0.01, 0.02])},
        "push_depth": {"depth_m": 0.2, "sd_m": 0.1},
        "push_attitude": {
            "attitude_t_p": np.array([math.cos(0.1), 0.0, 0.0, math.sin(0.1)]), "roll_pitch_sd_rad": 0.02,
            "yaw_sd_rad": 0.1,
        },
        "push_heading": {"yaw_rad": 0.2, "sd_rad": 0.1},
        "push_gps": {
            "position_t_m": three, "velocity_t_mps": 0.1 * three, "position_sd_m": np.full(3, 2.0),
            "velocity_sd_mps": np.full(3, 0.1),
        },
        "push_thrust": {"speed_p_mps": 2.0 * three, "sd_mps": 0.02},
        "push_position": {"position_t_m": three, "position_sd_m": np.full(3, 2.0)},
        "push_acoustic_position": {"position_t_m": three, "sd_m": np.full(3, 1.0)},
    }  # fmt: skip
    return {name: {"time_ns": 2 * STEP_NS} | arguments for name, arguments in given.items()}
