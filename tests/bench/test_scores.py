"""Scores of the benchmark: worked by hand, and proper."""

import numpy as np
import pytest
from scipy import stats

from partialdvl_bench.scores import drift_percent, energy_score, nees, negative_log_likelihood


def test_likelihood_by_hand() -> None:
    """½ (2 log 2π + log(4 · 9) + 1²/4 + 3²/9) = ½ (3.6757541 + 3.5835189 + 1.25)."""
    value = negative_log_likelihood(np.array([[1.0, 3.0]]), np.diag([4.0, 9.0])[None])
    assert value[0] == pytest.approx(0.5 * (3.6757541328 + 3.5835189385 + 1.25), abs=1e-9)


def test_likelihood_is_that_of_scipy_with_correlation() -> None:
    cov = np.array([[2.0, 0.7, 0.1], [0.7, 1.0, -0.3], [0.1, -0.3, 0.5]])
    error = np.array([[0.3, -1.0, 0.4], [0.0, 0.0, 2.0]])
    expected = -stats.multivariate_normal(np.zeros(3), cov).logpdf(error)
    assert np.allclose(negative_log_likelihood(error, np.tile(cov, (2, 1, 1))), expected, atol=1e-12)


def test_energy_score_of_one_number_is_its_crps() -> None:
    """CRPS of N(0, σ²) at e: σ (z (2Φ(z) - 1) + 2φ(z) - 1/√π), z = e/σ; to the accuracy of 256 samples."""
    error, sd = np.array([[0.0], [1.0], [5.0]]), 2.0
    z = error[:, 0] / sd
    expected = sd * (z * (2 * stats.norm.cdf(z) - 1) + 2 * stats.norm.pdf(z) - 1 / np.sqrt(np.pi))
    got = energy_score(error, np.full((3, 1, 1), sd**2))
    assert np.allclose(got, expected, atol=0.05 * sd)


def test_energy_score_does_not_depend_on_the_parts_it_is_computed_in() -> None:
    rng = np.random.default_rng(1)
    error, cov = rng.standard_normal((5000, 2)), np.tile(np.diag([1.0, 2.0]), (5000, 1, 1))
    assert np.array_equal(energy_score(error, cov)[4500:], energy_score(error[4500:], cov[4500:]))


def test_nees_by_hand() -> None:
    assert nees(np.array([[1.0, 3.0]]), np.diag([4.0, 9.0])[None])[0] == pytest.approx(1.25)


@pytest.mark.parametrize("score", [negative_log_likelihood, energy_score])
@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_over_and_underconfidence_cost(score: object, factor: float) -> None:
    """In the mean over truths drawn from the claim, half and double the standard deviation score worse."""
    assert callable(score)
    rng = np.random.default_rng(7)
    cov = np.array([[0.04, 0.01, 0.0], [0.01, 0.09, 0.02], [0.0, 0.02, 0.01]])
    error = rng.multivariate_normal(np.zeros(3), cov, 4000)
    honest = score(error, np.tile(cov, (4000, 1, 1)))
    other = score(error, np.tile(factor**2 * cov, (4000, 1, 1)))
    gain = other - honest
    assert gain.mean() > 3.0 * gain.std() / np.sqrt(4000)


@pytest.mark.parametrize("score", [negative_log_likelihood, energy_score])
def test_a_bias_costs(score: object) -> None:
    assert callable(score)
    rng = np.random.default_rng(8)
    error = rng.standard_normal((4000, 3))
    cov = np.tile(np.eye(3), (4000, 1, 1))
    gain = score(error + np.array([0.3, 0.0, 0.0]), cov) - score(error, cov)
    assert gain.mean() > 3.0 * gain.std() / np.sqrt(4000)


def test_drift_by_hand() -> None:
    """North at 2 m/s; the estimate gains 1 m east over the first 100 m, 3 m over the second; 40 m more do not count."""
    travelled = np.arange(0.0, 241.0, 2.0)
    truth = np.stack([travelled, np.zeros_like(travelled), np.zeros_like(travelled)], axis=1)
    east = np.interp(travelled, [0.0, 100.0, 200.0, 240.0], [5.0, 6.0, 9.0, 99.0])
    estimate = truth + np.stack([np.zeros_like(east), east, np.zeros_like(east)], axis=1)
    assert drift_percent(estimate, truth, 100.0) == pytest.approx([1.0, 3.0])


def test_drift_of_a_mission_shorter_than_a_segment_is_empty() -> None:
    truth = np.zeros((3, 3))
    assert len(drift_percent(truth, truth, 100.0)) == 0
