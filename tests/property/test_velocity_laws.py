"""Velocity from beams, the product against the oracle and against the symmetries that the physics has."""

from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import bottomlock
from bottomlock.kernel import FixMethod
from tests.oracle import beams as oracle
from tests.oracle.rotations import Array, matrix_from_euler
from tests.property import strategies as sea

METHODS = [
    "least_squares",
    "virtual_beam",
    "nullified_sway",
    "partial_loose",
    "virtual_heave",
    "selector",
    "information",
    "weak_sway",
]
NOISES = sea.numbers(-0.3, 0.3, 5)


def solved(of: sea.Instrument, y: Array, valid: Array, method: Any, **more: Any) -> bottomlock.VelocityFixes:  # noqa: ANN401
    """One ping."""
    geometry = more.pop("geometry", of.geometry)
    return bottomlock.solve_velocity(geometry, y[None], valid[None], method=method, beam_sd_mps=of.sd, **more)


def readings(instrument: sea.Instrument, velocity: Array, noise: Array) -> Array:
    """Noisy readings of a vehicle that does not turn."""
    return instrument.directions @ velocity + noise[: instrument.beams]


@given(sea.instruments(), sea.velocities, sea.rates, NOISES, st.data())
def test_least_squares_is_equations_17_and_19(
    instrument: sea.Instrument, velocity: Array, rate: Array, noise: Array, data: st.DataObject
) -> None:
    """Any three beams or more, weighted, with lever arms taken off: value and covariance of the normal equations."""
    valid = data.draw(sea.masks(instrument.beams, 3))
    spin = np.array(
        [b @ np.cross(rate, lever) for b, lever in zip(instrument.directions, instrument.levers, strict=True)]
    )
    y = readings(instrument, velocity, noise)
    fix = solved(instrument, y + spin, valid, "least_squares", omega_tp_p_radps=rate[None])
    A, R = instrument.directions[valid], np.diag(instrument.sd[valid] ** 2)
    cov = oracle.velocity_covariance(A, R)
    # The oracle inverts AᵀWA, so its own rounding grows with the condition number (up to 1e4 here).
    np.testing.assert_allclose(fix.velocity_p_mps[0], oracle.velocity_weighted(A, y[valid], R), atol=1e-9)
    np.testing.assert_allclose(fix.cov_m2ps2[0], cov, atol=1e-10 * np.abs(cov).max())
    assert fix.status[0] == 0
    assert fix.rank[0] == 3
    assert fix.component[0].tolist() == [0, 0, 0]


@given(instrument=sea.instruments(), velocity=sea.velocities, data=st.data())
@pytest.mark.parametrize("method", ["partial_loose", "information"])
def test_perfect_beams_give_the_observed_part_back(
    method: FixMethod, instrument: sea.Instrument, velocity: Array, data: st.DataObject
) -> None:
    """Whatever is lost, what is reported of a noise-free velocity is that velocity: nothing is made up."""
    valid = data.draw(sea.masks(instrument.beams, 1))
    y = instrument.directions @ velocity
    fix = solved(instrument, y, valid, method)
    found = fix.component[0] == 0
    np.testing.assert_allclose(fix.velocity_p_mps[0][found], velocity[found], atol=1e-9)
    assert np.isnan(fix.velocity_p_mps[0][~found]).all()
    rows = instrument.directions[valid]
    inside = np.linalg.pinv(rows) @ rows
    np.testing.assert_allclose(inside @ fix.observed_velocity_p_mps[0], inside @ velocity, atol=1e-9)


@given(instrument=sea.instruments(), noise=NOISES, data=st.data())
def test_information_is_that_of_the_rows(
    instrument: sea.Instrument, noise: Array, data: st.DataObject
) -> None:
    """The rank-deficient information is AᵀR⁻¹A of the valid beams, for any mask; weak sway adds e_y e_yᵀ/ε."""
    valid = data.draw(sea.masks(instrument.beams, 1))
    A, W = instrument.directions[valid], np.diag(instrument.sd[valid] ** -2.0)
    expected = A.T @ W @ A
    y = readings(instrument, np.array([2.0, 0.1, 0.0]), noise)
    fix = solved(instrument, y, valid, "information")
    scale = np.abs(expected).max()
    np.testing.assert_allclose(fix.information_s2pm2[0], expected, atol=1e-10 * scale)
    if valid.sum() < 3:
        weak = solved(instrument, y, valid, "weak_sway", weak_sway_var_m2ps2=2.0)
        with_row = expected + np.diag([0.0, 0.5, 0.0])
        # It is reached through its inverse, the covariance: rounding grows with the condition of the rows, which are
        # nearly coplanar for pairs close to lateral (seen: 1.7e-7 of the largest entry, 0.02° from a lateral pair).
        observed = np.sort(np.linalg.eigvalsh(with_row))[::-1][: int(weak.rank[0])]
        condition = observed[0] / observed[-1]
        rounding = (1e-12 + 4 * np.finfo(float).eps * condition) * scale
        np.testing.assert_allclose(weak.information_s2pm2[0], with_row, atol=rounding)


