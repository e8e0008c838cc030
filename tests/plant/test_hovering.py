"""A vehicle that thrusters move in every direction: published numbers, laws, control, and faults of its file."""

import copy
import math
import tomllib
from dataclasses import replace
from importlib import resources
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from bottomlock.errors import ScenarioError
from bottomlock.plant import (
    Current,
    Flight,
    HoveringVehicle,
    Mission,
    StuckFin,
    fly,
    lawn_mower,
    load_vehicle,
    straight,
    swim,
    telemetry,
)
from bottomlock.plant.control import Motion, Wanted, thruster_steering
from bottomlock.plant.equations import added_mass_matrix, rigid_body_mass_matrix
from bottomlock.plant.flight import euler_rad
from bottomlock.plant.hovering_vehicle import parse_vehicle
from bottomlock.plant.maths import SCALAR, FloatArray
from bottomlock.plant.trim import check_stability, start_state
from tests.plant.helpers import GRAVITY_MPS2, LATITUDE_RAD, finned, nu_dot
from tests.plant.matrices import added_mass_coriolis_matrix, restoring_vector, rigid_body_coriolis_matrix

HEADING_RAD = math.radians(30.0)
ACROSS = Current.towards(0.15, math.pi / 2)


def rov() -> HoveringVehicle:
    vehicle = load_vehicle("bluerov2_heavy")
    assert isinstance(vehicle, HoveringVehicle)
    return vehicle


ROV = rov()
velocities = hnp.arrays(np.float64, 6, elements=st.floats(-1.5, 1.5, width=32))
thrusts = hnp.arrays(np.float64, 8, elements=st.floats(-40.0, 40.0, width=32))
quaternions = hnp.arrays(np.float64, 4, elements=st.floats(-1.0, 1.0, width=32)).filter(
    lambda q: float(np.linalg.norm(q)) > 0.1
)


def crabbing(**changed: Any) -> Mission:  # noqa: ANN401 - of a mission
    mission = lawn_mower(speed_mps=0.3, leg_m=10.0, spacing_m=4.0, dive_rate_mps=0.1, duration_s=90.0)
    settings: dict[str, Any] = {"current": ACROSS, "heading_rad": HEADING_RAD} | changed
    return replace(mission, **settings)


@pytest.fixture(scope="module")
def flight() -> Flight:
    return fly(ROV, crabbing(), latitude_rad=LATITUDE_RAD, gravity_mps2=GRAVITY_MPS2)


def test_the_thrusters_push_as_published() -> None:
    """Wu 2018: forces and moments of a newton of each; his matrix, rounded to 1e-4."""
    a = math.sqrt(0.5)
    published: list[list[float]] = [
        [a, a, -a, -a, 0, 0, 0, 0],
        [-a, a, -a, a, 0, 0, 0, 0],
        [0, 0, 0, 0, -1, -1, -1, -1],
        [0, 0, 0, 0, 0.218, 0.218, -0.218, -0.218],
        [0, 0, 0, 0, 0.12, -0.12, 0.12, -0.12],
        [-0.1888, 0.1888, 0.1888, -0.1888, 0, 0, 0, 0],
    ]
    assert np.allclose(ROV.thrusters.wrenches(), published, atol=1e-4)


def test_terminal_speeds_by_hand() -> None:
    """20 N ahead: 13.7 u + 141 u² = 20 at u = 0.3312; 217 v² = 20 at v = 0.3036: nothing is left to accelerate."""
    for axis, speed in ((0, 0.33116), (1, 0.30359)):
        push = np.linalg.pinv(ROV.thrusters.wrenches())[:, axis] * 20.0
        assert abs(nu_dot(ROV, speed * np.eye(6)[axis], push.tolist())[axis]) < 1e-3


@given(quaternions, velocities, thrusts)
def test_components_equal_the_vectorial_form(
    quaternion: FloatArray, nu: FloatArray, thrust: FloatArray
) -> None:
    """M nu' = B f - C_RB nu - C_A nu - D nu - g, with matrices built apart from the components."""
    quaternion = quaternion / np.linalg.norm(quaternion)
    drag = np.diag(
        [linear + quadratic * abs(x) for (linear, quadratic), x in zip(ROV.damping.axes(), nu, strict=True)]
    )
    turning = rigid_body_coriolis_matrix(ROV, nu) + added_mass_coriolis_matrix(ROV, nu)
    tau = (
        ROV.thrusters.wrenches() @ thrust
        - (turning + drag) @ nu
        - restoring_vector(ROV, quaternion, GRAVITY_MPS2)
    )
    mass = rigid_body_mass_matrix(ROV) + added_mass_matrix(ROV)
    found = nu_dot(ROV, nu, thrust, quaternion=quaternion)
    assert np.allclose(found, np.linalg.solve(mass, tau), rtol=1e-9, atol=1e-7)
    # without thrust and weight only drag works, and it takes energy
    assert nu @ drag @ nu >= 0.0
    assert abs(nu @ turning @ nu) < 1e-9


def test_it_starts_in_balance() -> None:
    """On its heading across a current: no acceleration, and no rate of thrusts and integrals."""
    check_stability(ROV, GRAVITY_MPS2)
    mission = replace(straight(speed_mps=0.3, duration_s=1.0), heading_rad=HEADING_RAD, current=ACROSS)
    start = start_state(ROV, mission, GRAVITY_MPS2)
    history = swim(ROV, mission, gravity_mps2=GRAVITY_MPS2)
    assert np.abs(history.acceleration[0]).max() < 1e-9
    assert np.allclose(history.state[60, 13:], start[13:], atol=1e-6)


