"""An estimate is checked when it is made, and says what it does not know."""

from __future__ import annotations

import numpy as np
import pytest

from bottomlock.errors import DataError
from bottomlock.kernel import BeamGeometry, FixMethod, VelocityFixes, solve_velocity
from bottomlock.ports.estimate import Estimate

JANUS = BeamGeometry.janus(np.deg2rad(20.0))
VELOCITY = np.array([2.0, 0.1, -0.2])


def fix(mask: tuple[int, ...]) -> VelocityFixes:
    beams = JANUS.beam_velocities([VELOCITY])
    return solve_velocity(JANUS, beams, [np.array(mask, dtype=bool)], method="info", beam_sd_mps=0.02)


@pytest.mark.parametrize(
    ("mask", "rank", "components"),
    [
        ((1, 1, 1, 1), 3, [True, True, True]),
        ((1, 1, 1, 0), 3, [True, True, True]),
        ((1, 0, 1, 0), 2, [False, False, True]),
        ((1, 1, 0, 0), 2, [True, False, False]),
        ((1, 0, 0, 1), 2, [False, True, False]),
        ((1, 0, 0, 0), 1, [False, False, False]),
        ((0, 0, 0, 0), 0, [False, False, False]),
    ],
)
def test_what_the_beams_determine(mask: tuple[int, ...], rank: int, components: list[bool]) -> None:
    """Docs of the x-Janus: opposite beams give heave, beams 1 and 2 surge, 1 and 4 sway; the rest is absent."""
    estimate = Estimate.from_fix(7, fix(mask))
    assert (estimate.rank, estimate.components.tolist(), estimate.complete) == (rank, components, rank == 3)
    np.testing.assert_allclose(estimate.velocity_p_mps[components], VELOCITY[components], atol=1e-12)
    axes, along, variance = estimate.observable_axes()
    assert axes.shape == (rank, 3)
    np.testing.assert_allclose(axes @ axes.T, np.eye(rank), atol=1e-12)
    np.testing.assert_allclose(along, axes @ VELOCITY, atol=1e-12)
    assert bool((variance > 0.0).all())
    assert bool((np.diff(variance) >= -1e-15).all())


@pytest.mark.parametrize("method", ["nsv", "weak_sway", "elc"])
def test_assumptions_are_no_measurement(method: FixMethod) -> None:
    beams = JANUS.beam_velocities([VELOCITY])
    mask = [np.array([True, True, False, False])]
    fixes = solve_velocity(
        JANUS,
        beams,
        mask,
        method=method,
        beam_sd_mps=0.02,
        prior_velocity_p_mps=[VELOCITY],
        prior_cov_m2ps2=[np.eye(3)],
    )
    with pytest.raises(DataError, match="solve with method 'info'"):
        Estimate.from_fix(7, fixes)
