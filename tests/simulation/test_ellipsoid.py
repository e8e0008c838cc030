"""Navigation on the ellipsoid: the kernel against an integration in geodetic coordinates, and the truths laid on it."""

from typing import Any, Literal

import numpy as np
import polars as pl
import pytest
from scipy.spatial.transform import Rotation

from bottomlock import geodesy, kernel
from bottomlock.config.scenario import load_scenario
from bottomlock.kernel import models
from bottomlock.replay.findings.earth import earth_findings
from bottomlock.replay.vehicle_motion import level_axes
from bottomlock.simulation.analytic import Attitudes, sample_motion
from bottomlock.truth import Array, EllipsoidPath, Truth, on_ellipsoid
from tests.oracle import geodesy as oracle_geodesy
from tests.oracle import geodetic_navigation as oracle

SPEED_MPS, DURATION_S, DEPTH_M = 25.0, 2000.0, 30.0
"""50 km, in a time in which the vertical channel, which is unstable, multiplies an error by ten alone."""


def environment(latitude_deg: float) -> models.Environment:
    latitude = np.deg2rad(latitude_deg)
    return models.Environment(latitude_rad=latitude, gravity_mps2=kernel.normal_gravity_mps2(latitude))


def rhumb_line(latitude_deg: float, heading_deg: float, rate_hz: float = 50.0) -> tuple[Truth, Truth]:
    """A level way at constant heading and depth with a slow roll, over the plane, laid on the ellipsoid."""

    def motion(t: Array) -> Attitudes:
        zero, still = np.zeros_like(t), np.zeros((len(t), 3))
        return Attitudes(
            0.1 * np.sin(0.02 * t), zero, zero + np.deg2rad(heading_deg),
            0.002 * np.cos(0.02 * t), zero, zero,
            still + np.array([SPEED_MPS, 0.0, 0.0]), still,
        )  # fmt: skip

    here = environment(latitude_deg)
    times = np.round(np.arange(round(DURATION_S * rate_hz) + 1) * 1e9 / rate_hz).astype(np.int64)
    flat = sample_motion(
        motion, times, latitude_rad=here.latitude_rad, gravity_mps2=here.gravity_mps2,
        earth_rate_radps=here.earth_rate_radps, depth_m=DEPTH_M,
    )  # fmt: skip
    return flat, on_ellipsoid(flat, here.earth_rate_radps)


def navigated(truth: Truth, latitude_deg: float, earth: Literal["ellipsoid", "tangent_plane"]) -> Any:  # noqa: ANN401 - the kernel's dict
    """A navigator without aiding along a perfect IMU, from the truth's start to its end."""
    model = load_scenario("straight").kernel_model(truth.gravity_mps2)
    model = model.replace(environment=environment(latitude_deg).replace(earth=earth))
    start = models.InitialState(
        time_ns=0,
        position_t_m=truth.position_t_m[0],
        attitude_t_p=truth.attitude_t_p[0],
        velocity_p_mps=truth.velocity_p_mps[0],
    )
    navigator = kernel.Navigator(
        kernel.BeamGeometry.janus(0.35), model, models.Options(), start, method="ins"
    )
    navigator.push_imu_block(
        truth.time_ns, omega_p_radps=truth.omega_p_radps, force_p_mps2=truth.force_p_mps2
    )
    return navigator.state()


@pytest.mark.first_cases(1)
@pytest.mark.parametrize("latitude_deg", [0.0, 45.0, -45.0, 70.0, 85.0])
@pytest.mark.parametrize("heading_deg", [0.0, 90.0, 215.0])
def test_the_kernel_agrees_with_an_integration_in_geodetic_coordinates(
    latitude_deg: float, heading_deg: float
) -> None:
    """50 km unaided: the tangent frame without transport rate against latitude, longitude and transport rate."""
    flat, truth = rhumb_line(latitude_deg, heading_deg)

    def inertial(t: float) -> tuple[Array, Array]:
        low = min(int(t * 50.0), len(flat.time_ns) - 2)
        part = t * 50.0 - low
        between = [
            values[low] * (1.0 - part) + values[low + 1] * part
            for values in (truth.omega_p_radps, truth.force_p_mps2)
        ]
        return between[0], between[1]

    latitude = np.deg2rad(latitude_deg)
    rotation = Rotation.from_quat(flat.attitude_t_p[0][[1, 2, 3, 0]]).as_matrix()
    start = oracle.Navigated(latitude, 0.0, -DEPTH_M, rotation @ truth.velocity_p_mps[0], rotation)
    end = oracle.navigate(start, inertial, DURATION_S, 0.5)
    state = navigated(truth, latitude_deg, "ellipsoid")
    # The oracle's end in the tangent frame, by the oracle's geodesy.
    home = oracle_geodesy.axes(latitude, 0.0)
    there = home @ (
        oracle_geodesy.ecef(end.latitude, end.longitude, end.height) - oracle_geodesy.ecef(latitude, 0.0, 0.0)
    )
    assert np.linalg.norm(state["position_t_m"] - there) < 0.05
    own = Rotation.from_quat(np.asarray(state["attitude_t_p"])[[1, 2, 3, 0]])
    level = home @ oracle_geodesy.axes(end.latitude, end.longitude).T
    expected = Rotation.from_matrix(level @ end.rotation_n_p)
    assert (own * expected.inv()).magnitude() < 1e-7
    velocity = own.inv().apply(level @ end.velocity_n)
    assert np.abs(np.asarray(state["velocity_p_mps"]) - velocity).max() < 2e-4
    # Both have kept depth and heading of the way that was meant.
    assert end.height == pytest.approx(-DEPTH_M, abs=0.05)
    heading = Rotation.from_matrix(end.rotation_n_p).as_euler("ZYX")[0]
    assert np.sin(heading - np.deg2rad(heading_deg)) == pytest.approx(0.0, abs=1e-6)


