"""The rivals' shared parts and the filters that are built on them."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from benches.rivals import invariant, rotations
from benches.rivals.development import mission_of
from benches.rivals.error_state import ErrorStateFilter, run
from benches.rivals.propagation import transition
from benches.rivals.sensors import Measurement, Sensors
from benches.rivals.state import (
    GYRO_BIAS,
    MISALIGNMENT,
    POSITION,
    VELOCITY,
    Additive,
    Chart,
    Layout,
    RightInvariant,
    State,
    at_start,
    covariance_at_start,
    velocity_rows,
)
from benches.rivals.strapdown import Earth, Motion, advance
from benches.rivals.timeline import Stretch, between, stops
from benches.rivals.unscented import SigmaPoints, UnscentedFilter, moments
from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.kernel.models import DepthModel, DvlModel, HeadingModel
from bottomlock.recordings.streams import Inertial
from partialdvl_bench.mission import Mission

Floats = NDArray[np.float64]

STILL = Earth(np.zeros(3), np.array([0.0, 0.0, 9.81]))


def survey() -> Scenario:
    return load_scenario("survey_table2").with_trajectory(duration_s=20.0)


@pytest.fixture(scope="module")
def mission() -> Mission:
    return mission_of(survey())


@pytest.fixture
def state(mission: Mission) -> State:
    draw = np.random.default_rng(5)
    layout = Sensors(mission).layout
    motion = Motion(rotations.exp(draw.normal(size=3)), draw.normal(size=3), 50.0 * draw.normal(size=3))
    return State(motion, 0.05 * draw.normal(size=layout.size - 9), mission.geometry.beams)


def wild_stretch(seconds: float = 1.0, rate_hz: float = 200.0) -> Stretch:
    t = (np.arange(round(seconds * rate_hz)) + 0.5) / rate_hz
    omega = np.stack([0.8 * np.sin(3.0 * t), 0.5 * np.cos(2.0 * t), 0.7 + 0.0 * t], axis=1)
    force = np.stack([2.0 * np.cos(t), np.sin(2.0 * t), -9.0 + np.cos(3.0 * t)], axis=1)
    return Stretch(np.full(len(t), 1.0 / rate_hz), omega, force)


def differences(function: Callable[[Floats], Floats], size: int, step: float = 1e-6) -> Floats:
    columns = [(function(step * e) - function(-step * e)) / (2.0 * step) for e in np.eye(size)]
    return np.stack(columns, axis=-1)


def test_rotations_invert() -> None:
    vectors = np.concatenate(
        [np.random.default_rng(1).uniform(-1.7, 1.7, (50, 3)), 1e-7 * np.eye(3), np.zeros((1, 3))]
    )
    matrices = rotations.exp(vectors)
    np.testing.assert_allclose(rotations.log(matrices), vectors, atol=1e-12)
    np.testing.assert_allclose(rotations.matrix(rotations.quaternion(matrices)), matrices, atol=1e-14)


def test_left_jacobian_is_the_mean_of_the_turn() -> None:
    vector = np.array([0.3, -1.2, 0.7])
    parts = (np.arange(20_000) + 0.5) / 20_000
    mean = rotations.exp(parts[:, None] * vector).mean(axis=0)
    np.testing.assert_allclose(rotations.left_jacobian(vector), mean, atol=1e-9)


def test_strapdown_keeps_a_vehicle_on_its_circle() -> None:
    """A level turn at 2 m/s and 0.2 rad/s, with the Earth's rate: the readings are exact, the path is known."""
    earth = Earth(7.292115e-5 * np.array([0.84, 0.0, -0.54]), np.array([0.0, 0.0, 9.8]))
    speed, rate, step, count = 2.0, 0.2, 0.01, 3000
    middle = (np.arange(count) + 0.5) * step
    attitudes = rotations.exp(np.stack([0 * middle, 0 * middle, rate * middle], axis=1))
    velocity = speed * np.stack([np.cos(rate * middle), np.sin(rate * middle), 0 * middle], axis=1)
    acceleration = (
        speed * rate * np.stack([-np.sin(rate * middle), np.cos(rate * middle), 0 * middle], axis=1)
    )
    force_t = acceleration - earth.gravity_t_mps2 + 2.0 * np.cross(earth.rate_t_radps, velocity)
    to_platform = np.swapaxes(attitudes, -1, -2)
    omega = (to_platform @ earth.rate_t_radps) + np.array([0.0, 0.0, rate])
    force = (to_platform @ force_t[..., None])[..., 0]
    motion = Motion(np.eye(3), np.array([speed, 0.0, 0.0]), np.zeros(3))
    for k in range(0, count, 10):
        stretch = Stretch(np.full(10, step), omega[k : k + 10], force[k : k + 10])
        motion, _ = advance(motion, stretch, earth, accel_bias=np.zeros(3), gyro_bias=np.zeros(3))
    turned = rate * count * step
    radius = speed / rate
    np.testing.assert_allclose(
        motion.position_t_m, [radius * np.sin(turned), radius * (1.0 - np.cos(turned)), 0.0], atol=2e-4
    )
    np.testing.assert_allclose(
        rotations.yaw_rad(motion.rotation), rotations.wrapped(np.array(turned)), atol=1e-6
    )


