"""Sigma of a filter on water alone: docs/observability.md, "Water track". One straight-and-turning dive of half an hour.

Covariances depend on no noise that is drawn. The bottom and the water return in turns for a minute, then the water.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.kernel import Navigator
from bottomlock.kernel.models import CurrentLayers
from bottomlock.simulation.build import build_simulation
from bottomlock.simulation.run_events import Readings
from tests.imu_blocks import measured

Floats = NDArray[np.float64]

LOCK_S, DURATION_S = 60, 1860
STEADY_S = 1e9
CURRENT_T_MPS = np.array([0.2, 0.1, 0.0])


class Sigmas(NamedTuple):
    """Standard deviations at `time_s` (n,): SI, tangent axes; of tilt and accelerometer bias the larger axis."""

    time_s: Floats
    position: Floats
    velocity: Floats
    current: Floats
    through_water: Floats
    tilt: Floats
    accel_bias: Floats


@cache
def sigmas(*, current_sd_mps: float = 0.3, current_time_s: float = STEADY_S, bottom: bool = False) -> Sigmas:
    """Of `tc` with a tactical IMU along legs, turns and dives; with `bottom` it is never lost."""
    content = load_scenario("straight").model_dump(exclude_unset=True)
    content.pop("mission")
    motion = {"dive_angle_deg": 10.0, "dive_s": 60.0, "leg_s": 120.0, "turn_s": 20.0}
    motion |= {"kind": "lawn_mower", "source": "analytic", "duration_s": float(DURATION_S)}
    scenario = Scenario.model_validate(content | {"imu": {"grade": "tactical"}, "trajectory": motion})
    simulation = build_simulation(scenario)
    truth = simulation.truth()
    options = scenario.kernel_options()
    options = options.replace(
        water_track=True,
        water=options.water.replace(current_sd_mps=current_sd_mps, current_time_s=current_time_s),
        current_layers=CurrentLayers(sd_mps=0.0),
        gate="off",
    )
    readings = Readings(simulation, truth, run=0)
    drawn: Any = readings._drawn
    navigator = Navigator(simulation.geometry, readings._model, options, drawn["initial"], method="tc")
    attitude = Rotation.from_quat(truth.attitude_t_p, scalar_first=True)
    beams = simulation.geometry.beams
    sd, every = np.full(beams, scenario.dvl.beam_noise_mps), np.ones(beams, dtype=bool)
    rows: list[tuple[float, ...]] = []
    for k, time_ns in measured(navigator, drawn, drawn["dvl_time_ns"]):
        beam_mps = drawn["dvl_velocity_mps"][k]
        at = int(np.searchsorted(truth.time_ns, time_ns))
        if bottom or (time_ns <= LOCK_S * 1e9 and k % 2 == 0):
            navigator.push_beams(time_ns, beam_mps, every, sd_mps=sd)
        else:
            along = simulation.geometry.beam_velocities([attitude[at].inv().apply(CURRENT_T_MPS)])[0]
            navigator.push_water_track(time_ns, beam_mps - along, every, sd_mps=sd)
        if time_ns % 60_000_000_000 == 0:
            rows.append((time_ns * 1e-9, *_of(navigator)))
    return Sigmas(*np.array(rows).T)


def _of(navigator: Navigator) -> tuple[float, ...]:
    cov, water = np.asarray(navigator.covariance()), navigator.water()
    assert water is not None
    R = Rotation.from_quat(np.asarray(navigator.state()["attitude_t_p"]), scalar_first=True).as_matrix()
    velocity_t = R @ cov[6:9, 6:9] @ R.T
    sd = np.sqrt(np.diag(cov))
    current = np.sqrt(np.diag(np.asarray(water["current_covariance"]))[:2].max())
    return (
        sd[0], float(np.sqrt(velocity_t[0, 0])), float(current), float(np.sqrt(velocity_t[2, 2])),
        float(sd[3:5].max()), float(sd[9:11].max()),
    )  # fmt: skip
