"""Recorded beams of a cave survey: the product's velocity against what the instrument itself computed."""

import csv
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

import bottomlock
from tests.oracle.rotations import Array

pytestmark = pytest.mark.recordings

TILT_RAD = np.deg2rad(22.0)
# The instrument prints four decimals of every velocity: ±0.05 mm/s each on beams and answer; 0.2 mm/s holds both.
TOLERANCE_MPS = 2e-4


@lru_cache(maxsize=1)
def table(path: Path) -> dict[str, Array]:
    """The columns of the log by name, without the `field.` before them."""
    with path.open(newline="") as log:
        rows = list(csv.reader(log))
    values = np.array(rows[1:], dtype=float)
    return {name.removeprefix("field."): values[:, k] for k, name in enumerate(rows[0])}


@pytest.fixture(scope="module")
def log(recordings: Path) -> dict[str, Array]:
    path = recordings / "caves_girona_linkquest" / "dvl_linkquest.csv"
    if not path.is_file():
        pytest.skip(f"no recording {path}")
    return table(path)


def four(log: dict[str, Array], name: str) -> Array:
    return np.column_stack([log[f"{name}{k}"] for k in range(4)])


def geometry() -> bottomlock.BeamGeometry:
    """A +-Janus with beams along +x, +y, −x, −y at 22°.

    The log's vz is positive upwards and its readings are positive along (s·v_h + c·v_up), so the frame is x, y, up; the
    solver knows nothing of which way an axis points, and is given the beams in the instrument's own frame.
    """
    return bottomlock.BeamGeometry.from_angles(np.full(4, TILT_RAD), np.deg2rad([0, 90, 180, 270]))


@pytest.mark.parametrize("count", [4, 3])
def test_velocity_of_the_instrument(log: dict[str, Array], count: int) -> None:
    """Every ping with four or three good beams that the instrument solved: its velocity within 0.2 mm/s."""
    valid = four(log, "dataGood") == 1
    asked = (log["velocityInstFlag"] == 1) & (valid.sum(axis=1) == count)
    assert asked.sum() > 100
    fix = bottomlock.solve_velocity(
        geometry(), four(log, "bottomVelocityBeam")[asked], valid[asked], method="lc", beam_sd_mps=0.02
    )
    instrument = np.column_stack([log[f"velocityInst{k}"] for k in range(3)])[asked]
    assert np.all(fix.status == 0)
    assert np.abs(fix.velocity_p_mps - instrument).max() < TOLERANCE_MPS


def test_pings_with_two_beams_are_not_made_up(log: dict[str, Array]) -> None:
    """With two good beams the instrument gives nothing, and least squares says unobservable."""
    valid = four(log, "dataGood") == 1
    asked = valid.sum(axis=1) < 3
    if not asked.any():
        pytest.skip("this part of the recording has no ping of two beams")
    fix = bottomlock.solve_velocity(
        geometry(), four(log, "bottomVelocityBeam")[asked], valid[asked], method="lc", beam_sd_mps=0.02
    )
    assert np.all(fix.status == 2)
    assert np.all(log["velocityInstFlag"][asked] == 0)
