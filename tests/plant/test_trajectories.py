"""The three missions: tracked, physical, smooth, converged, deterministic, and true to an ideal strapdown."""

from dataclasses import replace

import numpy as np
import pytest

from bottomlock.plant import (
    Current,
    Flight,
    StuckFin,
    Vehicle,
    figure_eight,
    fly,
    lawn_mower,
    straight,
    swim,
    telemetry,
)
from bottomlock.plant.maths import FloatArray
from tests.plant.helpers import GRAVITY_MPS2, LATITUDE_RAD

NAMES = ("straight", "figure_eight", "lawn_mower")


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize("name", NAMES)
def test_missions_are_tracked(flights: dict[str, Flight], name: str) -> None:
    """Cross-track 1 m rms on the legs, depth 0.2 m rms after the dive, speed within 2 % throughout."""
    frame = telemetry(flights[name])
    seconds = frame["time_ns"].to_numpy() * 1e-9
    offset, leg = frame["cross_track_m"].to_numpy(), frame["leg"].to_numpy()
    assert _rms(offset[leg] if leg.any() else offset) < 1.0
    after = seconds > 40.0
    assert _rms((frame["depth_m"] - frame["depth_wanted_m"]).to_numpy()[after]) < 0.2
    assert np.abs(frame["speed_mps"].to_numpy() / 2.0 - 1.0).max() < 0.02


@pytest.mark.parametrize("name", NAMES)
def test_accelerations_are_the_derivative_of_the_states(flights: dict[str, Flight], name: str) -> None:
    history = flights[name].history
    step = 1.0 / 150.0
    integral = np.cumsum(0.5 * step * (history.acceleration[1:] + history.acceleration[:-1]), axis=0)
    assert np.abs(history.state[1:, 7:13] - history.state[0, 7:13] - integral).max() < 1e-4


def test_times_are_on_the_imu_grid(flights: dict[str, Flight]) -> None:
    time_ns = flights["straight"].truth.time_ns
    assert time_ns.dtype == np.int64
    assert (time_ns == np.rint(np.arange(15_001) * 1e9 / 150.0).astype(np.int64)).all()


def test_the_same_mission_gives_the_same_bits(tauv: Vehicle) -> None:
    mission = figure_eight(duration_s=20.0, current=Current(wander_sd_mps=0.1, wander_time_s=30.0, seed=3))
    first, second = (swim(tauv, mission, gravity_mps2=GRAVITY_MPS2) for _ in range(2))
    assert (first.state == second.state).all()


@pytest.mark.parametrize("rate_hz", [50.0, 25.0, 5.0])
def test_a_slow_imu_samples_the_same_flight(tauv: Vehicle, rate_hz: float) -> None:
    """Five samples of 40 ms were too long a step for the fins: the vehicle trembled, and nobody was told."""
    mission = figure_eight(duration_s=30.0)
    own, usual = (
        swim(tauv, mission, gravity_mps2=GRAVITY_MPS2, imu_rate_hz=rate) for rate in (rate_hz, 150.0)
    )
    every = round(150.0 / rate_hz)
    assert (own.time_ns == usual.time_ns[::every]).all()
    assert np.abs(own.state[:, 3:13] - usual.state[::every, 3:13]).max() < 1e-3
    assert np.abs(own.acceleration - usual.acceleration[::every]).max() < 1e-2


def test_a_cross_current_makes_ground_sway(tauv: Vehicle) -> None:
    """0.3 m/s across: the vehicle crabs with 0.3 m/s of sway over ground, almost none in the water."""
    mission = straight(duration_s=60.0, current=Current.towards(0.3, np.pi / 2))
    flight = fly(tauv, mission, latitude_rad=LATITUDE_RAD, gravity_mps2=GRAVITY_MPS2)
    assert flight.truth.velocity_p_mps[-1, 1] == pytest.approx(0.3, abs=0.01)
    assert abs(flight.history.velocity_through_water_p_mps[-1, 1]) < 1e-3
    assert np.abs(flight.history.state[:, 1]).max() < 1.0
    assert np.linalg.norm(flight.truth.velocity_p_mps[-1]) == pytest.approx(2.0, rel=0.02)


def test_constant_bearing_follows_the_target(tauv: Vehicle) -> None:
    """Flown at a moving target the vehicle stays near the path and near the target's place on it."""
    mission = replace(lawn_mower(duration_s=120.0), law="constant_bearing")
    history = swim(tauv, mission, gravity_mps2=GRAVITY_MPS2)
    target = mission.timetable(np.array([120.0]))[0, 8:10]
    assert np.hypot(*(history.state[-1, :2] - target)) < 3.0


def test_a_stuck_fin_is_compensated(tauv: Vehicle) -> None:
    """One fin jammed at 5 deg: the others hold course and depth, at the price of standing deflections."""
    mission = replace(straight(duration_s=60.0), stuck=StuckFin(2, np.deg2rad(5.0)))
    history = swim(tauv, mission, gravity_mps2=GRAVITY_MPS2)
    assert np.abs(history.state[:, 14] - np.deg2rad(5.0)).max() < 1e-6
    assert np.abs(history.state[-1, 1]) < 0.5
    assert history.state[-1, 2] == pytest.approx(20.0, abs=0.2)
