"""Runs whose beams err by Student's t of three degrees, and the same with Gaussian beams, run in several ways."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

import bottomlock
from bottomlock.kernel.models import DvlModel, Robust
from tests.analytic import analytic_simulation
from tests.oracle.rotations import Array, log_rotation, matrix_from_quaternion
from tests.statistical.ensembles import SEED

RUNS = 60
DEGREES = 3.0
WAYS: dict[str, dict[str, Any]] = {
    "gaussian": {"gate": "off"},
    "matched": {"gate": "off", "scale": np.sqrt(DEGREES / (DEGREES - 2))},
    "gated": {"gate": "joint"},
    "beam_gates": {"gate": "joint", "robust": Robust(tail="gaussian")},
    "student": {
        "gate": "off",
        "robust": Robust(closure_gate=None, beam_gate=None, student_t_degrees=DEGREES),
    },
}
"""Filter options by name; `scale` multiplies the noise that the filter assumes."""


@lru_cache(maxsize=8)
def streams(trajectory: str, *, heavy: bool, lost: tuple[int, ...]) -> tuple[Any, ...]:
    """World, model, samples, truth at the samples, and a (log, start) for every run."""
    simulation = analytic_simulation(trajectory)
    truth = simulation.truth()
    plan: Any = bottomlock.measurement_schedule(simulation, truth)
    model = simulation.scenario.kernel_model(simulation.gravity_mps2)
    scale = model.of(DvlModel).beam_noise_sd_mps
    silent = model.replace(dvl=model.of(DvlModel).replace(beam_noise_sd_mps=0.0))
    arrays: Any = truth.kernel_arrays()
    sample_ns = plan["sample_time_ns"][4::5]
    none: Any = np.empty(0, dtype=np.int64)
    runs = []
    for run in range(RUNS):
        drawn = bottomlock.simulate_sensors(
            simulation.geometry, arrays, silent, plan, seed=SEED, trajectory_key=17, run=run
        )
        rng = np.random.default_rng([SEED, run])
        shape = drawn["dvl_velocity_mps"].shape
        noise = rng.standard_t(DEGREES, shape) if heavy else rng.normal(size=shape)
        valid = np.ones(shape, dtype=bool)
        valid[:, [beam - 1 for beam in lost]] = False
        log = {
            "imu_time_ns": drawn["imu_time_ns"],
            "force_p_mps2": drawn["imu_force_p_mps2"],
            "omega_p_radps": drawn["imu_omega_p_radps"],
            "dvl_time_ns": drawn["dvl_time_ns"],
            "beam_velocity_mps": drawn["dvl_velocity_mps"] + scale * noise,
            "beam_valid": valid,
            "depth_time_ns": none,
            "depth_m": np.empty(0),
            "heading_time_ns": none,
            "heading_rad": np.empty(0),
            "attitude_time_ns": none,
            "attitude_rpy_rad": np.empty((0, 3)),
            "gps_time_ns": none,
            "gps_position_t_m": np.empty((0, 3)),
        }
        runs.append((log, drawn["initial"]))
    at = np.searchsorted(arrays["time_ns"], sample_ns)
    return (
        simulation,
        model,
        sample_ns,
        {key: arrays[key][at] for key in ("attitude_t_p", "velocity_p_mps")},
        runs,
    )


@lru_cache(maxsize=16)
def run_tc(trajectory: str, name: str, *, heavy: bool, lost: tuple[int, ...] = ()) -> tuple[Array, Array]:
    """Squared velocity error (runs, T) and NEES of attitude and velocity (runs, T) of TC run in one of `WAYS`."""
    way = WAYS[name]
    simulation, model, sample_ns, true, runs = streams(trajectory, heavy=heavy, lost=lost)
    options = simulation.scenario.kernel_options().replace(**{key: way[key] for key in way if key != "scale"})
    assumed = model.of(DvlModel).beam_noise_sd_mps * way.get("scale", 1.0)
    square, nees = [], []
    for log, start in runs:
        out: Any = bottomlock.replay_log(
            simulation.geometry,
            model.replace(dvl=model.of(DvlModel).replace(beam_noise_sd_mps=assumed)),
            options,
            ["tc"],
            log,
            start,
            sample_time_ns=sample_ns,
            covariances=True,
        )
        error = np.empty((len(sample_ns), 6))
        for k, quaternion in enumerate(out["attitude_t_p"][0]):
            turn = matrix_from_quaternion(true["attitude_t_p"][k]) @ matrix_from_quaternion(quaternion).T
            error[k, :3] = log_rotation(turn)
        error[:, 3:] = true["velocity_p_mps"] - out["velocity_p_mps"][0]
        P = out["covariance"][0, :, 3:9, 3:9]
        square.append((error[:, 3:] ** 2).sum(axis=1))
        nees.append(np.einsum("ti,ti->t", error, np.linalg.solve(P, error[..., None])[..., 0]))
    return np.array(square), np.array(nees)
