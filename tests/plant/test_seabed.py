"""Ray meets seabed: by hand on planes, by planes on grids; range, incidence and what lies beyond."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bottomlock.errors import ScenarioError
from bottomlock.plant.maths import FloatArray
from bottomlock.plant.seabed import GridSeabed, PlaneSeabed, footprints, load_grid, rolling_seabed

TILT = math.radians(20.0)


def _janus() -> FloatArray:
    azimuth = np.deg2rad([45.0, 135.0, 225.0, 315.0])
    return np.stack(
        [np.cos(azimuth) * np.sin(TILT), np.sin(azimuth) * np.sin(TILT), np.full(4, np.cos(TILT))], axis=1
    )


LEVEL = np.array([[1.0, 0.0, 0.0, 0.0]])


def test_flat_bottom_from_level_flight() -> None:
    prints = footprints(PlaneSeabed(50.0), np.array([[0.0, 0.0, 20.0]]), LEVEL, _janus())
    assert prints.range_m == pytest.approx(30.0 / math.cos(TILT))
    assert prints.incidence_rad == pytest.approx(TILT)


def test_roll_brings_one_side_nearer_the_vertical() -> None:
    """Rolled 20 deg to starboard: ranges and incidence by hand, beam by beam."""
    half = 0.5 * TILT
    rolled = np.array([[math.cos(half), math.sin(half), 0.0, 0.0]])
    prints = footprints(PlaneSeabed(50.0), np.array([[0.0, 0.0, 20.0]]), rolled, _janus())
    b = _janus()
    down = b[:, 1] * math.sin(TILT) + b[:, 2] * math.cos(TILT)
    assert prints.range_m[0] == pytest.approx(30.0 / down)
    assert np.cos(prints.incidence_rad[0]) == pytest.approx(down)


def test_lever_arms_shift_the_origin() -> None:
    arms = np.tile([0.5, 0.0, 0.1], (4, 1))
    prints = footprints(
        PlaneSeabed(50.0, slope_north=0.1), np.array([[0.0, 0.0, 20.0]]), LEVEL, _janus(), arms
    )
    b = _janus()
    by_hand = (50.0 + 0.1 * 0.5 - 20.1) / (b[:, 2] - 0.1 * b[:, 0])
    assert prints.range_m[0] == pytest.approx(by_hand)


@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(-20.0, 20.0), st.floats(-20.0, 20.0))
def test_a_gridded_plane_is_the_plane(slope_n: float, slope_e: float, north: float, east: float) -> None:
    plane = PlaneSeabed(60.0, slope_n, slope_e)
    axis = np.linspace(-200.0, 200.0, 41)
    grid = GridSeabed(axis, axis, 60.0 + slope_n * axis[:, None] + slope_e * axis[None, :])
    place = np.array([[north, east, 20.0]])
    by_plane, by_grid = (footprints(bed, place, LEVEL, _janus()) for bed in (plane, grid))
    assert np.allclose(by_grid.range_m, by_plane.range_m, atol=1e-6)
    assert np.allclose(by_grid.incidence_rad, by_plane.incidence_rad, atol=1e-6)


def test_hits_on_a_rolling_bottom_lie_on_it() -> None:
    bed = rolling_seabed(depth_m=60.0, relief_m=5.0, wavelength_m=80.0, half_width_m=200.0)
    places = np.column_stack([np.linspace(-100, 100, 21), np.linspace(50, -50, 21), np.full(21, 20.0)])
    attitude = np.tile(LEVEL, (21, 1))
    prints = footprints(bed, places, attitude, _janus())
    spots = places[:, None, :] + prints.range_m[..., None] * _janus()
    depth, _, _ = bed.depth_at(spots[..., 0], spots[..., 1])
    assert np.allclose(depth, spots[..., 2], atol=1e-6)
    assert np.ptp(prints.range_m) > 3.0


def test_rays_that_miss_have_no_range() -> None:
    """Beyond the grid, above the horizon or below the bottom there is nothing to hit."""
    upside_down = np.array([[0.0, 1.0, 0.0, 0.0]])
    bed = PlaneSeabed(50.0)
    assert np.isnan(footprints(bed, np.array([[0.0, 0.0, 20.0]]), upside_down, _janus()).range_m).all()
    assert np.isnan(footprints(bed, np.array([[0.0, 0.0, 70.0]]), LEVEL, _janus()).range_m).all()
    grid = rolling_seabed(depth_m=60.0, relief_m=5.0, wavelength_m=80.0, half_width_m=50.0)
    assert np.isnan(footprints(grid, np.array([[500.0, 0.0, 20.0]]), LEVEL, _janus()).range_m).all()


def test_a_users_grid_file(tmp_path: Path) -> None:
    (tmp_path / "bay.toml").write_text(
        "north_m = [0.0, 10.0]\neast_m = [0.0, 10.0, 20.0]\ndepth_m = [[50.0, 50.0, 50.0], [51.0, 51.0, 51.0]]\n"
    )
    bed = load_grid(tmp_path / "bay.toml")
    assert float(bed.depth_at(np.array(5.0), np.array(15.0))[0]) == pytest.approx(50.5)
    np.savez(tmp_path / "bay.npz", north_m=bed.north_m, east_m=bed.east_m, depth_m=bed.depth_m)
    assert (load_grid(tmp_path / "bay.npz").depth_m == bed.depth_m).all()


SQUARE = ["[0.0, 1.0]", "[0.0, 1.0]", "[[1.0, 1.0], [1.0, 1.0]]"]


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (SQUARE[:1], "'east_m' is missing"),
        (["1 2"], "not valid TOML"),
        (["[1.0, 0.0]", *SQUARE[1:]], "north_m must hold"),
        ([*SQUARE[:2], "[[1.0, 1.0]]"], r"shape \(1, 2\), expected \(2, 2\)"),
        ([*SQUARE[:2], "[[1.0, 1.0], [1.0, nan]]"], "row 2, column 2"),
        (["[0.0, 1.0, 3.0]", SQUARE[1], "[[1.0, 1.0]]"], "evenly spaced"),
    ],
)
def test_bad_grids_are_named(tmp_path: Path, values: list[str], words: str) -> None:
    names = ("north_m", "east_m", "depth_m")
    text = "".join(f"{name} = {value}\n" for name, value in zip(names, values, strict=False))
    (tmp_path / "bad.toml").write_text(text)
    with pytest.raises(ScenarioError, match=words):
        load_grid(tmp_path / "bad.toml")


def test_a_plane_above_the_vehicle_is_refused() -> None:
    with pytest.raises(ScenarioError, match="positive depth"):
        PlaneSeabed(-5.0)