def inputs(
    instrument: sea.Instrument, velocity: Array, cov: Array, noise: Array
) -> tuple[Array, dict[str, Any]]:
    """Readings and a prior that does not agree with them."""
    prior = velocity + np.array([0.1, -0.2, 0.05])
    return readings(instrument, velocity, noise), {
        "prior_velocity_p_mps": prior[None],
        "prior_cov_m2ps2": cov[None],
    }


@pytest.mark.first_cases(2)
@given(
    instrument=sea.instruments(), velocity=sea.velocities, cov=sea.covariances(), noise=NOISES, data=st.data()
)
@pytest.mark.parametrize("method", METHODS)
def test_renumbering_beams_changes_nothing(
    method: FixMethod, instrument: sea.Instrument, velocity: Array, cov: Array, noise: Array, data: st.DataObject
) -> None:  # fmt: skip
    """Beam numbers are names.

    A virtual beam must be chosen among the missing: equal candidates are told apart by number, so VB and the selector
    are asked only where one candidate stands out (a random instrument nearly always has one).
    """
    valid = data.draw(sea.masks(instrument.beams, 1))
    order = np.array(data.draw(st.permutations(range(instrument.beams))))
    if method in {"virtual_beam", "selector"}:
        assume(candidates_stand_out(instrument.directions, valid))
    y, prior = inputs(instrument, velocity, cov, noise)
    plain = solved(instrument, y, valid, method, **prior)
    shuffled = sea.Instrument(instrument.directions[order], instrument.levers[order], instrument.sd[order])
    other = solved(shuffled, y[order], valid[order], method, **prior)
    np.testing.assert_array_equal(plain.component, other.component)
    np.testing.assert_array_equal(plain.rank, other.rank)
    np.testing.assert_allclose(plain.velocity_p_mps, other.velocity_p_mps, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(plain.cov_m2ps2, other.cov_m2ps2, rtol=1e-8, atol=1e-10)


def candidates_stand_out(directions: Array, valid: Array) -> bool:
    """True where each choice of a missing beam by its reach into the unseen axes is clear by 1 %."""
    rows = [directions[i] for i in np.flatnonzero(valid)]
    missing = [directions[i] for i in np.flatnonzero(~valid)]
    while missing and np.linalg.matrix_rank(np.array(rows)) < 3:
        A = np.array(rows)
        unseen = np.eye(3) - np.linalg.pinv(A) @ A
        reach = np.array([np.linalg.norm(unseen @ b) for b in missing])
        ranked = np.sort(reach)
        if len(ranked) > 1 and ranked[-1] - ranked[-2] < 0.01 * ranked[-1]:
            return False
        rows.append(missing.pop(int(np.argmax(reach))))
    return True


@given(
    instrument=sea.instruments(), velocity=sea.velocities, cov=sea.covariances(), noise=NOISES, angles=sea.angles,
    data=st.data(),
)  # fmt: skip
@pytest.mark.parametrize("method", ["least_squares", "virtual_beam", "information"])
def test_rotating_mounting_and_velocity_together(
    method: FixMethod, instrument: sea.Instrument, velocity: Array, cov: Array, noise: Array,
    angles: tuple[float, float, float], data: st.DataObject,
) -> None:  # fmt: skip
    """Where no platform axis is singled out, turning instrument, prior and vehicle turns the answer and no more."""
    valid = data.draw(sea.masks(instrument.beams, 1))
    if method == "virtual_beam":
        assume(candidates_stand_out(instrument.directions, valid))
    y, prior = inputs(instrument, velocity, cov, noise)
    turn = matrix_from_euler(*angles)
    turned_cov = turn @ cov @ turn.T
    turned_prior: dict[str, Any] = {
        "prior_velocity_p_mps": prior["prior_velocity_p_mps"] @ turn.T,
        "prior_cov_m2ps2": ((turned_cov + turned_cov.T) / 2)[None],
    }
    mounted = bottomlock.BeamGeometry(instrument.directions, mounting_rpy_rad=np.array(angles))
    plain = solved(instrument, y, valid, method, **prior)
    other = solved(instrument, y, valid, method, geometry=mounted, **turned_prior)
    assert plain.rank[0] == other.rank[0]
    seen, seen_turned = plain.observed_velocity_p_mps[0], other.observed_velocity_p_mps[0]
    np.testing.assert_allclose(turn @ seen, seen_turned, rtol=1e-8, atol=1e-8)
    information = plain.information_s2pm2[0]
    np.testing.assert_allclose(
        turn @ information @ turn.T,
        other.information_s2pm2[0],
        atol=1e-8 * max(1.0, np.abs(information).max()),
    )
    if plain.status[0] == 0 and other.status[0] == 0:
        np.testing.assert_allclose(
            turn @ plain.cov_m2ps2[0] @ turn.T, other.cov_m2ps2[0], rtol=1e-7, atol=1e-9
        )
