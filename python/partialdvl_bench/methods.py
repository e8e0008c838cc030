"""Our methods on a mission: the kernel's replay of the readings, and for the current the navigator itself."""

import importlib
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from bottomlock import METHODS, DataError, DepthModel, DvlModel, Navigator, replay_log
from bottomlock.kernel import Method
from bottomlock.own_method import DEAD_RECKONING
from bottomlock.recordings.streams import WaterBeams
from bottomlock.support.nearest import did_you_mean
from partialdvl_bench import dead_reckoning
from partialdvl_bench.mission import Estimates, Mission, initial_state

Estimator = Callable[[Mission], Estimates]

POSITION, VELOCITY = slice(0, 3), slice(6, 9)
"""Error states of position and velocity in the kernel's covariance."""
WITH_CURRENT = ("sway_current", "consistent")
"""Methods with the current as states, of which `consistent` has it while the filter that it selects does.

With water track every method has it but `ins`.
"""


def estimate(mission: Mission, method: str) -> Estimates:
    """One of our methods along a mission, each estimate from the readings up to its time.

    Raises:
        KernelError: for an unknown method.
    """
    estimates = replayed(mission, method)
    with_current = method in WITH_CURRENT or (mission.water is not None and method != "ins")
    current, current_cov = currents(mission, method) if with_current else (None, None)
    return replace(estimates, current_t_mps=current, current_cov=current_cov)


def replayed(mission: Mission, method: str) -> Estimates:
    """One of our methods along a mission without its current.

    Raises:
        KernelError: for an unknown method.
    """
    log: Any = {
        "imu_time_ns": mission.imu.time_ns,
        "omega_p_radps": mission.imu.omega_p_radps,
        "force_p_mps2": mission.imu.force_p_mps2,
        "dvl_time_ns": mission.pings.time_ns,
        "beam_velocity_mps": mission.pings.velocity_mps,
        "beam_valid": mission.pings.valid,
        "depth_time_ns": mission.depth.time_ns,
        "depth_m": mission.depth.value,
        "heading_time_ns": mission.heading.time_ns,
        "heading_rad": mission.heading.value,
    }
    water = mission.water
    if water is not None:
        log |= {
            "water_track_time_ns": water.time_ns,
            "water_track_velocity_mps": np.where(water.valid, water.velocity_mps, 0.0),
            "water_track_valid": water.valid,
            "water_track_sd_mps": water.sd_mps,
            "water_track_range_m": water.range_m,
        }
    began = time.perf_counter()
    result = replay_log(
        mission.geometry, mission.model, mission.options, [method], log, initial_state(mission),
        sample_time_ns=mission.grid_ns, covariances=True, threads=1,
    )  # fmt: skip
    wall_s = time.perf_counter() - began
    cov = result["covariance"][0]
    return Estimates(
        time_ns=mission.grid_ns,
        velocity_p_mps=result["velocity_p_mps"][0],
        velocity_cov=cov[:, VELOCITY, VELOCITY],
        position_t_m=result["position_t_m"][0],
        position_cov=cov[:, POSITION, POSITION],
        attitude_t_p=result["attitude_t_p"][0],
        wall_s=wall_s,
    )


def currents(mission: Mission, method: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The current (n, 2) and its covariance (n, 2, 2) at the times of the grid, from a navigator that is fed.

    NaN where the filter whose answer the method gives has no current.
    """
    navigator = Navigator(
        mission.geometry, mission.model, mission.options, initial_state(mission), method=cast(Method, method)
    )
    assert mission.model.heading is not None  # every mission has a heading sensor
    sd_mps = np.full(mission.geometry.beams, mission.model.of(DvlModel).beam_noise_sd_mps)
    value, cov = np.full((len(mission.grid_ns), 2), np.nan), np.full((len(mission.grid_ns), 2, 2), np.nan)
    done = 0
    pings, depth, heading = mission.pings, mission.depth, mission.heading
    water_pings = mission.water
    rows = {"pings": 0, "water": 0, "depth": 0, "heading": 0}
    for k, now_ns in enumerate(mission.grid_ns):
        upto = int(np.searchsorted(mission.imu.time_ns, now_ns, side="right"))
        block = slice(done, upto)
        navigator.push_imu_block(
            mission.imu.time_ns[block],
            omega_p_radps=mission.imu.omega_p_radps[block],
            force_p_mps2=mission.imu.force_p_mps2[block],
        )
        done = upto
        for row in _due(rows, "pings", pings.time_ns, now_ns):
            velocity = np.where(pings.valid[row], pings.velocity_mps[row], 0.0)
            navigator.push_beams(int(pings.time_ns[row]), velocity, pings.valid[row], sd_mps=sd_mps)
        if water_pings is not None:
            for row in _due(rows, "water", water_pings.time_ns, now_ns):
                _push_water(navigator, water_pings, row)
        for row in _due(rows, "depth", depth.time_ns, now_ns):
            navigator.push_depth(
                int(depth.time_ns[row]), float(depth.value[row]), sd_m=mission.model.of(DepthModel).sd_m
            )
        for row in _due(rows, "heading", heading.time_ns, now_ns):
            navigator.push_heading(
                int(heading.time_ns[row]), float(heading.value[row]), sd_rad=mission.model.heading.sd_rad
            )
        water = navigator.water()
        if water is not None:
            value[k], cov[k] = water["current_t_mps"], water["current_covariance"]
    return value, cov


def _push_water(navigator: Navigator, water: WaterBeams, row: int) -> None:
    """One ping that the water returned."""
    velocity = np.where(water.valid[row], water.velocity_mps[row], 0.0)
    navigator.push_water_track(
        int(water.time_ns[row]), velocity, water.valid[row],
        sd_mps=water.sd_mps[row], range_m=float(water.range_m[row]),
    )  # fmt: skip


def _due(rows: dict[str, int], sensor: str, times: NDArray[np.int64], now_ns: np.int64) -> range:
    """Rows of a sensor that have come up to now and were not given before."""
    first, rows[sensor] = rows[sensor], int(np.searchsorted(times, now_ns, side="right"))
    return range(first, rows[sensor])


def without_water(mission: Mission) -> Mission:
    """The mission of a DVL that has no water track."""
    return replace(mission, water=None, options=mission.options.replace(water_track=False))


def tc_without_water(mission: Mission) -> Estimates:
    """`tc` where the water's beams are not used: what they are worth is the difference."""
    return estimate(without_water(mission), "tc")


def sway_current_without_water(mission: Mission) -> Estimates:
    """`sway_current` where the water's beams are not used."""
    return estimate(without_water(mission), "sway_current")


def estimator(name: str) -> tuple[str, Estimator]:
    """An estimator by its name: one of our methods, or NAME=MODULE:FUNCTION of another, with a name for the tables.

    Raises:
        DataError: for what is neither, and a module or function that cannot be imported.

    Examples:
        >>> estimator("tc")[0]
        'tc'
    """
    if name in METHODS:
        return name, partial(estimate, method=name)
    if name == DEAD_RECKONING:
        return name, dead_reckoning.estimate
    label, _, place = name.rpartition("=")
    module, _, function = place.partition(":")
    if not function:
        known = (*METHODS, DEAD_RECKONING)
        raise DataError(
            f"unknown method '{name}'{did_you_mean(name, known)} (known: {', '.join(known)}), nor is it a rival, "
            "NAME=MODULE:FUNCTION"
        )
    try:
        found = getattr(importlib.import_module(module), function)
    except (ImportError, AttributeError) as error:
        raise DataError(
            f"rival '{name}': cannot be imported ({error}); is its folder on PYTHONPATH?"
        ) from error
    return label or function, found
