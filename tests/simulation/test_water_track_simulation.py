"""Simulated water track: its beams as a literal equation, a stream of its own, closed loop, scenarios."""

import itertools
from typing import Any

import numpy as np
import pytest

from bottomlock.kernel import ClosedLoop, KernelError, run_batch, simulate_sensors
from bottomlock.plant import Current
from bottomlock.simulation.build import Simulation, build_simulation
from bottomlock.simulation.measurement_schedule import MeasurementSchedule
from bottomlock.simulation.sensor_streams import sensor_streams
from tests.oracle.rotations import matrix_from_quaternion
from tests.simulation.worlds import current_at, figure_of_eight, kernel_inputs

LEVERS = [[0.8, -0.3, 0.6], [0.9, -0.2, 0.6], [0.7, 0.1, 0.5], [0.8, 0.2, 0.4]]


def simulation(**keys: Any) -> Simulation:  # noqa: ANN401 - any key of the section
    dvl = {"lever_arms_m": LEVERS, "mounting_yaw_deg": 45.0, "sound_speed_scale": 1.01}
    return figure_of_eight(dvl=dvl, water_track=keys)


@pytest.mark.parametrize("wake", [0.0, 0.2])
def test_its_beams_are_the_literal_equation(wake: float) -> None:
    """With z the depth of the cell 12 m along the beam, w the wake and s the scale of the sound speed.

    y = s ((1 + SF) (1 - w) b'(v - R'c(z, t)) + b'(omega x l) + bias)
    """
    simulated = simulation(range_m=12.0, wake=wake)
    key, plan, arrays, model, options = kernel_inputs(simulated)
    assert model.water_track is not None
    quiet = model.replace(water_track=model.water_track.replace(beam_noise_sd_mps=0.0))
    drawn = simulate_sensors(
        simulated.geometry, arrays, quiet, plan, seed=3, trajectory_key=key, run=1, options=options
    )
    truth, geometry = simulated.truth(), simulated.geometry
    latitude_rad, rate = simulated.latitude_rad, simulated.earth_rate_radps
    earth_t = rate * np.array([np.cos(latitude_rad), 0.0, -np.sin(latitude_rad)])
    assert len(drawn["water_track_time_ns"]) == 20
    assert np.ptp(truth.position_t_m[:, 2]) > 1.0
    for k, time_ns in enumerate(drawn["water_track_time_ns"]):
        assert time_ns == drawn["dvl_time_ns"][k]
        row = int(np.searchsorted(truth.time_ns, time_ns))
        rotation = matrix_from_quaternion(truth.attitude_t_p[row])
        omega = truth.omega_p_radps[row] - rotation.T @ earth_t
        for beam in range(4):
            direction, lever = geometry.directions_p[beam], np.array(LEVERS[beam])
            depth_m = truth.position_t_m[row, 2] + (rotation @ (lever + 12.0 * direction))[2]
            current = np.array(current_at(time_ns * 1e-9, depth_m))
            through = (1.0 - wake) * (truth.velocity_p_mps[row] - rotation.T @ current)
            expected = (1.0 + drawn["dvl_scale_factor"][k]) * direction @ through
            expected += direction @ np.cross(omega, lever) + drawn["dvl_bias_mps"][k, beam]
            assert drawn["water_track_velocity_mps"][k, beam] == pytest.approx(1.01 * expected, abs=1e-12)


def test_the_current_turns_at_its_rate_and_is_its_integral() -> None:
    """A quarter of a turn in an hour: to the east after it; the rate is the difference quotient; the wander adds."""
    current = Current(mean_mps=(0.3, 0.0), turn_radps=np.pi / 2.0 / 3600.0, wander_sd_mps=0.1)
    still = Current(wander_sd_mps=0.1)
    time_s = np.arange(0.0, 3600.5, 0.5)
    table, wander = current.columns(time_s), still.columns(time_s)
    np.testing.assert_allclose((table - wander)[-1, :2], [0.0, 0.3], atol=1e-15)
    np.testing.assert_allclose((table - wander)[0, 2:4], [0.0, 0.3 * np.pi / 7200.0], atol=1e-15)
    turning = table - wander
    np.testing.assert_allclose(turning[1:-1, 2:4], turning[2:, :2] - turning[:-2, :2], atol=1e-10)


