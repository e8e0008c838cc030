"""The packaged scenarios on analytic truths: exact motions for tests that need a known one."""

from typing import Any

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.simulation.build import Simulation, build_simulation
from bottomlock.simulation.measurement_schedule import measurement_schedule

_SHAPES: dict[str, dict[str, Any]] = {
    "straight": {},
    "constant_turn": {},
    "figure_eight": {"dive_angle_deg": 5.0, "sway_gain_m": 0.6},
    "lawn_mower": {"dive_angle_deg": 10.0, "dive_s": 30.0, "leg_s": 40.0, "turn_s": 20.0, "sway_gain_m": 0.6},
}


def analytic(name: str, **change: Any) -> Scenario:  # noqa: ANN401 - any key of the section
    """A packaged scenario, or the straight one bent into a constant turn, on its analytic truth."""
    packaged = load_scenario("straight" if name == "constant_turn" else name)
    return packaged.with_trajectory(source="analytic", kind=name, **_SHAPES[name], **change)


def analytic_simulation(
    name: str,
    *,
    imu_hz: float = 150.0,
    **change: Any,  # noqa: ANN401 - any key of the section
) -> Simulation:
    """Its world; with an IMU at 50 Hz a third of the work, and the same errors per root second."""
    return build_simulation(analytic(name, **change).replace({"imu.rate_hz": imu_hz}))


def batch_of(simulation: Simulation, every: slice = slice(None)) -> dict[str, Any]:
    """What `kernel.run_batch` wants, but for runs, methods and threads; of its samples some."""
    scenario, truth = simulation.scenario, simulation.truth()
    schedule: Any = dict(measurement_schedule(simulation, truth))
    schedule["sample_time_ns"] = schedule["sample_time_ns"][every]
    model = scenario.kernel_model(simulation.gravity_mps2)
    return {
        "geometry": simulation.geometry, "truth": truth.kernel_arrays(), "simulated": model, "assumed": model,
        "options": scenario.kernel_options(), "schedule": schedule, "seed": 1, "trajectory_key": 2, "first_run": 0,
    }  # fmt: skip


def batch_along(duration_s: float) -> dict[str, Any]:
    """Along the straight trajectory, for a while."""
    return batch_of(analytic_simulation("straight", duration_s=duration_s))