def test_it_holds_its_heading_and_crabs(flight: Flight) -> None:
    """Heading within 3°, path within 0.3 m, depth within 0.2 m; sway through the water as large as surge."""
    frame = telemetry(flight)
    assert np.abs(frame["yaw_rad"].to_numpy() - HEADING_RAD).max() < math.radians(3.0)
    assert np.abs(frame["cross_track_m"].to_numpy()).max() < 0.3
    assert np.abs((frame["depth_m"] - frame["depth_wanted_m"]).to_numpy()).max() < 0.2
    surge, sway = flight.history.velocity_through_water_p_mps[:, :2].T
    assert np.sqrt(np.mean(sway**2)) > 0.15
    assert np.sqrt(np.mean(sway**2)) > 0.5 * np.sqrt(np.mean(surge**2))
    assert np.abs(frame.select("^thrust_.*_n$").to_numpy()).max() < ROV.thrusters.max_thrust


def test_commands_and_anti_windup_by_hand() -> None:
    """At rest, 10 m/s ahead wanted: 80 N, the limit, 28.28 N a thruster, lagged by 0.15 s; integrals driven back."""
    steer = thruster_steering(ROV, SCALAR, 0.0)
    rest = Motion(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 20.0, 0.0, (0.0, 0.0, 0.0), 0.0)
    rates = steer([0.0] * 14, rest, Wanted((0.0, 0.0, 10.0), 20.0, 0.0))
    each = 80.0 / (4.0 * math.sqrt(0.5)) / 0.15
    assert rates[:8] == pytest.approx([each, each, -each, -each, 0.0, 0.0, 0.0, 0.0], abs=1e-9)
    # 60 N s/m by 10 m/s are 600 N of which 80 are given: 10 - (600 - 80) / (1 s 60 N/m)
    assert rates[8:] == pytest.approx([10.0 - 520.0 / 60.0, 0.0, 0.0, 0.0, 0.0, 0.0], abs=1e-9)
    # to starboard, and 3 rad to turn: 80 N, and 10 N m, the limit, over four arms of 0.1888 m; 41.5 N are cut to 40
    rates = steer([0.0] * 14, rest._replace(yaw=-3.0), Wanted((0.5 * math.pi - 3.0, 0.0, 10.0), 20.0, 0.0))
    turn = 10.0 / (4.0 * 0.1888) / 0.15
    cut = 40.0 / 0.15
    assert rates[:4] == pytest.approx([-cut, cut, -each + turn, each - turn], rel=1e-3)


def test_without_a_heading_it_points_along_its_path() -> None:
    mission = replace(crabbing(), heading_rad=None)
    history = swim(ROV, mission, gravity_mps2=GRAVITY_MPS2)
    course = np.arctan2(*(np.gradient(history.state[:, k]) for k in (1, 0)))
    yaw = euler_rad(history.state[:, 3:7])[:, 2]
    assert np.abs(np.angle(np.exp(1j * (course - yaw)))[300:]).max() < math.radians(3.0)


def test_the_truth_is_smooth_and_converged(flight: Flight) -> None:
    history = flight.history
    integral = np.cumsum(0.5 / 150.0 * (history.acceleration[1:] + history.acceleration[:-1]), axis=0)
    assert np.abs(history.state[1:, 7:13] - history.state[0, 7:13] - integral).max() < 1e-4
    fine = swim(ROV, crabbing(), gravity_mps2=GRAVITY_MPS2, finer=2)
    assert np.abs(fine.state[:, :7] - history.state[:, :7]).max() < 1e-3


@pytest.mark.parametrize(
    ("mission", "words"),
    [
        (straight(speed_mps=0.7), r"speed 0\.7 m/s is outside the vehicle's 0\.1 to 0\.5 m/s"),
        (crabbing(stuck=StuckFin(2, 0.1)), "stuck_fin is given, but vehicle bluerov2_heavy has no fins"),
        (crabbing(current=Current.towards(1.3, 0.0)), r"through the water on a heading of 30 deg needs \d+ N level"),
    ],
)  # fmt: skip
def test_missions_beyond_it_are_refused(mission: Mission, words: str) -> None:
    with pytest.raises(ScenarioError, match=words):
        swim(ROV, mission, gravity_mps2=GRAVITY_MPS2)


def test_a_vehicle_with_fins_holds_no_heading() -> None:
    mission = replace(straight(), heading_rad=0.5)
    with pytest.raises(ScenarioError, match="heading_deg is given, but vehicle tauv has fins"):
        swim(finned("tauv"), mission, gravity_mps2=GRAVITY_MPS2)


@pytest.mark.parametrize(
    ("drop", "words"),
    [
        (("azimuth",), "as many entries in each list as there are thrusters; position_x 8, .* azimuth 7"),
        (("azimuth", "elevation", "position_x", "position_y", "position_z"), "do not reach all six axes"),
    ],
)
def test_thrusters_that_do_not_fit_are_refused(drop: tuple[str, ...], words: str) -> None:
    text = (resources.files("bottomlock.config") / "vehicles" / "bluerov2_heavy.toml").read_text("utf-8")
    tables = copy.deepcopy(tomllib.loads(text))
    for name in drop:
        tables["thrusters"][name] = tables["thrusters"][name][: 7 if len(drop) == 1 else 5]
    with pytest.raises(ScenarioError, match=words):
        parse_vehicle(tables, "bad")
