"""How far the sigmas of a slower covariance are from a second-order reference at every step; the table of the docs.

    python -m benches.covariance_rate

Perfect sensors, so that only the propagation differs; the filter assumes Table 2. The reference propagates at every IMU
step with the second-order transition (a covariance period of 1 ns).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bottomlock import kernel
from bottomlock.simulation.measurement_schedule import measurement_schedule
from tests.analytic import analytic_simulation

RATE_HZ, SECONDS = 150, 250
PERIODS_NS = {
    "150 Hz, first order": 0,
    "50 Hz": 20_000_000,
    "10 Hz": 100_000_000,
    "5 Hz": 200_000_000,
    "1 Hz": 1_000_000_000,
}
BLOCKS = {"position": slice(0, 3), "misalignment": slice(3, 6), "velocity": slice(6, 9)}
Vectors = NDArray[np.float64]


def rough_truth(gravity_mps2: float, earth_t_radps: Vectors) -> dict[str, Any]:
    """Waves: 8 deg of roll and 4 deg of pitch, shaken by 0.5 deg at 3 Hz, yawing 20 deg at 0.05 Hz."""
    fine = 8
    dt = 1.0 / (RATE_HZ * fine)
    t = np.arange(SECONDS * RATE_HZ * fine + 1) * dt
    turn = 2.0 * np.pi * t
    roll = np.deg2rad(8.0 * np.sin(0.2 * turn) + 0.5 * np.sin(3.0 * turn))
    pitch = np.deg2rad(4.0 * np.sin(0.25 * turn) + 0.5 * np.cos(3.1 * turn))
    yaw = np.deg2rad(20.0 * np.sin(0.05 * turn))
    attitude = Rotation.from_euler("ZYX", np.stack([yaw, pitch, roll], axis=1))
    velocity = np.stack(
        [2.0 + 0.2 * np.sin(0.2 * turn), 0.1 * np.sin(0.25 * turn), 0.1 * np.cos(0.2 * turn)], axis=1
    )
    rate_tp = (attitude[:-1].inv() * attitude[1:]).as_rotvec() / dt
    rate_tp = np.vstack([rate_tp[:1], 0.5 * (rate_tp[:-1] + rate_tp[1:]), rate_tp[-1:]])
    earth_p = attitude.inv().apply(earth_t_radps)
    acceleration = np.gradient(velocity, dt, axis=0, edge_order=2)
    gravity_p = attitude.inv().apply([0.0, 0.0, gravity_mps2])
    force = acceleration + np.cross(rate_tp + 2.0 * earth_p, velocity) - gravity_p
    position = np.cumsum(attitude.apply(velocity) * dt, axis=0)
    quaternion = attitude.as_quat()[:, [3, 0, 1, 2]]
    pick = slice(None, None, fine)
    return {
        "time_ns": np.round(t[pick] * 1e9).astype(np.int64),
        "position_t_m": np.ascontiguousarray((position - position[0])[pick]),
        "attitude_t_p": np.ascontiguousarray(quaternion[pick]),
        "velocity_p_mps": np.ascontiguousarray(velocity[pick]),
        "omega_p_radps": np.ascontiguousarray((rate_tp + earth_p)[pick]),
        "force_p_mps2": np.ascontiguousarray(force[pick]),
    }


def quiet(model: dict[str, Any]) -> dict[str, Any]:
    """The same model with sensors that have no errors; inputs of the filter stay as they are."""
    silent = ("noise", "_sd", "walk")
    return {
        block: {
            key: np.zeros_like(value) if any(s in key for s in silent) else value
            for key, value in fields.items()
        }
        if isinstance(fields, dict)
        else fields
        for block, fields in model.items()
    }


def main() -> None:
    """Fly and print."""
    simulation = analytic_simulation("figure_eight", duration_s=float(SECONDS))
    scenario = simulation.scenario
    smooth = simulation.truth()
    model = scenario.kernel_model(simulation.gravity_mps2)
    latitude = model.environment.latitude_rad
    earth = 7.292115e-5 * np.array([np.cos(latitude), 0.0, -np.sin(latitude)])
    rough = rough_truth(simulation.gravity_mps2, earth)
    truths = {
        "smooth": (smooth.kernel_arrays(), "instantaneous"),
        "rough": (rough, "instantaneous"),
        "rough, averaged samples": (rough, "averaged"),
    }
    epochs = measurement_schedule(simulation, smooth)
    print("| motion | aiding | covariance | " + " | ".join(BLOCKS) + " |\n|---" * 1 + "|---" * 5 + "|")
    for motion, (truth, sampling) in truths.items():
        for method in ("ins", "tc"):

            def sd(
                period_ns: int, method: str = method, truth: dict[str, Any] = truth, sampling: str = sampling
            ) -> Vectors:
                options = scenario.kernel_options().replace(
                    covariance_period_ns=period_ns, gate="off", imu_sampling=sampling
                )
                batch = kernel.run_batch(
                    geometry=simulation.geometry, truth=truth, simulated=quiet(model), assumed=model, options=options,
                    schedule=epochs, methods=[method], seed=1, trajectory_key=2, first_run=0, runs=1, threads=1,
                )  # fmt: skip
                return np.asarray(batch["sd"])[0, 0]

            reference = sd(1)
            for name, period_ns in PERIODS_NS.items():
                off = np.abs(sd(period_ns) / reference - 1.0)
                worst = " | ".join(f"{off[:, block].max():.1e}" for block in BLOCKS.values())
                print(
                    f"| {motion} | {'four beams at 1 Hz' if method == 'tc' else 'none'} | {name} | {worst} |"
                )


if __name__ == "__main__":
    main()
