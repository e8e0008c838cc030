"""Velocity from beams, the product against the oracle and against the symmetries that the physics has."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bottomlock
from bottomlock.kernel import FixMethod
from tests.oracle import beams as oracle
from tests.oracle.rotations import Array
from tests.property import strategies as sea

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
