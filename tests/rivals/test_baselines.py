"""Dead reckoning, held velocities, adaptive noise and the kinetic model, by hand and by what their papers derive."""

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from benches.rivals import dead_reckoning, error_state, held_velocity, rotations
from benches.rivals.adaptive import WINDOW, AdaptiveFilter, WindowedNoise
from benches.rivals.development import averaged, mission_along, mission_of
from benches.rivals.error_state import run
from benches.rivals.gate import Gate
from benches.rivals.held_velocity import HeldVelocityFilter, VelocityMemory
from benches.rivals.kinetic_model import Controls, KineticModel, perturbed
from benches.rivals.model_aided import (
    FURTHER,
    MODEL_SD_MPS,
    ModelAidedFilter,
    estimate,
    estimate_with_controls,
)
from benches.rivals.state import Additive, State
from bottomlock.config.scenario import load_scenario
from bottomlock.errors import DataError
from bottomlock.kernel.models import Options
from bottomlock.plant import Vehicle
from bottomlock.plant.trim import trim
from bottomlock.recordings.streams import Inertial
from bottomlock.simulation.build import build_simulation
from partialdvl_bench.mission import Mission, Pings, Scalars, Start
from tests.plant.helpers import finned

Floats = NDArray[np.float64]

YAW_ERROR_RAD = np.deg2rad(1.0)


@pytest.fixture(scope="module")
def drawn() -> Mission:
    return mission_of(load_scenario("survey_table2").with_trajectory(duration_s=5.0))


@pytest.fixture(scope="module")
def exact(drawn: Mission) -> Mission:
    """Forty seconds north at 2 m/s with exact readings, on an Earth at rest; beams 2 to 4 are lost from 20 s on."""
    environment = drawn.model.environment.replace(earth_rate_radps=0.0)
    imu_ns = np.arange(0, 40_000_000_001, 100_000_000, dtype=np.int64)
    ping_ns = np.arange(1_000_000_000, 40_000_000_001, 1_000_000_000, dtype=np.int64)
    beams = np.tile(drawn.geometry.directions_p @ [2.0, 0.0, 0.0], (40, 1))
    valid = np.ones(beams.shape, dtype=bool)
    valid[20:, 1:] = False
    none = Scalars(np.empty(0, dtype=np.int64), np.empty(0))
    force = np.tile([0.0, 0.0, -environment.gravity_mps2], (len(imu_ns), 1))
    return dataclasses.replace(
        drawn,
        name="tauv-exact",
        model=drawn.model.replace(environment=environment),
        options=drawn.options.replace(gate="off"),
        start=Start(0, np.zeros(3), np.array([2.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0, 0.0])),
        imu=Inertial(imu_ns, force, np.zeros((len(imu_ns), 3))),
        pings=Pings(ping_ns, beams, valid),
        depth=none,
        heading=none,
        grid_ns=ping_ns,
        truth=None,
    )


def turned(mission: Mission, yaw_rad: float) -> Mission:
    attitude = rotations.quaternion(rotations.exp(np.array([0.0, 0.0, yaw_rad])))
    return dataclasses.replace(mission, start=dataclasses.replace(mission.start, attitude_t_p=attitude))


def test_dead_reckoning_goes_astray_by_its_heading(exact: Mission) -> None:
    """The textbook's figure: an error of heading of 1° is 1.75 % of the distance, across the track."""
    right, wrong = dead_reckoning.estimate(exact), dead_reckoning.estimate(turned(exact, YAW_ERROR_RAD))
    assert right.position_t_m is not None
    assert wrong.position_t_m is not None
    assert wrong.position_cov is not None
    np.testing.assert_allclose(right.position_t_m[-1], [80.0, 0.0, 0.0], atol=1e-9)
    across = wrong.position_t_m[-1, 1]
    assert across == pytest.approx(80.0 * np.sin(YAW_ERROR_RAD), rel=1e-9)
    assert across / 80.0 == pytest.approx(0.01745, abs=1e-5)
    # It claims so: beside the walk, the heading's 1.14° across 80 m, and a little for the gyros.
    claimed = wrong.position_cov[-1, 1, 1] - wrong.position_cov[-1, 0, 0]
    assert claimed == pytest.approx((80.0 * np.deg2rad(1.14)) ** 2, rel=0.05)


