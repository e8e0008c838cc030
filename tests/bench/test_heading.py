"""Missions of version 1.1: dealt by their rule, with slow errors of packaged grades, which our methods estimate."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bottomlock.config.instrument_grades import grades
from bottomlock.dead_reckoning.sensors import attitude_errors
from bottomlock.dead_reckoning.track_sd import AttitudeErrors, attitude_cov
from bottomlock.errors import DataError
from bottomlock.kernel.models import HeadingModel
from partialdvl_bench import dead_reckoning
from partialdvl_bench.load import load_mission
from partialdvl_bench.make import make_missions
from partialdvl_bench.methods import estimate
from partialdvl_bench.mission import Mission
from partialdvl_bench.mission_list import levels, mission_list, missions_of
from partialdvl_bench.seeds import PUBLIC_SEED
from tests.bench.dealt import CURRENTS, DVLS, LOSSES, NOISES, SEABEDS

LONG = (True, False, False, True, True, False)
IMU_OF = {"magnetic": "mems", "mti_ahrs": "tactical", "gyrocompass": "fibre_optic"}


def _dealt() -> list[tuple[object, ...]]:
    """The missions by the rule above their list in missions.toml."""
    draw = np.random.default_rng(PUBLIC_SEED)

    def dealt(named: list[str], count: int = 6) -> list[str]:
        rounds = [draw.permutation(named) for _ in range(-(-count // len(named)))]
        return [str(one) for one in np.concatenate(rounds)[:count]]

    seabed, current, dvl, noise, loss = (
        dealt(list(named)) for named in (SEABEDS, CURRENTS, DVLS, NOISES, LOSSES)
    )
    while ("flat", "geometric") in zip(seabed, loss, strict=True):
        loss = dealt(list(LOSSES))
    near, others = iter(dealt(["box", "lawn"], 3)), iter(dealt(["line", "zigzag", "lawn", "box"], 3))
    path = [next(near if long else others) for long in LONG]
    kinds = [(vehicle, heading) for heading in IMU_OF for vehicle in ("remus100", "tauv")]
    while True:
        one, other = (int(k) for k in draw.choice(6, 2, replace=False))
        if kinds[one][1] != kinds[other][1] and LONG[one] != LONG[other]:
            break
    return [
        (
            "validation" if k in (one, other) else "train", vehicle, IMU_OF[heading], seabed[k], current[k], dvl[k],
            loss[k], noise[k], path[k], 3600.0 if LONG[k] else 250.0, heading,
        )
        for k, (vehicle, heading) in enumerate(kinds)
    ]  # fmt: skip


def test_the_list_is_what_the_rule_deals() -> None:
    listed = [
        (s.split, s.vehicle, s.imu, s.seabed, s.current, s.dvl, s.loss, s.noise, s.path, s.duration_s, s.heading)
        for s in missions_of(("train", "validation"), version="1.1")
        if s.heading
    ]  # fmt: skip
    assert listed == _dealt()


def test_versions_stand_apart_and_old_names_have_no_heading() -> None:
    first, later, last = (missions_of(version=version) for version in ("1", "1.1", "1.2"))
    assert (*first, *later, *last) == mission_list()
    assert {(spec.heading, spec.slip) for spec in first} == {("", "")}
    assert all(spec.name.split("-")[2] == (spec.heading or spec.slip or spec.seabed) for spec in later)
    assert missions_of(names=(later[0].name,)) == later[:1]
    with pytest.raises(DataError, match=r"no version is called '2' \(known: 1, 1\.1, 1\.2\)"):
        missions_of(version="2")
    assert len(missions_of(("test",), version="1.1")) == 18


def test_slow_errors_are_those_of_the_packaged_grades() -> None:
    for name, own in levels()["heading"].items():
        keys = grades("attitude")[name].keys
        assert own == {
            "noise_deg": keys["yaw_sd_deg"],
            "offset_sd_deg": keys["yaw_offset_sd_deg"],
            "walk_sd_deg": keys["yaw_walk_sd_deg"],
            "walk_time_s": keys["walk_time_s"],
        }, name


@cache
def _mission(heading: str) -> Mission:
    """The short mission with this reference, from the public seed."""
    public = missions_of(("train", "validation"), version="1.1")
    (spec,) = (s for s in public if s.heading == heading and s.duration_s < 1000.0)
    out = Path(mkdtemp(prefix="bench"))
    make_missions([spec], lambda _: PUBLIC_SEED, out)
    return load_mission(out / spec.split / spec.name)


def _yaw(attitude_t_p: np.ndarray) -> np.ndarray:
    return np.asarray(Rotation.from_quat(attitude_t_p, scalar_first=True).as_euler("ZYX")[:, 0])


def _wrapped(angle: np.ndarray) -> np.ndarray:
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)


def test_the_reading_is_off_for_long_by_what_the_case_claims() -> None:
    """Errors of a magnetic compass: nearly all of them outlasts a reading, and their size is the grade's."""
    mission = _mission("magnetic")
    own = levels()["heading"]["magnetic"]
    claimed = mission.model.heading
    assert isinstance(claimed, HeadingModel)
    assert claimed == HeadingModel(
        sd_rad=np.deg2rad(own["noise_deg"]), offset_sd_rad=np.deg2rad(own["offset_sd_deg"]),
        walk_sd_rad=np.deg2rad(own["walk_sd_deg"]), walk_time_s=own["walk_time_s"],
    )  # fmt: skip
    assert mission.truth is not None
    same = np.isin(mission.heading.time_ns, mission.truth.time_ns)
    error = _wrapped(mission.heading.value[same] - _yaw(mission.truth.attitude_t_p))
    # From one second to the next the white noise changes, and the walk by √(2/60) of its size.
    step = np.hypot(np.sqrt(2.0) * own["noise_deg"], np.sqrt(2.0 / 60.0) * own["walk_sd_deg"])
    assert np.std(np.diff(error)) == pytest.approx(np.deg2rad(step), rel=0.2)
    assert np.sqrt(np.mean(error**2)) > 3.0 * claimed.sd_rad