def test_a_reading_between_samples_uses_nothing_from_the_future() -> None:
    imu = Inertial(np.array([0, 10, 20, 30]), np.zeros((4, 3)), np.arange(4.0)[:, None] * np.ones(3))
    stretch = between(imu, 0, 25)
    np.testing.assert_allclose(stretch.step_s * 1e9, [10, 10, 5])
    np.testing.assert_allclose(stretch.omega_p_radps[:, 0], [1.0, 2.0, 2.0])
    np.testing.assert_allclose(between(imu, 25, 30).omega_p_radps[:, 0], [3.0])


def test_stops_bring_every_reading_once(mission: Mission) -> None:
    seen = list(stops(mission))
    times = [stop.time_ns for stop in seen]
    assert times == sorted(set(times))
    assert sum(kind == "ping" for stop in seen for kind, _ in stop.readings) == len(mission.pings.time_ns)
    assert [stop.grid_row for stop in seen if stop.grid_row is not None] == list(range(len(mission.grid_ns)))
    total = sum(stop.stretch.duration_s for stop in seen)
    assert total == pytest.approx(1e-9 * (mission.grid_ns[-1] - mission.start.time_ns))


@pytest.mark.parametrize("chart", [Additive(), RightInvariant()])
def test_charts(chart: Chart, state: State) -> None:
    """The difference undoes the retraction, and `additive` is the derivative of the one chart by the other."""
    size = 9 + state.sensors.shape[-1]
    error = 0.3 * np.random.default_rng(2).normal(size=size)
    np.testing.assert_allclose(chart.difference(state, chart.retract(state, error)), error, atol=1e-10)

    def moved(small: Floats) -> Floats:
        return Additive().difference(state, chart.retract(state, small))

    np.testing.assert_allclose(differences(moved, size), chart.additive(state), atol=1e-7)


@pytest.mark.parametrize("kind", ["beams", "velocity", "depth", "position", "heading"])
def test_jacobians_are_derivatives(kind: str, mission: Mission, state: State) -> None:
    options = mission.options.replace(
        depth_lever_p_m=(0.4, 0.1, -0.3), acoustic_position_lever_p_m=(-0.5, 0.2, 0.1)
    )
    model = mission.model.replace(heading=HeadingModel(sd_rad=0.02))
    sensors = Sensors(dataclasses.replace(mission, options=options, model=model))
    sensors.levers = np.random.default_rng(3).normal(size=sensors.levers.shape)
    omega = np.array([0.1, -0.4, 0.3])
    kinds: dict[str, Callable[[], Measurement | None]] = {
        "beams": lambda: sensors.beams(np.array([1.0, np.nan, 0.5, 0.2]), omega),
        "velocity": lambda: sensors.velocity(np.array([1.0, 0.1, 0.5, 0.2]), omega),
        "depth": lambda: sensors.depth(np.array([20.0])),
        "position": lambda: sensors.position(np.zeros(3), 1.0),
        "heading": lambda: sensors.heading(np.array([0.3])),
    }
    measurement = kinds[kind]()
    assert measurement is not None

    def predicted(small: Floats) -> Floats:
        return measurement.predict(Additive().retract(state, small))

    size = 9 + state.sensors.shape[-1]
    np.testing.assert_allclose(differences(predicted, size), measurement.jacobian(state), atol=2e-7)


