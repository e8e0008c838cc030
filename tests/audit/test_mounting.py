"""How a DVL sits: what was planted is found within its own standard deviations, and what cannot be seen is said."""

from functools import lru_cache

import numpy as np
import pytest

from bottomlock.audit.logs import BeamLog, tracked
from bottomlock.audit.mounting import PARTS, Mounting
from bottomlock.audit.run import Audit
from tests.oracle import mounting as oracle
from tests.oracle.rotations import Array

ANGLES = tuple(np.deg2rad([0.6, -0.4, 1.5]))
ARM = np.array([-1.2, 0.3, 0.4])
SCALE, OFFSET_S, SD_MPS = 0.01, 0.35, 0.004


def alone(time_s: Array, velocity_mps: Array) -> BeamLog:
    """A log of the instrument's velocity."""
    none = np.zeros((len(time_s), 0))
    time_ns = np.round(time_s * 1e9).astype(np.int64)
    return BeamLog("alone", time_ns, none, none.astype(bool), velocity_mps)


def mounting_of(audit: Audit) -> Mounting:
    """What was estimated."""
    assert audit.mounting is not None
    return audit.mounting


@lru_cache
def streams(lively: float, seconds: int = 300) -> tuple[Array, Array, Array]:
    """Reference at 5 Hz: times, rpy, velocity."""
    t = np.arange(0.0, seconds, 0.2)
    rpy = np.array([oracle.angles(s, lively) for s in t])
    velocity = np.array(
        [oracle.turn(*oracle.angles(s, lively)) @ oracle.surge_sway_heave(s, lively) for s in t]
    )
    return t, rpy, velocity


@lru_cache
def readings(lively: float) -> tuple[Array, Array]:
    """Times of a DVL at 2 Hz on its own clock, OFFSET_S behind, and what it reads without noise."""
    own = np.arange(2.0, 295.0, 0.5)
    mounted = oracle.turn(*ANGLES)
    reads = [oracle.dvl_reads(s + OFFSET_S, lively, mounted=mounted, arm=ARM, scale=SCALE) for s in own]
    return own, np.array(reads)


def plant(seed: int, *, lively: float = 1.0, flip: bool = False) -> Audit:
    """The DVL with noise, and what stands beside it."""
    t, rpy, velocity = streams(lively)
    rng = np.random.default_rng(seed)
    own, clean = readings(lively)
    reads = (clean + SD_MPS * rng.normal(size=clean.shape)) * ([1, -1, 1] if flip else [1, 1, 1])
    reference = tracked(np.round(t * 1e9).astype(np.int64), rpy, velocity)
    return Audit(alone(own, reads), reference=reference)


def misses(found: Mounting) -> Array:
    """Every quantity's error in its own standard deviations: roll, pitch, yaw, arm, clock, scale."""
    rpy = (found.values["misalignment"] - ANGLES) / found.sds["misalignment"]
    arm = (found.values["lever_arm"] - ARM) / found.sds["lever_arm"]
    rest = [
        (found.values["clock_offset"][0] - OFFSET_S) / found.sds["clock_offset"][0],
        (found.values["velocity_scale"][0] - SCALE) / found.sds["velocity_scale"][0],
    ]
    return np.concatenate([rpy, arm, rest])


@pytest.mark.long
def test_deviations_are_consistent() -> None:
    """Eight quantities a log: their normalised errors have a mean square near 1.

    For 96 independent errors the mean square has a deviation of 0.14.
    """
    off = np.array([misses(mounting_of(plant(seed))) for seed in range(12)])
    assert 0.5 < float(np.mean(off**2)) < 2.0


@pytest.mark.long
def test_a_straight_course_shows_no_lever_arm() -> None:
    """Without turns ω × l is nothing, and roll about the course turns nothing into anything."""
    audit = plant(2, lively=0.0)
    found = mounting_of(audit)
    assert (found.sds["lever_arm"] > PARTS["lever_arm"].limit).all()
    assert found.sds["misalignment"][0] > PARTS["misalignment"].limit
    unseen = [one.text for one in audit.findings if one.kind == "not_observable"]
    for kind in ("lever_arm", "clock_offset"):
        assert any(PARTS[kind].what in text for text in unseen)
    (turned,) = (one for one in audit.findings if one.kind == "misalignment")
    assert "roll not observable" in turned.text
    assert "lever_arm" not in {one.kind for one in audit.findings}


