"""Beams recovered from a Teledyne's axes, against its printed transformation, and in recordings."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from bottomlock.errors import DataError
from bottomlock.io import pd0
from bottomlock.io.beams import read_geometry
from bottomlock.io.formats import read_recording
from bottomlock.io.pd0_axes import BEAM, EARTH, INSTRUMENT, SHIP, beams_of_axes
from bottomlock.io.rows import Options
from bottomlock.kernel import solve_velocity
from tools import reader_seeds as seeds

RECOVERED = Options(beams_from_axes=True)


def printed(
    beams: NDArray[np.float64],
    frame: int,
    tilt: float,
    heading: float,
    pitch: float,
    roll: float,
    *,
    convex: bool = True,
) -> NDArray[np.float64]:
    """Beams to axes and error velocity, as the maker's booklet prints it for an instrument that looks down."""
    a, b = 1.0 / (2.0 * math.sin(tilt)), 1.0 / (4.0 * math.cos(tilt))
    c, d = (1.0 if convex else -1.0), a / math.sqrt(2.0)
    axes = np.array([[c * a, -c * a, 0, 0], [0, 0, -c * a, c * a], [b, b, b, b], [d, d, -d, -d]]) @ beams
    if frame < SHIP:
        return beams if frame == BEAM else axes
    pitch = math.atan(math.tan(pitch) * math.cos(roll))
    heading = heading if frame == EARTH else 0.0
    ch, sh, cp, sp, cr, sr = (f(x) for x in (heading, pitch, roll) for f in (math.cos, math.sin))
    turn = np.array(
        [
            [ch * cr + sh * sp * sr, sh * cp, ch * sr - sh * sp * cr],
            [-sh * cr + ch * sp * sr, ch * cp, -sh * sr - ch * sp * cr],
            [-cp * sr, sp, cp * cr],
        ]
    )
    return np.append(turn @ axes[:3], axes[3])


@pytest.mark.parametrize("frame", [BEAM, INSTRUMENT, SHIP, EARTH])
@given(
    beams=st.lists(st.floats(-3.0, 3.0), min_size=4, max_size=4),
    angles=st.tuples(st.floats(0.0, 6.2), st.floats(-1.4, 1.4), st.floats(-1.4, 1.4)),
    convex=st.booleans(),
)
def test_the_printed_transformation_is_inverted(
    frame: int, beams: list[float], angles: tuple[float, float, float], convex: bool
) -> None:
    tilt = math.radians(30.0)
    velocity = printed(np.array(beams), frame, tilt, *angles, convex=convex)
    found = beams_of_axes(
        velocity[np.newaxis],
        np.array([frame]),
        np.array([True]),
        np.array([convex]),
        tilt,
        np.array([angles]),
    )
    np.testing.assert_allclose(found[0], beams, atol=1e-12)


def test_tilts_that_the_instrument_has_not_used_are_not_used() -> None:
    angles = np.array([[0.5, 0.2, -0.1]])
    beams = np.array([0.3, -0.2, 0.1, 0.4])
    flat = printed(beams, EARTH, math.radians(20.0), 0.5, 0.0, 0.0)
    found = beams_of_axes(
        flat[np.newaxis], np.array([EARTH]), np.array([False]), np.array([True]), math.radians(20.0), angles
    )
    np.testing.assert_allclose(found[0], beams, atol=1e-12)


@pytest.mark.parametrize("frame", [INSTRUMENT, SHIP, EARTH])
def test_bottom_and_water_of_an_ensemble(frame: int) -> None:
    """To the step of the record; a solution of three beams has none; the tilts' bit of the fixed leader counts."""
    # Heading, pitch and roll of the ensembles.
    angles = (math.radians(90.0), math.radians(1.5), math.radians(-2.5))
    beams = np.array([[0.1, -0.2, 0.3, -0.4], [0.25, 0.2, -0.15, 0.1]])
    bottom, cell = (
        np.rint(printed(one, frame, math.radians(20.0), *angles) * 1e3).astype(int) for one in beams
    )
    three = (*cell[:3].tolist(), -32768)
    log = seeds.pd0_ensemble(1, frame=frame, velocity=bottom.tolist(), cells=[cell.tolist(), three])
    log += seeds.pd0_ensemble(2, frame=frame, velocity=(*bottom[:3].tolist(), -32768))
    with pytest.raises(DataError, match=r"recover the beams from solutions of four with --beams-from-axes"):
        pd0.FORMAT.read(log, "log")
    recording = pd0.FORMAT.read(log, "log", RECOVERED)
    table, water = recording.table, recording.water
    assert water is not None
    assert table.beams_valid.tolist() == [4, 0]
    np.testing.assert_allclose(table.velocity_mps[0], beams[0], atol=1.5e-3)
    np.testing.assert_allclose(water.velocity_mps[0], beams[1], atol=1.5e-3)
    assert water.valid.sum(axis=1).tolist() == [4, 0]
    assert recording.facts["coordinates"] == pd0.FRAMES[frame]
    assert recording.geometry == "teledyne_20"
    assert any("recovered" in line for line in recording.notes)


@pytest.mark.parametrize("name", ["pd0_ooi_glider/LA101636.PD0", "pd0_nortek_mhkit/winriver02_transect.PD0"])
def test_recordings_keep_their_speed(recordings: Path, name: str) -> None:
    """Least squares of the recovered beams has the speed that the instrument states."""
    path = recordings / name
    if not path.exists():
        pytest.skip("the recording is not there")
    recording = read_recording(path, options=RECOVERED)
    own = read_recording(path, options=Options(instrument_only=True)).table.instrument_mps
    instrument = read_geometry(recording.geometry)
    table = recording.table
    whole = table.valid.all(axis=1)
    assert whole.sum() > 0.6 * table.rows
    fixes = solve_velocity(
        instrument.geometry, table.velocity_mps, table.valid, method="lc", beam_sd_mps=instrument.beam_sd_mps
    )
    np.testing.assert_allclose(
        np.linalg.norm(fixes.velocity_p_mps[whole], axis=1), np.linalg.norm(own[whole], axis=1), atol=1e-9
    )
    assert recording.water is not None