def test_transition_is_the_derivative_of_the_flow(mission: Mission, state: State) -> None:
    stretch, layout = wild_stretch(0.1), Sensors(mission).layout
    # An Earth that turns thirty times too fast, so that its columns are seen: 4e-4 of the transition.
    earth = Earth(np.array([0.001, 0.0, -0.002]), np.array([0.0, 0.0, 9.81]))

    def flown(of: State) -> State:
        motion, _ = advance(of.motion, stretch, earth, accel_bias=of.accel_bias, gyro_bias=of.gyro_bias)
        return of.with_motion(motion)

    end = flown(state)

    def moved(small: Floats) -> Floats:
        return Additive().difference(end, flown(Additive().retract(state, small)))

    _, increment = advance(
        state.motion, stretch, earth, accel_bias=state.accel_bias, gyro_bias=state.gyro_bias
    )
    phi = transition(layout, increment, 0.1, earth, mission.model)
    phi[layout.depth_bias, layout.depth_bias] = 1.0
    exact, gyro = differences(moved, layout.size), GYRO_BIAS
    # A gyro's bias acts on velocity and position through the tilt: there its columns are good to a few per cent.
    np.testing.assert_allclose(exact[6:9, gyro], phi[6:9, gyro], atol=0.03 * np.abs(phi[6:9, gyro]).max())
    np.testing.assert_allclose(np.delete(exact, gyro, 1), np.delete(phi, gyro, 1), atol=2e-4)
    np.testing.assert_allclose(exact[3:6, gyro], phi[3:6, gyro], atol=2e-4)


def test_an_invariant_error_flies_by_itself(mission: Mission, state: State) -> None:
    """Barrau and Bonnabel 2017: without noise and bias error the logarithm of the error is linear, exactly.

    However large it is, and whatever the motion: ρ stays, ν grows by [g ×] ρ t, π by ν t + [g ×] ρ t²/2.
    """
    chart, size = RightInvariant(), Sensors(mission).layout.size
    error = np.zeros(size)
    error[MISALIGNMENT], error[VELOCITY], error[POSITION] = (
        [0.3, -0.2, 1.5],
        [0.5, 2.0, -1.0],
        [10.0, -30.0, 4.0],
    )
    other, stretch = chart.retract(state, error), wild_stretch(1.0)

    def flown(of: State) -> State:
        motion, _ = advance(of.motion, stretch, STILL, accel_bias=of.accel_bias, gyro_bias=of.gyro_bias)
        return of.with_motion(motion)

    after = chart.difference(flown(state), flown(other))
    pull = np.cross(STILL.gravity_t_mps2, error[MISALIGNMENT])
    np.testing.assert_allclose(after[MISALIGNMENT], error[MISALIGNMENT], atol=1e-12)
    np.testing.assert_allclose(after[VELOCITY], error[VELOCITY] + pull, atol=1e-11)
    np.testing.assert_allclose(after[POSITION], error[POSITION] + error[VELOCITY] + 0.5 * pull, atol=1e-10)


def test_a_velocity_is_a_right_invariant_observation(state: State) -> None:
    """Potokar et al. 2021: in right-invariant errors the DVL sees ν alone, R̂ᵀ ν."""
    rows = velocity_rows(state) @ RightInvariant().additive(state)
    expected = np.zeros_like(rows)
    expected[:, VELOCITY] = state.motion.rotation.T
    np.testing.assert_allclose(rows, expected, atol=1e-12)