def test_dead_reckoning_by_a_scale_factor(exact: Mission) -> None:
    """Of 0.4 % in the DVL: 0.4 % of the distance, along the track."""
    pings = dataclasses.replace(exact.pings, velocity_mps=1.004 * exact.pings.velocity_mps)
    found = dead_reckoning.estimate(dataclasses.replace(exact, pings=pings)).position_t_m
    assert found is not None
    # The first second is dead reckoned with the velocity of the start.
    np.testing.assert_allclose(found[-1], [2.0 + 78.0 * 1.004, 0.0, 0.0], atol=1e-9)


def test_the_memory_holds_what_it_says() -> None:
    memory = VelocityMemory(2, 0.01)
    assert memory.held(1.0) is None
    cov = 0.001 * np.eye(3)
    for time_s, surge in ((1.0, 2.0), (2.0, 2.2), (4.0, 2.2)):
        memory.take(time_s, np.array([surge, 0.0, 0.0]), cov)
    held = memory.held(10.0)
    assert held is not None
    np.testing.assert_allclose(held[0], [2.2, 0.0, 0.0])
    # Steps of 0.2²/1 and 0, with the first guess: a third of 0.01 + 0.04 + 0; the velocities are of 3 s on average.
    np.testing.assert_allclose(memory.walk_m2ps3, [0.05 / 3.0, 0.01 / 3.0, 0.01 / 3.0])
    np.testing.assert_allclose(held[1], cov + np.diag(memory.walk_m2ps3 * 7.0))


def test_a_held_velocity_is_fed_where_beams_are_lost(exact: Mission) -> None:
    """From 20 s on one beam returns: the loose INS alone coasts, with the last velocity it is held at 2 m/s."""
    held, average = held_velocity.estimate(exact), held_velocity.estimate_moving_average(exact)
    alone = run(HeldVelocityFilter(exact, 1), dataclasses.replace(exact, pings=lost(exact)))
    for answer in (held, average):
        np.testing.assert_allclose(answer.velocity_p_mps, [[2.0, 0.0, 0.0]] * 40, atol=1e-6)
        assert answer.velocity_cov[-1, 0, 0] < 0.5 * alone.velocity_cov[-1, 0, 0]
    # The uncertainty of what is held grows, and so does the answer's.
    assert held.velocity_cov[-1, 0, 0] > 1.2 * held.velocity_cov[18, 0, 0]


def lost(mission: Mission) -> Pings:
    return Pings(mission.pings.time_ns[:20], mission.pings.velocity_mps[:20], mission.pings.valid[:20])


def test_the_gate_lets_in_what_it_rejected_too_long() -> None:
    gate = Gate(Options(gate="joint", gate_probability=0.9973))
    good = gate.passes("ping", np.array([0.1, 2.9]), np.ones(2))
    assert good.tolist() == [True, True]
    assert gate.passes("ping", np.array([0.1, 3.1]), np.ones(2)).tolist() == [True, False]
    verdicts = [
        bool(gate.passes("depth", np.array([50.0]), np.ones(1))[0]) for _ in range(Gate.REJECTIONS + 1)
    ]
    assert verdicts == [False] * Gate.REJECTIONS + [True]
    assert Gate(Options(gate="off")).passes("depth", np.array([50.0]), np.ones(1)).all()