def test_noise_outliers_and_losses_are_as_stated() -> None:
    """2000 s of four beams: squared errors over the variance, and both fractions within five standard deviations."""
    simulated = simulation(noise_mps=0.2, outlier_fraction=0.1, outlier_factor=20.0, lost_fraction=0.25)
    key, plan, arrays, model, options = kernel_inputs(simulated)
    assert model.water_track is not None
    quiet = model.replace(water_track=model.water_track.replace(beam_noise_sd_mps=0.0))
    errors, lost = [], []
    for run in range(100):
        noisy, exact = (
            simulate_sensors(
                simulated.geometry, arrays, one, plan, seed=9, trajectory_key=key, run=run, options=options
            )
            for one in (model, quiet)
        )
        # A ping without a beam is no reading.
        rows = np.searchsorted(exact["water_track_time_ns"], noisy["water_track_time_ns"])
        apart = (noisy["water_track_velocity_mps"] - exact["water_track_velocity_mps"][rows]) / (1.01 * 0.2)
        errors.append(apart.ravel())
        lost.append(8000 / 100 - noisy["water_track_valid"].sum())
    error = np.concatenate(errors)
    outliers = np.abs(error) > 5.0
    # P(|20 n| > 5) = 0.8026
    assert abs(outliers.mean() - 0.08026) < 5.0 * np.sqrt(0.08 * 0.92 / error.size)
    assert abs(np.sum(lost) / 8000 - 0.25) < 5.0 * np.sqrt(0.25 * 0.75 / 8000)
    # Of the others 0.1 * 0.1974 / 0.91974 are small outliers, of variance 8 between -5 and 5.
    inside = error[~outliers]
    expected = (0.9 + 0.01974 * 8.1) / 0.91974
    assert abs(np.mean(inside**2) - expected) < 0.1


def test_only_pings_without_bottom() -> None:
    simulated = simulation(pings="without_bottom")
    scenario = simulated.scenario.replace(
        {"dvl.outages": [{"beams": [1, 2, 3, 4], "from_s": 5.0, "to_s": 12.0}]}
    )
    simulated = build_simulation(scenario)
    drawn = sensor_streams(simulated, simulated.truth())
    assert drawn["beams_water"]["time_ns"].to_list() == [second * 10**9 for second in range(5, 12)]
    assert drawn["beams_water"].columns[:5] == ["time_ns", "cell", "range_m", "beam1_mps", "beam1_valid"]


def test_in_parts_it_is_the_same_run() -> None:
    """A closed loop that is given the truth in parts has the bits of the batch, between two pings and at one."""
    simulated = simulation(lost_fraction=0.3)
    key, plan, arrays, model, options = kernel_inputs(simulated)
    methods: Any = ["tc", "sway_current"]
    common: Any = {"seed": 1, "trajectory_key": key, "first_run": 0, "threads": 1}
    whole = run_batch(simulated.geometry, arrays, model, model, options, plan, methods, runs=1, **common)
    names = [name for name in arrays if name != "time_ns"]
    start: Any = {name: arrays[name][:1] for name in names} | {"time_ns": int(arrays["time_ns"][0])}
    for name in ("omega_p_radps", "force_p_mps2"):
        del start[name]
    loop = ClosedLoop(
        simulated.geometry, model, model, options, methods, start, vehicle_per_method=False, **common
    )
    last_ns = int(arrays["time_ns"][-1])
    schedule = MeasurementSchedule(simulated, first_ns=0, last_ns=last_ns, trajectory_key=key)
    ends = [0, 700, 1500, len(arrays["time_ns"]) - 1]
    for first, last in itertools.pairwise(ends):
        part = slice(first, last + 1)
        truth: Any = {name: arrays[name][None, part] for name in names} | {"time_ns": arrays["time_ns"][part]}
        epochs: Any = schedule.over(truth["time_ns"], truth["position_t_m"], truth["attitude_t_p"])[0]
        loop.advance(truth, epochs)
    np.testing.assert_array_equal(loop.results()["error"], whole["error"])


@pytest.mark.parametrize(
    ("key", "change", "message"),
    [
        ("water_current_n_mps", lambda a: a[1:], "schedule.water_current_n_mps has shape (19, 2), expected (20, 2)"),
        ("water_shear_n_ps", lambda a: np.where(a > 0.0, np.nan, a), "water_shear_n_ps"),
        ("water_track_valid", lambda a: a[:, 1:], "schedule.water_track_valid has shape (20, 3)"),
        ("water_track_time_ns", lambda a: a[::-1].copy(), "water_track"),
        ("water_track_time_ns", None, "but lacks 'water_track_time_ns'"),
    ],
)  # fmt: skip
def test_bad_schedules_are_named(key: str, change: Any, message: str) -> None:  # noqa: ANN401 - a function
    simulated = simulation()
    trajectory, given, arrays, model, options = kernel_inputs(simulated)
    plan: Any = {name: value for name, value in given.items() if name != key or change is not None}
    if change is not None:
        plan[key] = change(plan[key])
    with pytest.raises(KernelError) as caught:
        simulate_sensors(
            simulated.geometry, arrays, model, plan, seed=1, trajectory_key=trajectory, run=0, options=options
        )
    assert message in str(caught.value)