def test_a_left_handed_frame() -> None:
    audit = plant(3, flip=True)
    found = mounting_of(audit)
    assert found.mirrored
    assert "left_handed" in {one.kind for one in audit.findings}
    np.testing.assert_allclose(found.values["lever_arm"], ARM, atol=0.05)


def steady(
    seed: int, *, yaw_deg: float = 0.0, arm_m: float = 0.0, scale: float = 0.0, delay_s: float = 0.0
) -> Audit:
    """A vehicle at 2 m/s that turns by 90 degrees every minute, with white noise of the reference."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 400.0, 0.2)

    def turned(s: Array) -> Array:
        return np.asarray(sum(np.pi / 4 * (1.0 + np.tanh((s - at) / 3.0)) for at in range(30, 400, 60)))

    def side(s: Array) -> Array:
        """Sway that follows the rate of turn."""
        return np.asarray(0.2 * sum(1.0 / np.cosh((s - at) / 3.0) ** 2 for at in range(30, 400, 60)))

    def surge_and_sway(s: Array) -> Array:
        return np.stack([np.full_like(s, 2.0), side(s), 0.0 * s], axis=1)

    rpy = np.stack([0.0 * t, 0.0 * t, turned(t)], axis=1)
    C = np.array([oracle.turn(*one) for one in rpy])
    velocity = np.einsum("nij,nj->ni", C, surge_and_sway(t)) + 0.01 * rng.normal(size=rpy.shape)
    own = np.arange(5.0, 390.0, 0.5)
    rate = np.gradient(turned(own + delay_s), own)
    moved = surge_and_sway(own + delay_s) + np.stack([0.0 * own, rate * arm_m, 0.0 * own], axis=1)
    reads = (1.0 + scale) * moved @ oracle.turn(0.0, 0.0, np.deg2rad(yaw_deg))
    reads += 0.02 * rng.normal(size=reads.shape)
    noisy = rpy + 5e-4 * rng.normal(size=rpy.shape)
    reference = tracked(np.round(t * 1e9).astype(np.int64), noisy, velocity)
    return Audit(alone(own, reads), reference=reference)


@pytest.mark.first_cases(1)
@pytest.mark.parametrize("seed", range(40, 44))
def test_a_steady_course_with_turns(seed: int) -> None:
    """The speed is constant, but yaw, scale and lever arm are told with their deviations; nothing else is."""
    audit = steady(seed, yaw_deg=4.0, arm_m=1.0, scale=0.02, delay_s=0.2)
    found = mounting_of(audit)
    kinds = {one.kind for one in audit.findings if one.severity != "note"}
    assert {"misalignment", "lever_arm", "velocity_scale"} <= kinds <= {
        "misalignment", "lever_arm", "velocity_scale", "clock_offset"
    }  # fmt: skip
    yaw, scale = np.rad2deg(found.values["misalignment"][2]), found.values["velocity_scale"][0]
    assert abs(yaw - 4.0) < 4.0 * np.rad2deg(found.sds["misalignment"][2]) < 0.5
    assert abs(scale - 0.02) < 4.0 * found.sds["velocity_scale"][0] < 0.005
    assert abs(found.values["lever_arm"][0] - 1.0) < 4.0 * found.sds["lever_arm"][0] < 0.3
    assert (
        not np.isfinite(found.sds["clock_offset"][0])
        or abs(found.values["clock_offset"][0] - 0.2) < 4 * found.sds["clock_offset"][0]
    )


@pytest.mark.first_cases(1)
@pytest.mark.parametrize("seed", range(50, 54))
def test_a_steady_course_with_nothing_planted(seed: int) -> None:
    assert {one.severity for one in steady(seed).findings} <= {"note"}