def test_innovations_identify_the_process_noise() -> None:
    """Mohamed and Schwarz 1999: in the steady state K C Kᵀ is Q. A random walk of Q = 1, R = 1, begun with Q = 0.25."""
    draw = np.random.default_rng(1970)
    window, found = WindowedNoise(200), []
    truth = estimate_x = 0.0
    variance, q = 1.0, 0.25
    for _ in range(4000):
        truth += draw.standard_normal()
        variance += q
        gain = variance / (variance + 1.0)
        correction = gain * (truth + draw.standard_normal() - estimate_x)
        estimate_x += correction
        variance *= 1.0 - gain
        window.take(np.array([correction]))
        adapted = window.estimate()
        q = 0.25 if adapted is None else float(adapted[0, 0])
        found.append(q)
    assert np.mean(found[1000:]) == pytest.approx(1.0, abs=0.1)


def test_the_adaptive_filter_takes_its_window_when_it_is_full(exact: Mission) -> None:
    rival = AdaptiveFilter(exact)
    phi, model_q = np.eye(rival.layout.size), rival.process_noise(np.eye(rival.layout.size), 0.5)
    correction = np.zeros(rival.layout.size)
    correction[6], correction[-1] = 0.3, 5.0
    for _ in range(WINDOW - 1):
        rival.correct("ping", correction)
        rival.correct("depth", 100.0 * correction)
    np.testing.assert_array_equal(rival.process_noise(phi, 0.5), model_q)
    rival.correct("ping", correction)
    adapted = rival.process_noise(phi, 0.5)
    # Half a second of an interval of a second; the state of the depth sensor keeps the model's noise.
    assert adapted[6, 6] == pytest.approx(0.5 * 0.09)
    assert adapted[7, 7] == 0.0
    assert adapted[-1, -1] == model_q[-1, -1]


@pytest.fixture(scope="module")
def flight():  # type: ignore[no-untyped-def]  # noqa: ANN201 - a simulation and its flight
    scenario = load_scenario("survey_table2").with_trajectory(duration_s=60.0)
    simulation = build_simulation(scenario.replace({"mission.current": {"speed_mps": 0.0}}))
    return simulation, simulation.flight()


def test_the_kinetic_model_with_the_right_coefficients_is_the_plant(flight) -> None:  # type: ignore[no-untyped-def] # noqa: ANN001
    """Driven by the flight's own fins, shaft, rates and attitude it keeps to the flight's velocity."""
    simulation, flown = flight
    history, step = flown.history, 15
    right = KineticModel(simulation.vehicle, simulation.gravity_mps2, history.state[0, 7:10])
    controls = Controls(history.time_ns, history.state[:, 13:17], history.state[:, 17])
    off = []
    for k in range(0, len(history.time_ns) - step, step):
        middle = k + step // 2
        attitude, omega = history.state[middle, 3:7], history.state[middle, 10:13]
        fins, shaft = controls.at(int(history.time_ns[middle]))
        right.advance(attitude, omega, fins, shaft, step / 150.0)
        off.append(np.abs(right.velocity_p_mps - history.velocity_through_water_p_mps[k + step]).max())
    assert max(off) < 0.005


def test_wrong_coefficients_make_the_speed_wrong_by_what_is_claimed(flight) -> None:  # type: ignore[no-untyped-def] # noqa: ANN001
    """Drag and thrust off by 10 % each: the speed at a shaft's turns is off by some 7 %, as the filter claims."""
    simulation, _ = flight
    speeds = []
    for seed in range(40):
        wrong = perturbed(simulation.vehicle, 0.1, seed)
        held = trim(simulation.vehicle, 2.0, simulation.gravity_mps2)
        model = KineticModel(wrong, simulation.gravity_mps2, np.array([2.0, 0.0, 0.0]))
        level = np.array([1.0, 0.0, 0.0, 0.0])
        for _ in range(120):
            model.advance(level, np.zeros(3), np.zeros(4), held.shaft_rps, 0.5)
        speeds.append(model.velocity_p_mps[0])
    assert 0.6 * MODEL_SD_MPS[0] < np.std(speeds) < 1.4 * MODEL_SD_MPS[0]


