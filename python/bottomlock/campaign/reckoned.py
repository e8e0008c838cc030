"""Dead reckoning of a chunk's runs, on the very readings that the filters have in the kernel.

Every reading of a run is drawn under the campaign's key, so that it is drawn again here, bit for bit.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bottomlock import kernel
from bottomlock.campaign.build import BuiltScenario
from bottomlock.dead_reckoning.sensors import Sensors, reckon
from bottomlock.kernel.models import InitialState, Model, Options
from bottomlock.own_method import DEAD_RECKONING
from bottomlock.recordings.streams import Attitudes, Depths
from bottomlock.simulation.build import trajectory_key

NOT_ESTIMATED = ("nees", "nees_velocity_attitude", "nis_mean", "final_bias_error", "final_bias_sd")
"""What a batch holds of a filter alone; NaN for dead reckoning."""


def with_reckoning(
    result: dict[str, Any],
    built: BuiltScenario,
    first_run: int,
    runs: int,
    schedule: Mapping[str, Any],
    model: Model,
    options: Options,
) -> dict[str, Any]:
    """The batch of the filters with dead reckoning in its place among the campaign's methods."""
    place = built.scenario.campaign.methods.index(DEAD_RECKONING)
    found = [_run(built, first_run + k, _of_run(schedule, k), model, options) for k in range(runs)]
    own: dict[str, Any] = dict(
        zip(("error", "sd"), (np.stack(part) for part in zip(*found, strict=True)), strict=True)
    )
    own |= dict.fromkeys(NOT_ESTIMATED, np.nan)
    own |= {"choice": kernel.NO_CHOICE}
    return {name: np.insert(values, place, own.get(name, 0), axis=1) for name, values in result.items()}


def _of_run(schedule: Mapping[str, Any], k: int) -> Any:  # noqa: ANN401 - the kernel's `ScheduleDict`
    """The schedule of one run, without the water: beams that are lost by chance differ between runs."""
    valid = schedule["beam_valid"]
    ground = {key: value for key, value in schedule.items() if not key.startswith("water_")}
    return {**ground, "beam_valid": valid[k] if valid.ndim == 3 else valid}


def _run(
    built: BuiltScenario,
    run: int,
    schedule: Any,  # noqa: ANN401 - the kernel's `ScheduleDict`
    model: Model,
    options: Options,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Errors, true minus estimate, and their 1 sigma, (samples, 9) each, in the order of the kernel's."""
    scenario, truth, geometry = built.scenario, built.truth, built.simulation.geometry
    arrays: Any = truth.kernel_arrays()
    drawn: dict[str, Any] = kernel.simulate_sensors(
        geometry, arrays, model, schedule, imu_sampling=scenario.imu.sampling, options=options,
        seed=scenario.campaign.seed, trajectory_key=trajectory_key(scenario.name), run=run,
    )  # fmt: skip
    compass = drawn["magnetometer_time_ns"]
    rows = np.searchsorted(truth.time_ns, schedule["sample_time_ns"])
    reckoned = reckon(
        geometry,
        model,
        InitialState(**drawn["initial"]),
        Sensors(
            imu_ns=drawn["imu_time_ns"],
            omega_p_radps=drawn["imu_omega_p_radps"],
            force_p_mps2=drawn["imu_force_p_mps2"],
            ping_ns=drawn["dvl_time_ns"],
            beam_mps=drawn["dvl_velocity_mps"],
            beam_valid=drawn["dvl_valid"],
            depths=Depths(drawn["depth_time_ns"], drawn["depth_m"]),
            attitudes=Attitudes(compass, _rotations(drawn["magnetometer_attitude_t_p"]))
            if len(compass)
            else None,
            heading_ns=drawn["heading_time_ns"],
            heading_rad=drawn["heading_rad"],
        ),
        truth.time_ns[rows],
        depth_lever_p_m=np.asarray(options.levers.depth_p_m),
    )
    error = np.hstack(
        [
            truth.position_t_m[rows] - reckoned.position_t_m,
            (_rotations(truth.attitude_t_p[rows]) * reckoned.attitude.inv()).as_rotvec(),
            truth.velocity_p_mps[rows] - reckoned.velocity_p_mps,
        ]
    )
    variances = [
        np.diagonal(cov, axis1=1, axis2=2) for cov in (reckoned.position_cov_m2, reckoned.velocity_cov_m2ps2)
    ]
    attitude = np.broadcast_to(reckoned.attitude_sd_rad, variances[0].shape)
    return error, np.hstack([np.sqrt(variances[0]), attitude, np.sqrt(variances[1])])


def _rotations(attitude_t_p: NDArray[np.float64]) -> Rotation:
    return Rotation.from_quat(attitude_t_p, scalar_first=True)
