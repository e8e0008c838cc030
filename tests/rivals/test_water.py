"""Rivals with water track by hand, and the page of the outages."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from benches.rivals import pose_ukf, water_missions, water_outages, water_reckoning
from benches.rivals.development import mission_of
from benches.rivals.pose_ukf import ABOVE, BELOW, BIAS, PROFILE_M, PoseUkf
from benches.rivals.state import Additive
from benches.rivals.timeline import stops
from bottomlock.config.scenario import load_scenario
from bottomlock.recordings.streams import Inertial, WaterBeams
from partialdvl_bench.load import load_mission
from partialdvl_bench.make import make_missions
from partialdvl_bench.methods import without_water
from partialdvl_bench.mission import Estimates, Mission, Pings, Scalars, Start
from partialdvl_bench.mission_list import missions_of
from partialdvl_bench.seeds import PUBLIC_SEED

Floats = NDArray[np.float64]

CURRENT_T_MPS = np.array([0.3, -0.2, 0.0])
LOCK_S, DURATION_S = 20, 60


@pytest.fixture(scope="module")
def drawn() -> Mission:
    return mission_of(load_scenario("survey_table2").with_trajectory(duration_s=5.0))


@pytest.fixture(scope="module")
def exact(drawn: Mission) -> Mission:
    """A minute north at 2 m/s over ground with exact readings, on an Earth at rest; the bottom is lost after 20 s."""
    environment = drawn.model.environment.replace(earth_rate_radps=0.0)
    imu_ns = np.arange(0, DURATION_S * 10 + 1, dtype=np.int64) * 100_000_000
    ping_ns = np.arange(1, DURATION_S + 1, dtype=np.int64) * 1_000_000_000
    directions = np.asarray(drawn.geometry.directions_p)
    valid = np.ones((DURATION_S, len(directions)), dtype=bool)
    bottom = valid & (np.arange(DURATION_S) < LOCK_S)[:, None]
    none = Scalars(np.empty(0, dtype=np.int64), np.empty(0))
    return dataclasses.replace(
        drawn,
        model=drawn.model.replace(environment=environment),
        start=Start(0, np.zeros(3), np.array([2.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0, 0.0])),
        imu=Inertial(
            imu_ns,
            np.tile([0.0, 0.0, -environment.gravity_mps2], (len(imu_ns), 1)),
            np.zeros((len(imu_ns), 3)),
        ),
        pings=Pings(ping_ns, np.tile(directions @ [2.0, 0.0, 0.0], (DURATION_S, 1)), bottom),
        water=WaterBeams(
            ping_ns,
            np.tile(directions @ ([2.0, 0.0, 0.0] - CURRENT_T_MPS), (DURATION_S, 1)),
            valid,
            np.full(valid.shape, 0.05),
            np.full(DURATION_S, 6.0),
        ),
        depth=none,
        heading=none,
        grid_ns=ping_ns,
        truth=None,
    )


def speeding(mission: Mission) -> Mission:
    """Over ground and through the water half a metre per second faster once the bottom is lost."""
    assert mission.water is not None
    faster = np.array(mission.water.velocity_mps)
    faster[LOCK_S:] += 0.5 * np.asarray(mission.geometry.directions_p)[:, 0]
    return dataclasses.replace(mission, water=dataclasses.replace(mission.water, velocity_mps=faster))


def end(estimates: Estimates) -> Floats:
    assert estimates.position_t_m is not None
    assert estimates.position_cov is None
    return estimates.position_t_m[-1, :2]


def test_dead_reckoning_by_hand(exact: Mission) -> None:
    """20 s at 2 m/s are 40 m, 40 s more at 2.5 m/s 100 m, of which the water alone misses the current."""
    mission = speeding(exact)
    np.testing.assert_allclose(end(water_reckoning.estimate_held(mission)), [120.0, 0.0], atol=1e-9)
    # The first reading of the water alone comes a second after the last of the bottom.
    recent = end(water_reckoning.estimate_recent(mission))
    np.testing.assert_allclose(recent, [40.0 + 2.0 + 39.0 * 2.5, 0.0], atol=1e-9)
    alone = end(water_reckoning.estimate_alone(mission))
    np.testing.assert_allclose(alone, [40.0 + 2.0 + 39.0 * 2.2, 39.0 * 0.2], atol=1e-9)


def test_the_recent_current_is_a_mean_of_the_last_two_minutes(exact: Mission) -> None:
    reckoner = water_reckoning.WaterReckoner(exact, "recent")
    assert (reckoner.current_t_mps() == 0.0).all()
    for time_s, north in ((0.0, 9.0), (100.0, 0.1), (150.0, 0.3)):
        reckoner.currents.append((time_s, np.array([north, 0.0, 5.0])))
    np.testing.assert_allclose(reckoner.current_t_mps(), [0.2, 0.0, 0.0])
    assert (water_reckoning.WaterReckoner(exact, "alone").current_t_mps() == 0.0).all()


def test_the_compass_draws_the_yaw(exact: Mission) -> None:
    """A start that is wrong by 3 degrees, and a compass: after 60 readings 0.98^60 of it is left."""
    quarter = np.array([np.cos(0.5 * np.deg2rad(3.0)), 0.0, 0.0, np.sin(0.5 * np.deg2rad(3.0))])
    start = dataclasses.replace(exact.start, attitude_t_p=quarter)
    compass = Scalars(exact.grid_ns, np.zeros(DURATION_S))
    found = water_reckoning.estimate_held(dataclasses.replace(exact, start=start, heading=compass))
    assert found.attitude_t_p is not None
    yaw = 2.0 * np.arctan2(found.attitude_t_p[-1, 3], found.attitude_t_p[-1, 0])
    assert np.rad2deg(yaw) == pytest.approx(3.0 * 0.98**60, rel=1e-9)


def test_the_layers_of_the_vector_filter_by_hand(exact: Mission) -> None:
    """Level and north at 2 m/s, a cell 6 cos(tilt) m below: (1 − w) of the current, w of that below, and the bias."""
    assert exact.water is not None
    rival = PoseUkf(exact)
    others = rival.layout.others.start - 9
    sensors = rival.state.sensors.copy()
    sensors[others:][ABOVE], sensors[others:][BELOW] = [0.3, -0.2], [0.1, 0.4]
    sensors[others:][BIAS] = [0.01, 0.02]
    state = dataclasses.replace(rival.state, sensors=sensors)
    directions = np.asarray(exact.geometry.directions_p)
    weight = 6.0 * directions[0, 2] / PROFILE_M
    beams = directions @ [1.8, 0.1, 0.0]
    measured = rival.cell(beams, np.full(4, 0.05), np.full(4, 6.0))
    assert measured is not None
    np.testing.assert_allclose(measured.value, [1.8, 0.1], atol=1e-12)
    expected = [2.0 - (1 - weight) * 0.3 - weight * 0.1 + 0.01, (1 - weight) * 0.2 - weight * 0.4 + 0.02]
    np.testing.assert_allclose(measured.predict(state), expected, atol=1e-12)
    # Least squares of an x-Janus of tilt t: 4 sin²t/2 of the beams' weight on each level axis.
    level = 2.0 * (1.0 - directions[0, 2] ** 2)
    np.testing.assert_allclose(measured.cov, np.eye(2) * 0.05**2 / level, atol=1e-12)


@pytest.mark.parametrize("pitch", [0.0, 0.4, np.pi / 2])
def test_jacobian_of_a_cell(exact: Mission, pitch: float) -> None:
    """By central differences; also on end."""
    rival = PoseUkf(exact)
    draw = np.random.default_rng(3)
    chart = Additive()
    state = chart.retract(rival.state, 0.2 * draw.normal(size=rival.layout.size))
    turn = np.zeros(rival.layout.size)
    turn[4] = pitch
    state = chart.retract(state, turn)
    measured = rival.cell(draw.normal(size=4), np.full(4, 0.05), np.full(4, 6.0))
    assert measured is not None
    step = 1e-6
    columns = [
        (
            measured.predict(chart.retract(state, step * one))
            - measured.predict(chart.retract(state, -step * one))
        )
        / (2.0 * step)
        for one in np.eye(rival.layout.size)
    ]
    np.testing.assert_allclose(np.stack(columns, axis=1), measured.jacobian(state), atol=1e-8)


def test_noise_of_the_current_grows_with_the_way(exact: Mission) -> None:
    """2 m/s level: 2σ²/τ and 1e-3 · 1e-4 · 4 a second; 0.2 m/s down counts as much as 2 m/s level."""
    rival = PoseUkf(exact)
    first = rival.layout.others.start
    phi = np.eye(rival.layout.size)
    resting = 2.0 * pose_ukf.LIMIT_MPS**2 / pose_ukf.TIME_S
    assert rival.process_noise(phi, 2.0)[first, first] == pytest.approx(2.0 * (resting + 4e-7), rel=1e-9)
    down = dataclasses.replace(rival.state.motion, velocity_t_mps=np.array([0.0, 0.0, 0.2]))
    rival.state = rival.state.with_motion(down)
    assert rival.process_noise(phi, 2.0)[first, first] == pytest.approx(2.0 * (resting + 4e-7), rel=1e-9)


def test_a_cell_beyond_95_percent_is_left_out(exact: Mission) -> None:
    """Their gate has the two components together, and no other reading."""
    gate = PoseUkf(exact).gate
    assert gate.passes("water", np.array([1.7, 1.7]), np.ones(2)).all()
    assert not gate.passes("water", np.array([1.8, 1.8]), np.ones(2)).any()
    assert gate.passes("ping", np.array([9.0, 9.0, 9.0]), np.ones(3)).all()


def test_the_vector_filter_holds_the_current_it_learned(exact: Mission) -> None:
    """Forty seconds without the bottom: half a metre, where without the water nothing holds the velocity."""
    found = pose_ukf.estimate(exact)
    assert found.position_t_m is not None
    assert found.current_t_mps is not None
    np.testing.assert_allclose(found.current_t_mps[LOCK_S - 1], CURRENT_T_MPS[:2], atol=0.05)
    np.testing.assert_allclose(found.position_t_m[-1, :2], [120.0, 0.0], atol=4.0)


def test_stops_are_at_samples_where_nothing_is_asked(exact: Mission) -> None:
    """Samples each 0.07 s: no stop holds one, but at pings and the grid."""
    imu_ns = np.arange(0, 60_070_000_000, 70_000_000, dtype=np.int64)
    mission = dataclasses.replace(
        exact, imu=Inertial(imu_ns, np.zeros((len(imu_ns), 3)), np.zeros((len(imu_ns), 3)))
    )
    asked = set(mission.grid_ns.tolist())
    assert {stop.time_ns for stop in stops(mission)} - asked <= set(imu_ns.tolist())


def test_a_dvl_without_water_track_gives_none_to_rivals(exact: Mission) -> None:
    dry = without_water(exact)
    assert not any(kind == "water" for stop in stops(dry) for kind, _ in stop.readings)
    assert any(kind == "water" for stop in stops(exact) for kind, _ in stop.readings)


def test_the_tables_of_the_page_are_those_of_the_rows() -> None:
    text = water_outages.PAGE.read_text(encoding="utf-8")
    for name, table in water_outages.tables(water_outages.read_rows()).items():
        assert water_outages.FIRST_MARK.format(name) + table + water_outages.LAST_MARK in text, name


@pytest.mark.long
@pytest.mark.parametrize("world", water_outages.SIMULATED)
def test_a_run_again_has_its_rows(world: str) -> None:
    """The last digits are the machine's."""
    published = {row[:4]: row for row in water_outages.read_rows()}
    for row in water_outages.simulated_rows(world, 1, set()):
        before = published[row[:4]]
        assert row.error_m == pytest.approx(before.error_m, rel=1e-3, abs=1e-3), row.method
        assert row.error_over_sd == pytest.approx(before.error_over_sd, rel=1e-3, abs=1e-3, nan_ok=True)


def test_the_table_of_the_missions_is_that_of_their_rows() -> None:
    rows = water_missions.read_rows()
    assert {row.mission for row in rows} == {spec.name for spec in missions_of(version="1.2")}
    assert {row.method for row in rows} == set(water_missions.ANSWERS)
    text = water_missions.PAGE.read_text(encoding="utf-8")
    assert water_missions.FIRST_MARK + water_missions.table(rows) + water_missions.LAST_MARK in text


@pytest.mark.long
def test_a_mission_again_has_its_rows(tmp_path: Path) -> None:
    """The last digits are the machine's."""
    spec = next(spec for spec in missions_of(version="1.2") if spec.current == "steady")
    make_missions([spec], lambda _: PUBLIC_SEED, tmp_path)
    mission = load_mission(tmp_path / spec.split / spec.name)
    published = {row.method: row for row in water_missions.read_rows() if row.mission == spec.name}
    for name in water_missions.ANSWERS:
        found = water_missions.row_of(mission, name)
        np.testing.assert_allclose(found[2:], published[name][2:], rtol=1e-3, atol=1e-3, err_msg=name)