def test_fins_follow_from_the_angular_acceleration(flight) -> None:  # type: ignore[no-untyped-def] # noqa: ANN001
    simulation, flown = flight
    row = 4000
    state, alpha = flown.history.state[row], flown.history.acceleration[row, 3:]
    model = KineticModel(simulation.vehicle, simulation.gravity_mps2, state[7:10])
    for _ in range(5):
        fins = model.fins_that_turn(state[3:7], state[10:13], alpha, float(state[17]))
    # Modes are roll, pitch and yaw: a mean of the fins that turns nothing is not seen, and not used.
    modes = model.mixer.modes_rad(state[13:17])
    np.testing.assert_allclose(model.mixer.modes_rad(fins), modes, atol=1e-3)


def test_jacobian_of_the_models_velocity(exact: Mission) -> None:
    rival = ModelAidedFilter(exact, finned("tauv"), None)
    draw = np.random.default_rng(6)
    rival.state = Additive().retract(rival.state, 0.2 * draw.normal(size=rival.layout.size))
    measurement = rival.model_velocity()

    def predicted(error: Floats) -> Floats:
        return measurement.predict(Additive().retract(rival.state, error))

    step = 1e-6
    columns = [
        (predicted(step * one) - predicted(-step * one)) / (2.0 * step) for one in np.eye(rival.layout.size)
    ]
    np.testing.assert_allclose(np.stack(columns, axis=1), measurement.jacobian(rival.state), atol=1e-8)


def test_the_current_is_the_difference_of_ground_and_model(exact: Mission) -> None:
    """1.8 m/s through the water by a sure model, 2 m/s over ground by the beams: a current of 0.2 m/s."""
    rival = ModelAidedFilter(exact, finned("tauv"), None)
    others = rival.layout.others
    errors = slice(others.start + 2, others.stop)
    rival.covariance[errors, errors] = 1e-8 * np.eye(3)
    rival.model.velocity_p_mps = np.array([1.8, 0.0, 0.0])
    rival.measure("ping", exact.pings.velocity_mps[0], None)
    rival.update("model", rival.model_velocity())
    current, cov = rival.current()
    assert current[0] == pytest.approx(0.2, abs=0.02)
    assert cov[0, 0] < 0.1 * rival.further_sd[0] ** 2
    assert rival.state.states(others).shape == (FURTHER,)
    assert isinstance(rival.state, State)


def test_a_mission_of_no_known_vehicle_is_refused(exact: Mission) -> None:
    with pytest.raises(DataError, match="no packaged vehicle is called 'boat'"):
        estimate(dataclasses.replace(exact, name="boat-1"))


@pytest.mark.long
def test_a_model_bridges_what_the_ins_cannot() -> None:
    """All beams are lost for 100 s: the INS alone goes astray by several times what it does with the model.

    The model holds the current that it knew before, which is known to be steady here.
    """
    outage = [{"beams": [1, 2, 3, 4], "from_s": 140.0, "to_s": 240.0}]
    scenario = (
        load_scenario("survey_table2").with_trajectory(duration_s=240.0).replace({"dvl.outages": outage})
    )
    scenario = scenario.replace({"filter.water.current_time_s": 21_600.0})
    simulation = build_simulation(averaged(scenario).replace({"imu.rate_hz": 50.0}))
    flown = simulation.flight()
    controls = Controls(flown.history.time_ns, flown.history.state[:, 13:17], flown.history.state[:, 17])
    vehicle = simulation.vehicle
    assert isinstance(vehicle, Vehicle)
    off: dict[str, list[float]] = {"alone": [], "with controls": [], "without": []}
    for run_number in range(3):
        mission = mission_along(simulation, flown.truth, run=run_number)
        for name, answer in (
            ("alone", error_state.estimate(mission)),
            ("with controls", estimate_with_controls(mission, vehicle, controls)),
            ("without", estimate_with_controls(mission, vehicle, None)),
        ):
            assert mission.truth is not None
            assert answer.position_t_m is not None
            error = mission.truth.position_t_m - answer.position_t_m
            off[name].append(float(np.linalg.norm((error[-1] - error[139])[:2])))
    assert np.median(off["with controls"]) < 0.5 * np.median(off["alone"])
    assert np.median(off["without"]) < 0.5 * np.median(off["alone"])