def test_blocks_give_the_truth_of_the_whole() -> None:
    """A path followed in blocks is the path followed at once."""
    flat, truth = rhumb_line(70.0, 60.0)
    path = EllipsoidPath(environment(70.0))
    arrays = {name: array for name, array in flat.kernel_arrays().items() if name != "time_ns"}
    for rows in (slice(0, 1), slice(1, 7001), slice(7001, None)):
        part = path.follow({name: array[rows] for name, array in arrays.items()})
    assert part["position_t_m"][-1] == pytest.approx(truth.position_t_m[-1], abs=1e-6)
    assert part["force_p_mps2"][-1] == pytest.approx(truth.force_p_mps2[-1], abs=1e-10)


def test_a_rhumb_line_keeps_depth_and_heading() -> None:
    """At constant depth and heading the latitude grows with the arc of the meridian, and the height stays."""
    flat, truth = rhumb_line(45.0, 0.0)
    latitude, longitude, height = geodesy.geodetic_from_tangent(
        truth.position_t_m, geodesy.Place(np.deg2rad(45.0), 0.0, 0.0)
    )
    assert np.abs(height + DEPTH_M).max() < 1e-6
    assert np.abs(longitude).max() < 1e-12
    # Meridian arc from 45 deg by Simpson's rule on M + h.
    middle = 0.5 * (latitude[0] + latitude[-1])
    mean = sum(w * (geodesy.radii_m(x)[0] - DEPTH_M) for w, x in zip(
        (1 / 6, 4 / 6, 1 / 6), (latitude[0], middle, latitude[-1]), strict=True
    ))  # fmt: skip
    assert (latitude[-1] - latitude[0]) * mean == pytest.approx(flat.position_t_m[-1, 0], abs=1e-3)


def test_local_earth_is_that_of_geodesy() -> None:
    """Depth and level axes of the kernel against the package's geodesy and the oracle's axes."""
    home = geodesy.Place(np.deg2rad(-62.0), 0.0, 0.0)
    position = np.random.default_rng(7).uniform(-60e3, 60e3, (50, 3)) * [1.0, 1.0, 0.05]
    here = kernel.local_earth(environment(-62.0), position)
    latitude, longitude, height = geodesy.geodetic_from_tangent(position, home)
    assert here["depth_m"] == pytest.approx(-height, abs=1e-7)
    axes = oracle_geodesy.axes(home.latitude_rad, 0.0)
    for k in range(len(position)):
        wanted = axes @ oracle_geodesy.axes(latitude[k], longitude[k]).T
        assert np.abs(here["rotation_t_n"][k] - wanted).max() < 1e-10


def samples(north_m: list[float], down_m: list[float]) -> pl.DataFrame:
    """Rows of a replay's table, as far as the findings read them."""
    return pl.DataFrame({"north_m": north_m, "east_m": [0.0] * len(north_m), "down_m": down_m})


def test_a_replay_names_the_limits_that_it_passes() -> None:
    """Near a pole, deeper than the sea, and far from the origin of a plane; nothing on a common dive."""
    home, polar = environment(45.0), environment(89.95)
    assert earth_findings(home, samples([0.0, 40e3], [10.0, 130.0])) == []
    assert [one.kind for one in earth_findings(polar, samples([0.0, 100.0], [0.0, 0.0]))] == ["near_pole"]
    assert [one.kind for one in earth_findings(home, samples([0.0], [12e3]))] == ["height_limits"]
    plane = home.replace(earth="tangent_plane")
    assert earth_findings(plane, samples([0.0, 1500.0], [0.0, 0.0])) == []
    (finding,) = earth_findings(plane, samples([0.0, 10e3], [0.0, 0.0]))
    assert finding.kind == "tangent_plane"
    assert "7.8 m" in finding.text


def test_level_axes_of_a_replay() -> None:
    """East at a place 50 km east of 45 deg north has turned to port, by the convergence of the meridians."""
    here = environment(45.0)
    east = np.array([[0.0, 50e3, 0.0]])
    axes = level_axes(here, east)[0]
    yaw = np.rad2deg((axes * Rotation.from_euler("z", 90.0, degrees=True)).as_euler("ZYX")[0])
    assert yaw == pytest.approx(90.0 - np.rad2deg(50e3 / 6_388_838.0), abs=1e-3)
    assert level_axes(here.replace(earth="tangent_plane"), east)[0].magnitude() == 0.0
