"""Dead reckoning: the position of known motions, the sigma that it claims over ensembles, and its place in a replay."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from bottomlock.dead_reckoning.track import (
    AttitudeErrors,
    Begin,
    DepthAid,
    Reckoned,
    StructureFunction,
    Velocities,
    VelocityErrors,
    dead_reckon,
    structure_function,
)
from bottomlock.files.replay_tables import ReplayTables
from bottomlock.own_method import DEAD_RECKONING as METHOD
from bottomlock.recordings.streams import Attitudes, Depths, Inertial
from bottomlock.replay.case import load_case
from bottomlock.replay.reckon import attitude_errors, carried
from tests.dive import Dive, drawn_dive, gauss_markov
from tests.dive_logs import write_case
from tests.replay.undiagnosed import replay_undiagnosed

Floats = NDArray[np.float64]
NS = 1_000_000_000
STILL = StructureFunction(np.array([0.0, 1.0]), np.zeros((2, 3)), usual_s=0.5)
PERFECT = VelocityErrors(0.0, np.zeros((3, 3)), STILL)
FLAT = Begin(0, np.zeros(3), np.array([1.0, 0.0, 0.0]), np.zeros(3), np.zeros(3))


def ns(seconds: Floats) -> NDArray[np.int64]:
    return np.round(seconds * NS).astype(np.int64)


def reckoned(
    yaw: Floats, seconds: Floats, velocity: Floats, *, cov: Floats | None = None, **keys: object
) -> Reckoned:
    """Along a level vehicle whose pings and attitudes have the same times."""
    attitude = Rotation.from_euler("Z", yaw[:, None])
    settings: dict[str, object] = {"velocity_errors": PERFECT, "attitude_errors": AttitudeErrors()}
    own = np.zeros((len(seconds), 3, 3)) if cov is None else cov
    return dead_reckon(
        Velocities(ns(seconds), velocity, own), Attitudes(ns(seconds), attitude), FLAT, ns(seconds),
        **(settings | keys),  # type: ignore[arg-type]
    )  # fmt: skip


def test_a_circle_with_a_lever_arm() -> None:
    """The IMU moves on a circle of radius 10 m; the DVL, 2 m ahead and 1 m to the right, on another one."""
    seconds, rate = np.arange(0.0, 80.0, 0.01), 0.05
    yaw, lever = rate * seconds, np.array([2.0, 1.0, 0.0])
    at_dvl = np.array([0.5, 0.0, 0.0]) + np.cross([0.0, 0.0, rate], lever)
    found = reckoned(yaw, seconds, np.tile(at_dvl, (len(seconds), 1)), lever_p_m=lever)
    true = 10.0 * np.stack([np.sin(yaw), 1.0 - np.cos(yaw), 0.0 * yaw], axis=1)
    assert np.abs(found.position_t_m - true).max() < 1e-3
    assert np.abs(found.velocity_p_mps - [0.5, 0.0, 0.0])[20:-20].max() < 1e-6


def test_the_last_velocity_is_held_and_turned() -> None:
    """No ping after the third second: the vehicle goes on at 1 m/s along its own bow, which the attitude turns."""
    seconds = np.arange(0.0, 30.0, 0.1)
    yaw = np.where(seconds < 10.0, 0.0, np.pi / 2.0)
    pings = seconds[seconds < 3.0]
    found = dead_reckon(
        Velocities(ns(pings), np.tile([1.0, 0.0, 0.0], (len(pings), 1)), np.zeros((len(pings), 3, 3))),
        Attitudes(ns(seconds), Rotation.from_euler("Z", yaw[:, None])), FLAT, ns(seconds),
        velocity_errors=PERFECT, attitude_errors=AttitudeErrors(),
    )  # fmt: skip
    assert found.position_t_m[-1, :2] == pytest.approx([9.95, 19.9], abs=0.1)


def test_the_depth_sensor_gives_the_vertical() -> None:
    seconds = np.arange(0.0, 20.0, 0.5)
    depths = Depths(ns(seconds), 5.0 + 0.1 * seconds)
    velocity = np.tile([1.0, 0.0, 0.3], (len(seconds), 1))
    aid = DepthAid(depths, 0.05, np.array([0.0, 0.0, 0.4]))
    found = reckoned(0.0 * seconds, seconds, velocity, depth=aid)
    assert found.position_t_m[:, 2] == pytest.approx(4.6 + 0.1 * seconds)
    assert found.position_cov_m2[-1, 2, 2] == pytest.approx(0.05**2)


SOURCES = ("noise", "bias", "scale", "offset", "walk", "white")


@pytest.mark.long
@pytest.mark.parametrize("only", [*SOURCES, "all"])
def test_the_claimed_covariance_is_that_of_an_ensemble(only: str) -> None:
    """200 dives with drawn errors: position errors over their covariance are chi-squared (band of 0.9999, two axes)."""
    on = {name: float(only in {name, "all"}) for name in SOURCES}
    seconds = np.arange(0.0, 600.0, 1.0)
    yaw = 0.8 * np.sin(seconds / 40.0)
    velocity = np.stack(
        [1.0 + 0.3 * np.sin(seconds / 25.0), 0.2 * np.cos(seconds / 31.0), 0.0 * seconds], axis=1
    )
    noise, bias, scale = 0.1 * on["noise"], 0.01 * on["bias"], 0.01 * on["scale"]
    offset, wander, white = (
        np.deg2rad(d) * on[n] for d, n in ((1.0, "offset"), (2.0, "walk"), (5.0, "white"))
    )
    cov = np.tile(noise**2 * np.eye(3), (len(seconds), 1, 1))
    keys = {
        "velocity_errors": VelocityErrors(scale, bias**2 * np.eye(3), STILL),
        "attitude_errors": AttitudeErrors((0, 0, offset), (0, 0, wander), (0, 0, white), walk_time_s=120.0),
        "cov": cov,
    }
    true = reckoned(yaw, seconds, velocity, **keys)  # type: ignore[arg-type]
    rng, total, runs = np.random.default_rng(5), 0.0, 200
    rows = [200, 599]
    for _ in range(runs):
        wrong_yaw = yaw + offset * rng.normal() + white * rng.normal(size=600)
        wrong_yaw += gauss_markov(wander * rng.normal(size=600), 1.0, 120.0)
        wrong = velocity * (1.0 + scale * rng.normal()) + bias * rng.normal(size=3)
        wrong = wrong + noise * rng.normal(size=velocity.shape)
        off = (reckoned(wrong_yaw, seconds, wrong, **keys).position_t_m - true.position_t_m)[rows, :2]  # type: ignore[arg-type]
        # One source at a time turns or stretches the way: its covariance has rank one but for a little.
        P = true.position_cov_m2[rows, :2, :2]
        total += float(sum((e @ e) / np.trace(p) for e, p in zip(off, P, strict=True))) / len(rows)
    # The mean square over the claimed one: at least one degree of freedom a run, so this band is the wider one.
    low, high = chi2.ppf([5e-5, 1.0 - 5e-5], runs) / runs
    assert low < total / runs < high, total / runs


def test_the_sigma_of_a_held_velocity_is_that_of_the_vehicle() -> None:
    """A velocity that is a first-order process: after a hold of 60 s the position is off by what E(h) says."""
    rng, tau, sd = np.random.default_rng(3), 20.0, 0.2
    seconds = np.arange(0.0, 40_000.0, 1.0)
    velocity = gauss_markov(sd * rng.normal(size=(len(seconds), 3)), 1.0, tau)
    change = structure_function(ns(seconds), velocity, np.zeros(3))
    assert change is not None
    holds = np.array([5.0, 60.0, 300.0])
    # D(s) = 2 sd² (1 − exp(−s/τ)): the integral of s D(s) in closed form.
    x = holds / tau
    wanted = 2.0 * sd**2 * tau**2 * (0.5 * x**2 - 1.0 + np.exp(-x) * (1.0 + x))
    assert np.sqrt(change.of_position(holds).mean(axis=1)) == pytest.approx(np.sqrt(wanted), rel=0.1)
    moved = np.cumsum(velocity, axis=0)
    off = moved[60::97] - moved[:-60:97] - 60.0 * velocity[:-60:97]
    assert np.sqrt(np.mean(off**2)) == pytest.approx(np.sqrt(wanted[1]), rel=0.15)


@pytest.fixture(scope="module")
def dive() -> Dive:
    return drawn_dive(41, seconds=120.0)


@pytest.fixture(scope="module")
def replayed(dive: Dive, tmp_path_factory: pytest.TempPathFactory) -> ReplayTables:
    path = write_case(dive, tmp_path_factory.mktemp("dive"))
    text = path.read_text(encoding="utf-8")
    outage = '[[what_if]]\nname = "dark"\noutages = [{ beams = [1, 2, 3, 4], from_s = 30.0, to_s = 60.0 }]\n'
    path.write_text(text + outage, encoding="utf-8")
    return replay_undiagnosed(load_case(path))


def test_it_stands_in_every_table_without_being_named(replayed: ReplayTables) -> None:
    assert replayed.manifest["methods"] == ["lc", "tc", METHOD]
    for table in (replayed.samples, replayed.runs):
        rows = table.filter(pl.col("method") == METHOD)
        assert set(rows["what_if"]) == {"recorded", "dark"}
        assert set(rows["pass"]) == {"forward"}


def test_it_follows_the_truth_as_far_as_it_claims(replayed: ReplayTables) -> None:
    runs = {
        row["what_if"]: row for row in replayed.runs.filter(pl.col("method") == METHOD).iter_rows(named=True)
    }
    assert runs["recorded"]["position_rms_over_time_m"] < 0.3
    assert runs["dark"]["position_rms_over_time_m"] > 5.0 * runs["recorded"]["position_rms_over_time_m"]
    assert all(0.05 < row["position_normalised_rms_over_time"] < 2.0 for row in runs.values())


def test_without_an_attitude_it_is_left_out(dive: Dive, tmp_path: Path) -> None:
    path = write_case(dive, tmp_path)
    text = path.read_text(encoding="utf-8")
    path.write_text(text[: text.index("[attitude]")] + text[text.index("[reference]") :], encoding="utf-8")
    assert replay_undiagnosed(load_case(path)).manifest["methods"] == ["lc", "tc"]


def test_the_gyros_carry_the_attitude_over_a_hole() -> None:
    """Turns about all axes for a minute without attitudes; gyros off by 0.1 deg/s end at the reading after the hole."""
    seconds, fine_s = np.arange(0.0, 100.0, 0.5), np.arange(0.0, 100.0, 0.01)
    omega = np.deg2rad(
        np.stack([5.0 * np.sin(fine_s / 4.0), 3.0 * np.cos(fine_s / 3.0), 8.0 + 0.0 * fine_s], axis=1)
    )
    path = [Rotation.identity()]
    for rate in omega[:-1]:
        path.append(path[-1] * Rotation.from_rotvec(0.01 * rate))
    true = Rotation.concatenate(path)
    there = (seconds < 20.0) | (seconds > 80.0)
    held = Attitudes((seconds[there] * 1e9).astype(np.int64), true[::50][there])
    off = omega + np.deg2rad([0.0, 0.0, 0.1])
    found = carried(held, Inertial((fine_s * 1e9).astype(np.int64), np.zeros_like(off), off))
    assert (np.diff(found.time_ns) > 0).all()
    assert np.diff(found.time_ns).max() <= 0.5e9
    errors = (true[np.round(found.time_ns * 1e-7).astype(int)].inv() * found.attitude).magnitude()
    assert np.rad2deg(errors.max()) < 1.5
    assert len(found.time_ns) > len(held.time_ns) + 250
    # Nothing is added where nothing is missing.
    whole = Attitudes((seconds * 1e9).astype(np.int64), true[::50])
    assert carried(whole, Inertial((fine_s * 1e9).astype(np.int64), np.zeros_like(off), off)) is whole


def test_gyros_carry_the_attitude_beyond_its_last_reading() -> None:
    """An attitude that ends before the dive: the heading does not stay where it was."""
    seconds, fine_s = np.arange(0.0, 40.0, 0.5), np.arange(0.0, 100.0, 0.01)
    rate = np.deg2rad([0.0, 0.0, 3.0])
    held = Attitudes(ns(seconds), Rotation.from_rotvec(seconds[:, None] * rate))
    found = carried(held, Inertial(ns(fine_s), np.zeros((len(fine_s), 3)), np.tile(rate, (len(fine_s), 1))))
    assert found.time_ns[-1] > 99.0e9
    true = Rotation.from_rotvec(found.time_ns[:, None] * 1e-9 * rate)
    assert np.rad2deg((true.inv() * found.attitude).magnitude().max()) < 0.1


def test_the_claims_of_the_attitude_are_taken_apart(dive: Dive, tmp_path: Path) -> None:
    """A 1 sigma alone lasts; beside an offset or a walk it is white. Level and yaw are apart."""
    path = write_case(dive, tmp_path)
    stream = load_case(path).attitude
    assert stream is not None
    alone = attitude_errors(stream)
    assert np.rad2deg(alone.offset_sd_rad) == pytest.approx([1.0, 1.0, 1.0])
    assert (list(alone.white_sd_rad), list(alone.walk_sd_rad)) == ([0.0] * 3, [0.0] * 3)
    text = path.read_text(encoding="utf-8").replace(
        "yaw_sd_deg = 1.0",
        "yaw_sd_deg = 0.5\nyaw_offset_sd_deg = 3.0\nyaw_walk_sd_deg = 2.0\nwalk_time_s = 90.0",
    )
    path.write_text(text, encoding="utf-8")
    stream = load_case(path).attitude
    assert stream is not None
    apart = attitude_errors(stream)
    assert np.rad2deg(apart.offset_sd_rad) == pytest.approx([1.0, 1.0, 3.0])
    assert np.rad2deg(apart.walk_sd_rad) == pytest.approx([0.0, 0.0, 2.0])
    assert np.rad2deg(apart.white_sd_rad) == pytest.approx([0.0, 0.0, 0.5])
    assert apart.walk_time_s == 90.0
