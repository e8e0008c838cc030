"""Ten minutes without any bottom after three with it, with the forces of an ROV's thrusters: what they are worth.

The packaged BlueROV2 crabs along legs of 15 m at a held heading in 0.3 m/s of current, with a tactical IMU, a depth
sensor and a compass. Forces are those of the plant's eight thrusters, with their lag, summed by their places, twice a
second, with 1 N of noise. The filter has the vehicle's mass and drag, or drag that is a fifth wrong. A single sample of
a seed that was not chosen; a band holds with probability 1 - 1e-3. Not in this world: a tether, waves.
"""

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.config.through_water import EffortErrors
from bottomlock.kernel import Method, replay_log, simulate_sensors
from bottomlock.plant import Flight
from bottomlock.plant.hovering_vehicle import HoveringVehicle
from bottomlock.recordings.drives import SpeedByForces
from bottomlock.recordings.readings import EffortReading
from bottomlock.simulation.build import Simulation, build_simulation, trajectory_key
from bottomlock.simulation.measurement_schedule import measurement_schedule
from bottomlock.statistics.chi_squared import mean_band
from tests.drawn_log import drawn_log

pytestmark = [pytest.mark.statistical, pytest.mark.long]
Floats = NDArray[np.float64]
RUNS, LOCK_S, DURATION_S, PROBABILITY = 12, 180.0, 780.0, 1.0 - 1e-3
METHODS: tuple[Method, ...] = ("tc", "sway_current")
KEY = trajectory_key("effort_plant")


@cache
def world() -> tuple[Simulation, Flight]:
    content = load_scenario("hovering").model_dump(exclude_unset=True)
    lost = {"beams": [1, 2, 3, 4], "from_s": LOCK_S, "to_s": 1e6}
    dvl = {key: value for key, value in content["dvl"].items() if key != "dropouts"}
    content |= {"dvl": dvl | {"outages": [lost]}, "heading": {"noise_deg": 0.5}}
    content["imu"] |= {"rate_hz": 50.0}
    content["trajectory"] |= {"duration_s": DURATION_S}
    content["mission"] |= {"current": {"speed_mps": 0.3, "towards_deg": 90.0}}
    del content["magnetometer"], content["filter"]["weak_sway_var_m2ps2"]
    simulation = build_simulation(Scenario.model_validate(content))
    return simulation, simulation.flight()


def hull(vehicle: HoveringVehicle, gravity_mps2: float, drag: float) -> EffortErrors:
    """Mass and drag of the vehicle's file, the drag so many times."""
    damping, added, body = np.array(vehicle.damping.axes())[:3], vehicle.added_mass, vehicle.rigid_body
    heavy = body.mass - vehicle.water.density * body.displaced_volume
    return EffortErrors(
        mass_kg=tuple(body.mass - np.array([added.x_udot, added.y_vdot, added.z_wdot])),
        linear_drag_kg_per_s=tuple(drag * damping[:, 0]),
        quadratic_drag_kg_per_m=tuple(drag * damping[:, 1]),
        buoyancy_n=-heavy * gravity_mps2,
    )


@cache
def draws() -> list[Any]:
    """What the sensors of each run read; nothing of the schedule is random here."""
    simulation, flight = world()
    arrays: Any = flight.truth.kernel_arrays()
    plan: Any = measurement_schedule(simulation, flight.truth, trajectory_key=KEY)
    model = simulation.scenario.kernel_model(simulation.gravity_mps2)
    return [
        simulate_sensors(
            simulation.geometry,
            arrays,
            model,
            plan,
            imu_sampling=simulation.scenario.imu.sampling,
            options=simulation.scenario.kernel_options(),
            seed=1,
            trajectory_key=KEY,
            run=number,
        )
        for number in range(RUNS)
    ]


@cache
def run(drag: float | None) -> dict[str, Floats]:
    """At the end, (runs, methods): horizontal error, m, and normalised squared errors; without forces for None."""
    simulation, flight = world()
    vehicle, truth, history = flight.vehicle, flight.truth, flight.history
    assert isinstance(vehicle, HoveringVehicle)
    model = simulation.scenario.kernel_model(simulation.gravity_mps2)
    options = simulation.scenario.kernel_options()
    wrenches = vehicle.thrusters.wrenches()[:3]
    force_p_n = history.state[:, 13 : 13 + wrenches.shape[1]] @ wrenches.T
    times = np.arange(500_000_000, history.time_ns[-1], 500_000_000)
    rows = np.searchsorted(history.time_ns, times)
    if drag is not None:
        section = hull(vehicle, simulation.gravity_mps2, drag)
        (errors,) = section.kernel_models().values()
        model, options = model.replace(thrust=errors), options.replace(thrust="velocity")
    end = len(truth.time_ns) - 2
    found: dict[str, list[Floats]] = {"error_m": [], "position": [], "velocity": []}
    for number, drawn in enumerate(draws()):
        draw = np.random.default_rng([26, number])
        log = drawn_log(drawn, "heading")
        if drag is not None:
            of, noisy = SpeedByForces(section), force_p_n[rows] + draw.normal(size=(len(times), 3))
            omega = log["omega_p_radps"][np.searchsorted(log["imu_time_ns"], times, side="right") - 1]
            readings = [EffortReading(*row) for row in zip(times.tolist(), noisy.tolist(), strict=True)]
            speeds = [of(*one).speed_p_mps for one in zip(readings, omega, strict=True)]
            log |= {"thrust_time_ns": times, "thrust_speed_p_mps": np.array(speeds)}
        out = replay_log(
            simulation.geometry,
            model,
            options,
            METHODS,
            log,
            drawn["initial"],
            sample_time_ns=truth.time_ns[end : end + 1],
        )
        error = out["position_t_m"][:, 0] - truth.position_t_m[end]
        of_velocity = out["velocity_p_mps"][:, 0] - truth.velocity_p_mps[end]
        sd = out["sd"][:, 0]
        found["error_m"].append(np.hypot(error[:, 0], error[:, 1]))
        found["position"].append(np.sum((error[:, :2] / sd[:, :2]) ** 2, axis=1))
        found["velocity"].append(np.sum((of_velocity / sd[:, 6:9]) ** 2, axis=1))
    return {name: np.array(values) for name, values in found.items()}


@pytest.mark.parametrize("drag", [1.0, 1.2, 0.8])
def test_they_bound_the_error_and_are_not_overconfident(drag: float) -> None:
    """Less than a twentieth of the error of `tc` and of `sway_current`, which coasts on its assumptions, in every run.

    The prior of the current is conservative for one that stays.
    """
    found, without = run(drag), run(None)
    assert (np.median(found["error_m"], axis=0) < np.median(without["error_m"], axis=0) / 20.0).all()
    assert (found["error_m"].max(axis=0) < without["error_m"].max(axis=0) / 20.0).all()
    for name, degrees in {"position": 2, "velocity": 3}.items():
        assert (found[name].mean(axis=0) < mean_band(degrees, RUNS, PROBABILITY)[1]).all(), name