def test_depth_as_the_paper_has_it(mission: Mission) -> None:
    """Their update with depth, a left-invariant position with no information in north and east, is ours.

    In their words: V = R̂ᵀ (z − p̂), S⁻¹ by the Woodbury identity of a noise whose inverse is diag(0, 0, 1/σ²).
    """
    mission = dataclasses.replace(
        mission,
        options=mission.options.replace(gate="off"),
        model=mission.model.replace(depth=mission.model.of(DepthModel).replace(bias_sd_m=0.0)),
    )
    rival = ErrorStateFilter(mission, RightInvariant())
    for stop in stops(mission):
        rival.predict(stop.stretch)
        if stop.time_ns >= 3_000_000_000:
            break
    motion, covariance = rival.state.motion, rival.covariance
    size, depth = rival.layout.size, np.array([motion.position_t_m[2] + 0.7])
    # ξ_right = Ad ξ_left, over attitude, velocity and position; the other errors are the same.
    adjoint = np.eye(size)
    for block in (POSITION, MISALIGNMENT, VELOCITY):
        adjoint[block, block] = motion.rotation
    adjoint[POSITION, MISALIGNMENT] = rotations.skew(motion.position_t_m) @ motion.rotation
    adjoint[VELOCITY, MISALIGNMENT] = rotations.skew(motion.velocity_t_mps) @ motion.rotation
    back = np.linalg.inv(adjoint)
    left = back @ covariance @ back.T
    H = np.zeros((3, size))
    H[:, POSITION] = np.eye(3)
    information = np.diag([0.0, 0.0, 1.0 / mission.model.of(DepthModel).sd_m ** 2])
    prior = np.linalg.inv(H @ left @ H.T)
    R = motion.rotation
    inverse_s = prior - prior @ np.linalg.inv(R.T @ information @ R + prior) @ prior
    K = left @ H.T @ inverse_s
    innovation = R.T @ (np.array([*motion.position_t_m[:2], depth[0]]) - motion.position_t_m)
    rival.measure("depth", depth, None)
    expected = RightInvariant().difference(
        dataclasses.replace(rival.state, motion=motion, sensors=rival.state.sensors * 0.0), rival.state
    )
    np.testing.assert_allclose(adjoint @ (K @ innovation), expected, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(
        adjoint @ ((np.eye(size) - K @ H) @ left) @ adjoint.T, rival.covariance, rtol=1e-5, atol=1e-9
    )


@pytest.mark.parametrize("chart", [Additive(), RightInvariant()])
def test_beams_are_their_velocity_when_all_are_there(chart: Chart, mission: Mission) -> None:
    """With four beams of equal noise and no states of the DVL, least squares loses nothing: LC equals the beams."""
    dvl = mission.model.of(DvlModel).replace(
        beam_bias_sd_mps=0.0, scale_factor_sd=0.0, scale_factor_walk_rts=0.0
    )
    pings = dataclasses.replace(mission.pings, valid=np.ones_like(mission.pings.valid))
    filled = np.nan_to_num(pings.velocity_mps)
    whole = dataclasses.replace(
        mission,
        model=mission.model.replace(dvl=dvl),
        options=mission.options.replace(gate="off"),
        pings=dataclasses.replace(pings, velocity_mps=filled),
    )
    tight = run(ErrorStateFilter(whole, chart), whole)
    loose = run(ErrorStateFilter(whole, chart, solved_velocity=True), whole)
    np.testing.assert_allclose(tight.velocity_p_mps, loose.velocity_p_mps, atol=1e-9)
    np.testing.assert_allclose(tight.velocity_cov, loose.velocity_cov, atol=1e-12)


def test_the_velocity_of_the_paper_needs_three_beams(mission: Mission) -> None:
    sensors = Sensors(mission)
    two, three = np.array([0.1, 0.2, np.nan, np.nan]), np.array([0.1, 0.2, np.nan, 0.3])
    assert sensors.velocity(two, np.zeros(3)) is None
    assert sensors.velocity(three, np.zeros(3)) is not None
    beams = sensors.beams(two, np.zeros(3))
    assert beams is not None
    assert len(beams.value) == 2


def test_sigma_points_have_their_moments() -> None:
    draw = np.random.default_rng(4)
    root = draw.normal(size=(6, 6))
    covariance = root @ root.T
    covariance[2], covariance[:, 2] = 0.0, 0.0
    points = SigmaPoints.of(covariance)
    assert points.mean.sum() == pytest.approx(1.0)
    mean, cov = moments(points, points.offsets)
    np.testing.assert_allclose(mean, 0.0, atol=1e-12)
    np.testing.assert_allclose(cov, covariance, atol=1e-10)


def test_polar_to_cartesian_as_published() -> None:
    """Julier and Uhlmann's range 1 m ± 2 cm and bearing 90° ± 15°: the mean northing is exp(−σ²/2), not 1.

    Linearised, the mean is 1; the true one is 0.9663, theirs and ours is right to the fourth order of σ.
    """
    sd = np.array([0.02, np.deg2rad(15.0)])
    points = SigmaPoints.of(np.diag(sd**2))
    distance, bearing = (points.offsets + np.array([1.0, np.pi / 2.0])).T
    mean, _ = moments(points, np.stack([distance * np.cos(bearing), distance * np.sin(bearing)], axis=1))
    np.testing.assert_allclose(mean, [0.0, np.exp(-(sd[1] ** 2) / 2.0)], atol=1e-4)


def test_unscented_is_kalman_where_all_is_linear(mission: Mission) -> None:
    """Position fixes and depth are linear in additive errors: sigma points and Jacobians agree."""
    mission = dataclasses.replace(mission, options=mission.options.replace(gate="off"))
    extended, unscented = ErrorStateFilter(mission), UnscentedFilter(mission, Additive())
    # Without an uncertain attitude nothing in the filter is nonlinear.
    for rival in (extended, unscented):
        for block in (MISALIGNMENT, slice(12, 15)):
            rival.covariance[block, :], rival.covariance[:, block] = 0.0, 0.0
        rival.measure("depth", np.array([21.0]), None)
        rival.update("position", rival.sensors.position(np.array([1.0, -2.0, 20.0]), 0.5))
    np.testing.assert_allclose(unscented.covariance, extended.covariance, atol=1e-12)
    np.testing.assert_allclose(
        Additive().difference(extended.state, unscented.state), np.zeros(extended.layout.size), atol=1e-12
    )


def test_unscented_and_invariant_agree_where_errors_are_small(mission: Mission) -> None:
    unscented, extended = run(UnscentedFilter(mission), mission), invariant.estimate(mission)
    sd = np.sqrt(np.diagonal(extended.velocity_cov, axis1=1, axis2=2))
    assert np.abs(unscented.velocity_p_mps - extended.velocity_p_mps).max() < 0.05 * sd.max()
    np.testing.assert_allclose(unscented.velocity_cov, extended.velocity_cov, rtol=0.05, atol=1e-6)


def test_the_start_claims_its_velocity_in_platform_axes(mission: Mission) -> None:
    layout = Layout(mission.geometry.beams)
    rows, covariance = velocity_rows(at_start(mission, layout)), covariance_at_start(mission, layout)
    expected = np.diag(np.square(mission.model.initial.velocity_sd_mps))
    np.testing.assert_allclose(rows @ covariance @ rows.T, expected, atol=1e-15)


@pytest.mark.parametrize("kind", [ErrorStateFilter, UnscentedFilter])
def test_a_heading_goes_the_short_way_round(kind: type[ErrorStateFilter], mission: Mission) -> None:
    """179° by the start, -179° by the compass: the update is between, across south."""
    start = dataclasses.replace(
        mission.start, attitude_t_p=rotations.quaternion(rotations.exp(np.deg2rad([0.0, 0.0, 179.0])))
    )
    model = mission.model.replace(heading=HeadingModel(sd_rad=mission.model.initial.attitude_sd_rad[2]))
    rival = kind(dataclasses.replace(mission, start=start, model=model))
    rival.measure("heading", np.deg2rad([-179.0]), None)
    assert abs(np.rad2deg(rotations.yaw_rad(rival.state.motion.rotation))) == pytest.approx(180.0, abs=0.02)
