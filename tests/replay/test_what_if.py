"""Beams taken away: masks by hand; closure by its theorem."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bottomlock.errors import DataError
from bottomlock.kernel import BeamGeometry
from bottomlock.recordings.closure import closure_rows
from bottomlock.replay.case import WhatIf
from bottomlock.replay.rerun import beams_returned

S = 1_000_000_000
TIMES = np.arange(100, dtype=np.int64) * S + 5 * S


def mask(asked: WhatIf) -> np.ndarray:
    return beams_returned(asked, TIMES, 4, start_ns=5 * S)


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


def test_three_beams_have_no_closure() -> None:
    assert closure_rows(BeamGeometry.from_angles([0.4] * 3, [0.0, 2.0, 4.0]).directions_p).shape == (0, 3)
