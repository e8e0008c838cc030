"""Which pair of beams gives which component, method by method: errata E2 and E3, and what is said where nothing is."""

from itertools import combinations
from typing import Any

import numpy as np
import pytest

import bottomlock
from bottomlock.kernel import COMPONENT_STATUS, STATUS, FixMethod
from tests.oracle import beams as oracle

JANUS = bottomlock.BeamGeometry.janus(oracle.TILT_RAD)
VELOCITY = np.array([2.0, 0.15, -0.1])
PAIRS = list(combinations((1, 2, 3, 4), 2))
AXIS_OF_PAIR = {(1, 2): 0, (3, 4): 0, (1, 4): 1, (2, 3): 1, (1, 3): 2, (2, 4): 2}


def solve(beams: tuple[int, ...], method: FixMethod, **more: Any) -> bottomlock.VelocityFixes:  # noqa: ANN401
    """One noise-free ping with only `beams` left; lost beams read NaN."""
    valid = np.array([[beam in beams for beam in (1, 2, 3, 4)]])
    y = np.where(valid, oracle.x_janus() @ VELOCITY, np.nan)
    return bottomlock.solve_velocity(JANUS, y, valid, method=method, beam_sd_mps=0.042, **more)


def prior(sd_mps: float = 0.1) -> dict[str, Any]:
    """A prior that knows the velocity exactly but does not say so."""
    return {"prior_velocity_p_mps": VELOCITY[None], "prior_cov_m2ps2": np.eye(3)[None] * sd_mps**2}


@pytest.mark.parametrize("pair", PAIRS)
def test_partial_loose_gives_the_axis_in_the_row_space(pair: tuple[int, int]) -> None:
    """Erratum E3: surge for (1,2) and (3,4), sway for (1,4) and (2,3), heave for the opposite pairs."""
    fix = solve(pair, "plcf")
    axis = AXIS_OF_PAIR[pair]
    solved = [COMPONENT_STATUS[code] == "solved" for code in fix.component[0]]
    assert solved == [k == axis for k in range(3)]
    assert fix.velocity_p_mps[0, axis] == pytest.approx(VELOCITY[axis], abs=1e-14)
    rows = oracle.x_janus()[[pair[0] - 1, pair[1] - 1]]
    inverse = np.linalg.pinv(rows)
    assert fix.cov_m2ps2[0, axis, axis] == pytest.approx(
        (inverse @ inverse.T)[axis, axis] * 0.042**2, rel=1e-12
    )
    assert STATUS[fix.status[0]] == "partial"
    assert fix.rank[0] == 2


UNSOLVED: list[tuple[tuple[int, ...], str, dict[str, Any], str, str]] = [
    # Erratum E2: both beams share b_x and b_z, so A₀ of Eq. 31 has rank 1 and a zero sway says nothing new.
    ((1, 4), "nsv", {}, "unobservable", "constraint_singular"),
    ((2, 3), "nsv", {}, "unobservable", "constraint_singular"),
    # LC needs three independent beams.
    *((pair, "lc", {}, "unobservable", "outside_row_space") for pair in PAIRS),
    # VB and VHV live on the prior.
    *(((1, 2), method, {}, "prior_required", "prior_required") for method in ("vb", "vhv")),
    # No bottom in range is daily life at sea.
    *(((), method, prior(), "too_few_beams", "no_beams") for method in sorted(bottomlock.FIX_METHODS)),
]


@pytest.mark.parametrize(("beams", "method", "given", "status", "reason"), UNSOLVED)
def test_what_cannot_be_solved_is_a_status_with_its_reason(
    beams: tuple[int, ...], method: FixMethod, given: dict[str, Any], status: str, reason: str
) -> None:
    """A row of its own for each component, not an error and not a number."""
    fix = solve(beams, method, **given)
    assert STATUS[fix.status[0]] == status
    assert [COMPONENT_STATUS[code] for code in fix.component[0]] == [reason] * 3
    assert np.isnan(fix.velocity_p_mps).all()
    assert np.isnan(fix.cov_m2ps2).all()
    assert beams or (fix.rank[0] == 0 and not fix.beams_used.any())


@pytest.mark.parametrize("method", sorted(bottomlock.FIX_METHODS))
def test_three_beams_are_plain_least_squares_for_every_method(method: FixMethod) -> None:
    """With a full rank there is nothing to make up: all methods give the same velocity and covariance."""
    fix, plain = solve((1, 2, 4), method, **prior()), solve((1, 2, 4), "lc")
    np.testing.assert_allclose(fix.velocity_p_mps, plain.velocity_p_mps, atol=1e-12)
    np.testing.assert_allclose(fix.cov_m2ps2, plain.cov_m2ps2, rtol=1e-10)
