"""A mounting and a lever arm that the geometry states are no findings; others than stated are."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bottomlock import BeamGeometry
from bottomlock.audit.run import Audit
from tests.audit.worlds import Array, World, simulated

TILT, ARM = np.deg2rad(22.5), np.array([-1.2, 0.4, 0.1])
RPY = np.deg2rad([1.0, -2.0, 10.0])


def turned() -> World:
    """A dive with an instrument that sits 10° to starboard, tilted, and 1.2 m aft; its velocity in its own axes."""
    world = simulated(3, pings=1200)
    log, reference = world.log, world.reference
    assert reference is not None
    assert log.instrument_mps is not None
    attitude = Rotation.from_matrix(reference.rotation)
    rate = (attitude[:-2].inv() * attitude[2:]).as_rotvec() / 0.2
    at = np.stack([np.interp(log.time_ns, reference.time_ns[1:-1], c) for c in rate.T], axis=1)
    mounted = Rotation.from_euler("ZYX", RPY[::-1])
    own = mounted.inv().apply(log.instrument_mps + np.cross(at, ARM))
    own = np.where(log.solved[:, None], own, 0.0)
    rows = np.asarray(world.geometry.directions_p) if world.geometry is not None else np.zeros((4, 3))
    closing = log.velocity_mps - log.velocity_mps @ np.linalg.pinv(rows).T @ rows.T
    y = np.where(log.valid, own @ rows.T + closing, 0.0)
    return World(
        "turned", type(log)("turned", log.time_ns, y, log.valid, own, log.solved), None, RPY, reference
    )


def audited(world: World, rpy_rad: Array, arm_m: Array) -> Audit:
    stated = BeamGeometry.from_angles(
        [TILT] * 4,
        np.deg2rad([135.0, -135.0, -45.0, 45.0]),
        lever_arms_p_m=[arm_m] * 4,
        mounting_rpy_rad=rpy_rad,
    )
    return Audit(world.log, stated=stated, mounting_rpy_rad=rpy_rad, reference=world.reference)


@pytest.fixture(scope="module")
def world() -> World:
    return turned()


def test_what_is_stated_is_not_found(world: World) -> None:
    assert [one.kind for one in audited(world, RPY, ARM).findings if one.severity != "note"] == []


def test_what_is_not_stated_is_found(world: World) -> None:
    found = {one.kind: one for one in audited(world, np.zeros(3), np.zeros(3)).findings}
    assert {"misalignment", "lever_arm"} <= set(found)
    assert found["lever_arm"].size == pytest.approx(np.linalg.norm(ARM), rel=0.15)
    turn = np.rad2deg(Rotation.from_euler("ZYX", RPY[::-1]).magnitude())
    assert found["misalignment"].size == pytest.approx(turn, rel=0.1)


def test_what_is_stated_otherwise_is_compared(world: World) -> None:
    """Stated 4° of yaw, mounted 10°: 6° off, and the lever arm as stated."""
    rpy = RPY.copy()
    rpy[2] = np.deg2rad(4.0)
    found = {one.kind: one for one in audited(world, rpy, ARM).findings}
    assert found["misalignment"].size == pytest.approx(6.0, abs=0.3)
    assert "stated is 1.00, -2.00, 4.00" in found["misalignment"].text
    assert "lever_arm" not in found


def test_velocity_that_the_instrument_has_rotated(world: World) -> None:
    """In the platform's axes already: the array is not accused of being turned."""
    own = world.log.instrument_mps
    assert own is not None
    rotated = Rotation.from_euler("ZYX", RPY[::-1]).apply(own)
    log = replace(world.log, instrument_mps=rotated)
    found = {one.kind for one in audited(world.with_log(log), RPY, ARM).findings if one.severity != "note"}
    assert found == set()
