"""The pieces of an audit against answers worked by hand, by minors, and against laws that hold for any instrument."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bottomlock.audit.closure import closure_of, closure_slope, null_space
from bottomlock.audit.matrix import READINGS_TO_VELOCITY, find_matrix, match
from bottomlock.audit.robust import LEAST_BLOCKS, fit_linear, sigmas_for
from bottomlock.recordings.closure import orders_by_closure
from bottomlock.recordings.robust import BLOCKS, blocks_of, correlation_rows
from tests.audit.synthetic import janus, motion
from tests.oracle import closure as oracle


def beams(seed: int) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Four beams of tilts from 10° to 35° at azimuths about a quarter turn apart."""
    rng = np.random.default_rng(seed)
    tilt, turn = rng.uniform(0.17, 0.6, 4), np.arange(4) * np.pi / 2 + rng.uniform(-0.3, 0.3, 4)
    return np.stack([np.cos(turn) * np.sin(tilt), np.sin(turn) * np.sin(tilt), np.cos(tilt)], axis=1)


@given(st.integers(0, 10_000))
def test_null_space_is_that_of_the_minors(seed: int) -> None:
    rows = beams(seed)
    np.testing.assert_allclose(null_space(rows)[:, 0], oracle.combination(rows), atol=1e-9)


@given(st.integers(0, 10_000))
def test_matrix_is_found_whatever_the_noise_of_the_beams(seed: int) -> None:
    """As v = A⁺ y holds exactly, A is found exactly: noise is in the readings and in the velocity alike."""
    rng = np.random.default_rng(seed)
    rows = beams(seed)
    y = oracle.readings(rows, rng.normal(size=(120, 3))) + rng.normal(size=(120, 4)) * rng.uniform(
        0.01, 0.5, 4
    )
    own = y @ (np.linalg.inv(rows.T @ rows) @ rows.T).T
    found = find_matrix(y, own)
    assert found is not None
    assert found.regression == READINGS_TO_VELOCITY
    np.testing.assert_allclose(found.rows, rows, atol=1e-9)


def test_closure_statistics_by_hand() -> None:
    """Readings that close to 1, −1, 1, −1 and once to 20."""
    values = np.array([1.0, -1.0] * 10 + [20.0])
    y = np.zeros((21, 4))
    y[:, 0] = values
    one = closure_of(np.array([1.0, -1.0, 1.0, -1.0]), y)
    assert one.median_abs_mps == 1.0
    assert one.max_mps == 20.0
    assert one.median_mps == 1.0
    assert one.beyond_3_sigma == pytest.approx(1.0 / 21.0)
    assert one.beam_sigma_mps == pytest.approx(one.sigma_mps / 2.0)


def test_slope_needs_instruments() -> None:
    """One noisy beam makes the closure move with the velocity of its ping; neighbours do not share its noise."""
    rng = np.random.default_rng(0)
    rows = janus()
    y = motion(rng, 4000) @ rows.T + rng.normal(size=(4000, 4)) * [0.3, 0.03, 0.03, 0.03]
    n = null_space(rows)[:, 0]
    v = y @ np.linalg.pinv(rows).T
    plain = fit_linear(np.hstack([v, np.ones((4000, 1))]), y @ n)
    assert np.abs(plain.parameters[:3] / np.std(plain.resampled[:, :3], axis=0)).max() > 8.0
    slope = closure_slope(y @ n, v, np.arange(4000))
    assert slope is not None
    assert slope.p_value > 0.001


def test_simplest_order_comes_first() -> None:
    """A flip of beam 2 has the closure of many a longer tale; the one step is named before them."""
    rng = np.random.default_rng(1)
    y = motion(rng, 500) @ janus().T * [1, -1, 1, 1]
    best = orders_by_closure(y, janus())[0]
    assert (best.beam, best.sign, best.steps) == ((0, 1, 2, 3), (1, -1, 1, 1), 1)


@given(st.permutations(range(4)), st.lists(st.sampled_from([-1, 1]), min_size=4, max_size=4))
def test_match_gives_back_order_and_signs(order: list[int], sign: list[int]) -> None:
    stated = janus()
    found = match(np.array(sign)[:, None] * stated[order], stated)
    assert found.beam.tolist() == list(order)
    assert found.sign.tolist() == sign
    assert found.off_rad.max() < 1e-6


def test_standard_deviations_of_correlated_noise() -> None:
    """Noise that lasts ten pings: a plain standard deviation is three times too small, the blocks' is not."""
    rng = np.random.default_rng(5)
    errors, said = [], []
    for _ in range(200):
        lasting = np.repeat(rng.normal(size=150), 10)
        x = np.sin(np.arange(1500) / 40.0)
        fit = fit_linear(np.stack([x, np.ones(1500)], axis=1), lasting)
        errors.append(float(fit.parameters[0]))
        said.append(float(np.std(fit.resampled[:, 0])))
    # 200 logs: the ratio of two spreads has a standard deviation of 5 %.
    assert 0.8 < np.mean(said) / np.std(errors) < 1.2


def test_few_blocks_claim_nothing() -> None:
    """Blocks hold two correlation times; from fewer than eight of them nothing is significant."""
    noise = np.repeat(np.random.default_rng(2).normal(size=400), 20)
    lasting = correlation_rows(noise)
    assert lasting == pytest.approx(20.0, rel=0.4)
    blocks = int(blocks_of(len(noise), lasting)[-1]) + 1
    assert blocks == BLOCKS
    assert int(blocks_of(200, lasting)[-1]) + 1 < LEAST_BLOCKS
    assert sigmas_for(LEAST_BLOCKS - 1) == np.inf
    assert sigmas_for(10_000) == pytest.approx(4.417 / np.sqrt(0.75), abs=0.01)
