"""An estimate is checked when it is made, and says what it does not know."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bottomlock.errors import DataError
from bottomlock.kernel import (
    BeamGeometry,
    FixMethod,
    VelocityFixes,
    solve_velocity,
)
from bottomlock.ports import estimate as estimate_module
from bottomlock.ports.estimate import Estimate

JANUS = BeamGeometry.janus(np.deg2rad(20.0))
VELOCITY = np.array([2.0, 0.1, -0.2])


def fix(mask: tuple[int, ...]) -> VelocityFixes:
    beams = JANUS.beam_velocities([VELOCITY])
    return solve_velocity(JANUS, beams, [np.array(mask, dtype=bool)], method="info", beam_sd_mps=0.02)


def navigation(**changes: object) -> Estimate:
    joint = np.diag([1.0, 1.0, 1.0, 1e-6, 1e-6, 1e-4, 1e-4, 4e-4, 1e-4])
    settings: dict[str, Any] = {
        "time_ns": 1_000_000_000,
        "mode": "navigation",
        "velocity_p_mps": VELOCITY,
        "covariance_m2ps2": joint[6:, 6:],
        "rank": 3,
        "attitude_t_p": [1.0, 0.0, 0.0, 0.0],
        "position_t_m": [1.0, 2.0, 3.0],
        "navigation_covariance": joint,
    }
    return Estimate(**(settings | changes))


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


def test_one_beam_is_known_along_itself() -> None:
    """A single beam of σ 0.02 m/s: one axis, the beam's own, of that variance."""
    axes, along, variance = Estimate.from_fix(7, fix((1, 0, 0, 0))).observable_axes()
    beam = JANUS.directions_p[0]
    assert abs(float(axes[0] @ beam)) == pytest.approx(1.0, abs=1e-12)
    assert abs(float(along[0])) == pytest.approx(abs(float(beam @ VELOCITY)), abs=1e-12)
    assert float(variance[0]) == pytest.approx(0.02**2, rel=1e-12)


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


@pytest.mark.parametrize("size", [3, 9])
def test_the_cheap_check_of_a_covariance_is_that_of_its_eigenvalues(size: int) -> None:
    """Random matrices of every scale whose least eigenvalue is zero, or above or below the tolerance."""
    random = np.random.default_rng(31)
    for least in (1.0, 1e-3, 0.0, -1e-10, -1e-7, -1e-3):
        for _ in range(50):
            turn = np.linalg.qr(random.standard_normal((size, size)))[0]
            unit = turn * np.array([least, *(1.0 + random.random(size - 1))]) @ turn.T
            unit = 0.5 * (unit + unit.T) / np.sqrt(np.outer(unit.diagonal(), unit.diagonal()))
            scale = 10.0 ** random.uniform(-90.0, 90.0, size)
            matrix = unit * scale * scale[:, None]
            matrix = 0.5 * (matrix + matrix.T)
            if float(np.linalg.eigvalsh(unit)[0]) < -1e-8:
                with pytest.raises(DataError, match="negative eigenvalue"):
                    estimate_module._check_covariance("P", matrix)
            else:
                estimate_module._check_covariance("P", matrix)
    for place in ((0, 0), (0, 1), (size - 1, size - 2)):
        for value in (np.nan, np.inf, -np.inf):
            matrix = np.eye(size)
            matrix[place] = matrix[place[::-1]] = value
            with pytest.raises(DataError, match="finite and symmetric"):
                estimate_module._check_covariance("P", matrix)
    estimate_module._check_covariance("P", np.zeros((size, size)))
    with pytest.raises(DataError, match="negative eigenvalue"):
        estimate_module._check_covariance(
            "P", np.full((size, size), 1e-190) - (1e-190 - 1e-200) * np.eye(size)
        )
