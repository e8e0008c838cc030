"""Sigma of a filter on water alone: docs/observability.md, "Water track". A dive with turns of half an hour.

Covariances depend on no noise that is drawn. The bottom and the water return in turns for a minute, then the water.
"""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.kernel import Navigator
from bottomlock.kernel.models import CurrentLayers
from bottomlock.simulation.build import Simulation, build_simulation
from bottomlock.truth import Truth
from tests.dive import gauss_markov
from tests.imu_blocks import measured
from tests.run_events import Readings

Floats = NDArray[np.float64]

LOCK_S, DURATION_S = 60, 1860
STEADY_S = 1e9
ESTIMATED = dict.fromkeys(
    (
        "gyro_scale_ppm", "gyro_misalignment_mrad", "gyro_g_sensitivity_deg_per_h_per_g", "accel_scale_ppm",
        "accel_warm_up_mg", "gyro_warm_up_deg_per_h",
    ), 0.0,
)  # fmt: skip
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
def dive() -> tuple[Scenario, Simulation, Truth, Readings]:
    """A tactical IMU along legs, turns and dives, of errors that its filter estimates alone."""
    content = load_scenario("straight").model_dump(exclude_unset=True)
    content.pop("mission")
    motion: dict[str, Any] = {"dive_angle_deg": 10.0, "dive_s": 60.0, "leg_s": 120.0, "turn_s": 20.0}
    motion |= {"kind": "lawn_mower", "source": "analytic", "duration_s": float(DURATION_S)}
    scenario = Scenario.model_validate(
        content | {"imu": {"grade": "tactical", "rate_hz": 50.0} | ESTIMATED, "trajectory": motion}
    )
    simulation = build_simulation(scenario)
    truth = simulation.truth()
    return scenario, simulation, truth, Readings(simulation, truth, run=0)


@cache
def sigmas(*, current_sd_mps: float = 0.3, current_time_s: float = STEADY_S, bottom: bool = False) -> Sigmas:
    """Of `tc` along the dive; with `bottom` it is never lost."""
    scenario, simulation, truth, readings = dive()
    options = scenario.kernel_options()
    options = options.replace(
        water_track=True,
        water=options.water.replace(current_sd_mps=current_sd_mps, current_time_s=current_time_s),
        current_layers=CurrentLayers(sd_mps=0.0),
        gate="off",
    )
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


@pytest.mark.parametrize(("sd_mps", "time_s"), [(0.3, 7200.0), (0.1, 1800.0)])
def test_a_current_that_changes_leaves_them_bounded(sd_mps: float, time_s: float) -> None:
    """Its noise is noise of v − Rᵀc. Seen: tilt and bias at most 8 % above the bottom's, and the down axis as there."""
    water, bottom = sigmas(current_sd_mps=sd_mps, current_time_s=time_s), sigmas(bottom=True)
    for name in ("tilt", "accel_bias"):
        ratio = getattr(water, name) / getattr(bottom, name)
        assert (ratio[1:] > 0.999).all()
        assert (ratio[1:] < 1.12).all(), name
    np.testing.assert_allclose(water.through_water[1:], bottom.through_water[1:], rtol=4e-3)


@pytest.mark.parametrize(("sd_mps", "time_s"), [(0.3, 7200.0), (0.1, 1800.0)])
def test_velocity_and_current_grow_together(sd_mps: float, time_s: float) -> None:
    """What v has besides is the yaw's part, as with the bottom. Seen: sqrt(σ_v² − σ_c²) from 0.021 to 0.034 m/s."""
    water = sigmas(current_sd_mps=sd_mps, current_time_s=time_s)
    assert (np.diff(water.current[1:]) > 0.0).all()
    assert water.current[-1] > 3.0 * water.current[0]
    apart = np.sqrt(water.velocity**2 - water.current**2)
    assert (apart > 0.015).all()
    assert (apart < 0.04).all()


def of_any_time(sd_mps: float, time_s: float, start_sd_mps: float, after_s: Floats) -> Floats:
    """The same of a first-order process: σ_c0² τ² (1 − e⁻ˣ)² + σ² τ² (2x − 3 + 4e⁻ˣ − e⁻²ˣ), x = T/τ."""
    x = after_s / time_s
    left = np.exp(-x)
    known = (start_sd_mps * time_s * (1.0 - left)) ** 2
    found: Floats = np.sqrt(
        known + (sd_mps * time_s) ** 2 * np.maximum(2.0 * x - 3.0 + 4.0 * left - left**2, 0.0)
    )
    return found


@pytest.mark.parametrize(("sd_mps", "time_s"), [(0.3, 7200.0), (0.1, 1800.0)])
def test_the_position_follows_the_integral_of_the_current(sd_mps: float, time_s: float) -> None:
    """From five minutes on, when the yaw's part is small beside it. Seen: 0.967 to 0.990 of the formula.

    It is not reached: an INS that knows its tilt tells some of the current's change from the vehicle's acceleration.
    """
    water = sigmas(current_sd_mps=sd_mps, current_time_s=time_s)
    after_s = water.time_s - water.time_s[0]
    claimed = np.hypot(of_any_time(sd_mps, time_s, water.current[0], after_s), water.position[0])
    late = after_s >= 300.0
    ratio = water.position[late] / claimed[late]
    assert (ratio < 1.0).all(), ratio
    assert (ratio > 0.95).all(), ratio


def test_the_integral_of_a_first_order_process_by_simulation() -> None:
    """Ten thousand draws of a current that begins known to 0.03 m/s: the formula within 3 %."""
    draw, step_s, sd_mps, time_s = np.random.default_rng(1), 10.0, 0.3, 1800.0
    sd = np.array([[0.03], *[[sd_mps]] * 180])
    current = gauss_markov(sd * draw.standard_normal((181, 10_000)), step_s, time_s)
    moved = np.trapezoid(current, dx=step_s, axis=0)
    found = of_any_time(sd_mps, time_s, 0.03, np.array([1800.0]))
    np.testing.assert_allclose(np.std(moved), found[0], rtol=0.03)