def test_our_methods_estimate_the_slow_errors() -> None:
    """NEES of the position of `tc`, a component: consistent with the states, not with white noise alone."""
    mission = _mission("magnetic")
    assert mission.model.heading is not None
    assert mission.truth is not None
    alone = replace(mission.model, heading=HeadingModel(sd_rad=mission.model.heading.sd_rad))
    off = {}
    for name, one in (("states", mission), ("white", replace(mission, model=alone))):
        found = estimate(one, "tc")
        assert found.position_t_m is not None
        assert found.position_cov is not None
        error = found.position_t_m - mission.truth.position_t_m
        off[name] = float(
            np.mean(
                np.einsum("ni,ni->n", error, np.linalg.solve(found.position_cov, error[..., None])[..., 0])
            )
            / 3
        )
    assert off["states"] < 1.5
    assert off["white"] > 4.0 * off["states"]


def test_dead_reckoning_claims_depth_bias_and_slow_errors() -> None:
    mission = _mission("mti_ahrs")
    assert mission.truth is not None
    claimed, heading = (
        attitude_errors(dead_reckoning.sensors_of(mission), mission.model),
        mission.model.heading,
    )
    assert heading is not None
    assert claimed.offset_sd_rad[2] == heading.offset_sd_rad
    assert (claimed.walk_sd_rad[2], claimed.walk_time_s) == (heading.walk_sd_rad, heading.walk_time_s)
    assert (claimed.white_sd_rad[2], claimed.white_held_s) == (heading.sd_rad, 1.0)
    found = dead_reckoning.estimate(mission)
    assert found.position_t_m is not None
    assert found.position_cov is not None
    error = (found.position_t_m - mission.truth.position_t_m) / np.sqrt(
        np.diagonal(found.position_cov, axis1=1, axis2=2)
    )
    assert np.abs(error).max() < 4.0


def test_a_reading_that_is_held_turns_the_way_for_as_long() -> None:
    """By hand: at 2 m/s each of 100 readings, 1 s apart, moves the position by 2 m times its error: 100 · (2 σ)².

    However often the attitude between them is given.
    """
    grid_ns = np.arange(0, 100_000_000_001, 100_000_000, dtype=np.int64)
    moved = np.outer(grid_ns * 1e-9, [2.0, 0.0, 0.0])
    errors = AttitudeErrors(white_sd_rad=(0.0, 0.0, 0.01), white_held_s=1.0)
    P = attitude_cov(grid_ns, moved, errors, grid_ns)
    assert P[-1, 1, 1] == pytest.approx(100.0 * (2.0 * 0.01) ** 2, rel=1e-9)
    by_reading = attitude_cov(grid_ns, moved, replace(errors, white_held_s=None), grid_ns)
    assert by_reading[-1, 1, 1] == pytest.approx(1000.0 * (0.2 * 0.01) ** 2, rel=1e-9)
