"""One dive of `tests/dive.py` by every door: its readings and its bags hold what was drawn."""

from pathlib import Path

import numpy as np
import pytest

from bottomlock import Navigator
from bottomlock.io.formats import read_recording
from tests.dive import EPOCH_S, LATITUDE_DEG, Dive, drawn_dive, given, tables
from tests.dive_logs import write


@pytest.fixture(scope="module")
def dive() -> Dive:
    return drawn_dive(3, seconds=60.0)


def test_readings_navigate_to_the_truth(dive: Dive) -> None:
    """Within three sigmas of where the dive ends; its noise per root hour is that of its readings at 50 Hz."""
    nav = Navigator.start(
        dvl={"geometry": dive.geometry, "beam_noise_mps": dive.beam_sd},
        imu={
            "accel_bias_mg": 1.0, "gyro_bias_deg_per_h": 20.0, "accel_noise_mps_per_rt_h": 0.085,
            "gyro_noise_deg_per_rt_h": 0.25,
        },
        latitude_deg=LATITUDE_DEG,
        heading_deg=float(np.rad2deg(dive.rpy[0, 2])),
        heading_sd_deg=1.0,
        depth={"sd_m": 0.03},
    )  # fmt: skip
    for reading in given(dive):
        nav.push(reading)
    assert (np.abs(nav.position_t_m - dive.position[-1]) < 3.0 * nav.position_sd_m).all()
    assert (np.abs(nav.velocity_p_mps - dive.velocity[-1]) < 3.0 * nav.velocity_sd_mps).all()
    assert np.linalg.norm(dive.position[-1, :2]) > 10.0


@pytest.mark.parametrize("word", ["bag", "driver_bag"])
def test_a_bag_holds_the_beams(word: str, tmp_path: Path) -> None:
    """Every ping, each beam to a micrometre a second, lost ones as lost."""
    dive = drawn_dive(3, seconds=30.0)
    (path,) = write(tables(dive), tmp_path, word)
    table = read_recording(path).table
    lost = np.isnan(dive.beams)
    np.testing.assert_array_equal(table.valid, ~lost)
    off = np.where(lost, 0.0, table.velocity_mps - dive.beams)
    assert np.abs(off).max() < 1e-6
    np.testing.assert_allclose(table.time_ns * 1e-9 - EPOCH_S, dive.ping_s, rtol=0, atol=0.011)
