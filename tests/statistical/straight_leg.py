"""A straight leg with fixes and attitudes beside beams, right or wrong: what is left at its end."""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from bottomlock import kernel
from bottomlock.kernel import Method
from bottomlock.kernel.models import MagnetometerModel, Robust
from bottomlock.simulation.measurement_schedule import measurement_schedule
from tests.analytic import analytic_simulation
from tests.drawn_log import drawn_log
from tests.oracle.rotations import Array

METHODS: list[Method] = ["tc", "sway_current"]
SD_M = 1.0
ROLL_PITCH_SD_RAD, YAW_SD_RAD = 0.005, 0.02

Readings = Callable[[np.random.Generator, dict[str, Array]], dict[str, Any]]
"""Columns of a log from what is true at each ping: `time_ns`, `time_s` since the first, `position_t_m` and
`attitude_t_p`."""


def fixes(fix_s: Array, off_m: Array | float = 0.0) -> Readings:
    """Fixes of `SD_M` at times, off along x."""

    def read(rng: np.random.Generator, true: dict[str, Array]) -> dict[str, Any]:
        rows = np.searchsorted(true["time_s"], fix_s)
        fixed = true["position_t_m"][rows] + SD_M * rng.normal(size=(len(rows), 3))
        return {
            "acoustic_position_time_ns": true["time_ns"][rows],
            "acoustic_position_t_m": fixed + np.outer(np.broadcast_to(off_m, len(rows)), [1.0, 0.0, 0.0]),
            "acoustic_position_sd_m": np.full((len(rows), 3), SD_M),
        }

    return read


def attitudes(at_s: Array, turned_rad: Array) -> Readings:
    """Attitudes at times, turned about north, east and down (n, 3)."""

    def read(rng: np.random.Generator, true: dict[str, Array]) -> dict[str, Any]:
        rows = np.searchsorted(true["time_s"], at_s)
        noise = [ROLL_PITCH_SD_RAD, ROLL_PITCH_SD_RAD, YAW_SD_RAD] * rng.normal(size=(len(rows), 3))
        attitude_t_p = Rotation.from_quat(true["attitude_t_p"][rows], scalar_first=True)
        read_t_p = Rotation.from_rotvec(turned_rad + noise) * attitude_t_p
        return {
            "attitude_time_ns": true["time_ns"][rows],
            "attitude_t_p": read_t_p.as_quat(scalar_first=True),
        }

    return read


def at_end(
    duration_s: float, mask: tuple[int, ...], has_depth: bool, readings: Readings, seed: int, runs: int
) -> tuple[Array, Array]:
    """(runs, M) position error at the end, m, and its sigma, of a leg with further readings."""
    simulation = analytic_simulation("straight", duration_s=duration_s)
    truth, scenario = simulation.truth(), simulation.scenario
    model = scenario.kernel_model(simulation.gravity_mps2)
    reference = MagnetometerModel(roll_pitch_sd_rad=ROLL_PITCH_SD_RAD, yaw_sd_rad=YAW_SD_RAD)
    model = model.replace(magnetometer=reference)
    options = scenario.kernel_options().replace(inflate_after_rejections=5, robust=Robust())
    arrays, schedule = truth.kernel_arrays(), dict[str, Any](measurement_schedule(simulation, truth))
    time_ns = schedule["dvl_time_ns"]
    schedule["beam_valid"] = np.ones((len(time_ns), 4), dtype=bool)
    if has_depth:
        schedule["depth_time_ns"] = time_ns[::4]
    rows = np.searchsorted(truth.time_ns, time_ns)
    true: dict[str, Any] = {
        "time_ns": time_ns, "time_s": (time_ns - time_ns[0]) * 1e-9,
        "position_t_m": arrays["position_t_m"][rows], "attitude_t_p": arrays["attitude_t_p"][rows],
    }  # fmt: skip
    valid = np.broadcast_to(np.isin(np.arange(1, 5), mask), (len(time_ns), 4))
    errors, claimed = [], []
    for run in range(runs):
        drawn: Any = kernel.simulate_sensors(
            simulation.geometry, arrays, model, schedule,  # type: ignore[arg-type]
            seed=seed, trajectory_key=0, run=run, imu_sampling=scenario.imu.sampling, options=options,
        )  # fmt: skip
        log = drawn_log(
            drawn,
            beam_velocity_mps=np.where(valid, drawn["dvl_velocity_mps"], np.nan),
            beam_valid=valid,
            **readings(np.random.default_rng([seed, run]), true),
        )
        out = kernel.replay_log(
            simulation.geometry, model, options, METHODS, log, drawn["initial"], sample_time_ns=time_ns[-1:]
        )
        errors.append(np.linalg.norm(out["position_t_m"][:, -1] - true["position_t_m"][-1], axis=-1))
        claimed.append(np.linalg.norm(out["sd"][:, -1, :3], axis=-1))
    return np.array(errors), np.array(claimed)
