"""Beams taken away, noise put on: masks by hand, chains by their statistics, closure by its theorem."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bottomlock.config.scenario_sections import ImuErrors
from bottomlock.errors import DataError
from bottomlock.kernel import BeamGeometry
from bottomlock.recordings.closure import closure_residuals, closure_rows
from bottomlock.recordings.streams import Inertial
from bottomlock.replay import random_errors
from bottomlock.replay.dvl_sections import BeamRecording, WhatIf
from bottomlock.replay.what_if import beams_returned

S = 1_000_000_000
TIMES = np.arange(100, dtype=np.int64) * S + 5 * S


def mask(
    asked: WhatIf, *, run: int = 0, seed: int = 1, times: np.ndarray = TIMES, name: str = "case"
) -> np.ndarray:
    return beams_returned(asked, times, 4, start_ns=5 * S, name=name, seed=seed, run=run)


def test_masks_and_outages_by_hand() -> None:
    """Beam 3 never; beams 1 and 2 not from 10 s (included) to 20 s (excluded) after the start."""
    asked = WhatIf.model_validate(
        {"name": "a", "beams_lost": [3], "outages": [{"beams": [1, 2], "from_s": 10.0, "to_s": 20.0}]}
    )
    valid = mask(asked)
    expected = np.ones((100, 4), dtype=bool)
    expected[:, 2] = False
    expected[10:20, :2] = False
    assert np.array_equal(valid, expected)


def test_pattern_of_another_recording(tmp_path: Path) -> None:
    """Its latest ping counts, from the asked second on, and it is repeated end to end."""
    path = tmp_path / "other.csv"
    flags = [[1, 1, 1, 1], [0, 1, 1, 1], [1, 0, 1, 1], [1, 1, 0, 1]]
    columns = {"time_ns": [0, S, 2 * S, 3 * S]} | {f"beam{k + 1}_mps": [0.1] * 4 for k in range(4)}
    columns |= {f"beam{k + 1}_valid": [row[k] for row in flags] for k in range(4)}
    pl.DataFrame(columns).write_csv(path)
    valid = mask(WhatIf(name="a", validity_of=BeamRecording(file=path), validity_from_s=1.0))
    assert valid[:6].astype(int).tolist() == [flags[1], flags[2], flags[3]] * 2
    with pytest.raises(DataError, match="ends before validity_from_s"):
        mask(WhatIf(name="a", validity_of=BeamRecording(file=path), validity_from_s=3.5))


def test_chain_is_up_and_down_as_long_as_asked() -> None:
    """40,000 pings: 30 % down, in stretches of 6 s on average (the exponential, seen once a second)."""
    times = np.arange(40_000, dtype=np.int64) * S + 5 * S
    asked = WhatIf.model_validate(
        {"name": "c", "dropouts": [{"beams": [2], "mean_up_s": 14.0, "mean_down_s": 6.0}]}
    )
    valid = mask(asked, times=times)
    assert valid[:, [0, 2, 3]].all()
    # Share of the time: its standard deviation is 0.0095 here (2,000 cycles); 4 of them pass 1 test in 16,000 wrongly.
    assert abs((~valid[:, 1]).mean() - 0.3) < 0.035
    assert np.array_equal(mask(asked, times=times), valid)
    assert not np.array_equal(mask(asked, times=times, run=1), valid)
    assert not np.array_equal(mask(asked, times=times, seed=2), valid)
    assert not np.array_equal(mask(asked, times=times, name="other"), valid)


def test_beam_that_does_not_exist() -> None:
    with pytest.raises(DataError, match="beam 5 does not exist, expected 1 to 4"):
        mask(WhatIf(name="a", beams_lost=(5,)))


@given(st.floats(0.1, 1.2), st.floats(-0.5, 0.5), st.lists(st.floats(-3, 3), min_size=3, max_size=3))
def test_no_velocity_closes_wrongly(tilt: float, roll: float, velocity: list[float]) -> None:
    """The closure combination is blind to every velocity, of unit length, for any tilt and mounting."""
    janus = BeamGeometry.janus(tilt, mounting_rpy_rad=[roll, 0.1, 0.3])
    (null,) = closure_rows(janus.directions_p)
    assert np.linalg.norm(null) == pytest.approx(1.0)
    assert abs(null @ janus.beam_velocities([velocity])[0]) < 1e-12


def test_closure_residuals_scatter_as_one_beam() -> None:
    """White noise of 30 mm/s on 4,000 pings of any velocity: the residuals scatter by 30 mm/s to 4 sigma."""
    rng = np.random.default_rng(11)
    janus = BeamGeometry.janus(0.4)
    beams = janus.beam_velocities(rng.uniform(-2, 2, (4000, 3))) + rng.standard_normal((4000, 4)) * 0.03
    residuals = closure_residuals(janus, beams, np.ones((4000, 4), dtype=bool))
    assert abs(residuals.std() - 0.03) < 4 * 0.03 / np.sqrt(8000)
    drawn = random_errors.resampled_beam_noise((50, 4), residuals, seed=1, key=2, run=0)
    assert set(drawn.ravel()) <= set(residuals)
    assert np.array_equal(drawn, random_errors.resampled_beam_noise((50, 4), residuals, seed=1, key=2, run=0))


def test_three_beams_have_no_closure() -> None:
    assert closure_rows(BeamGeometry.from_angles([0.4] * 3, [0.0, 2.0, 4.0]).directions_p).shape == (
        0,
        3,
    )


def test_poorer_imu_has_the_errors_of_the_table() -> None:
    """Noise over 10 ms steps: N/√dt, a bias per axis, and the same draw for the same run."""
    time_ns = np.arange(50_000, dtype=np.int64) * 10_000_000
    still = Inertial(time_ns, np.zeros((50_000, 3)), np.zeros((50_000, 3)))
    errors = ImuErrors(
        accel_bias_mg=0.5,
        gyro_bias_deg_per_h=3.0,
        accel_noise_mps_per_rt_h=0.072,
        gyro_noise_deg_per_rt_h=0.34,
    )
    shaken = random_errors.degraded_imu(still, errors, seed=3, key=4, run=0)
    for values, density in ((shaken.force_p_mps2, 0.0012), (shaken.omega_p_radps, np.deg2rad(0.34 / 60))):
        # 150,000 draws: the deviation is known to 0.2 %; 1 % is five of that.
        assert (values - values.mean(axis=0)).std() == pytest.approx(density / np.sqrt(0.01), rel=0.01)
    again = random_errors.degraded_imu(still, errors, seed=3, key=4, run=0)
    assert np.array_equal(again.force_p_mps2, shaken.force_p_mps2)
    assert not np.array_equal(
        random_errors.degraded_imu(still, errors, seed=3, key=4, run=1).force_p_mps2, shaken.force_p_mps2
    )
