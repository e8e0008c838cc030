"""White noise and walk of differences: both with their sigmas, and no step where noise hides the walk."""

import numpy as np
import pytest

from bottomlock.recordings.noise_growth import Walk, noise_growth

STEP_S = 0.5
LAGS = (1, 2, 3, 4, 6, 8)


def drawn(seed: int, white: float, walk: float, count: int = 600) -> list[tuple[int, np.ndarray]]:
    rng = np.random.default_rng(seed)
    walked = np.cumsum(walk * np.sqrt(STEP_S) * rng.normal(size=(count, 3)), axis=0)
    values = walked + white * rng.normal(size=(count, 3))
    return [(lag, values[lag:] - values[:-lag]) for lag in LAGS]


@pytest.mark.parametrize("walk", [0.0, 0.02, 0.2])
def test_estimates_are_within_their_sigmas(walk: float) -> None:
    """Of 60 drawn series: the mean is right, and the scatter that of the claim within a factor of two."""
    found = [noise_growth(drawn(seed, 0.1, walk), STEP_S) for seed in range(60)]
    squares = np.array([one.walk.square for one in found if one is not None])
    claimed = np.array([one.walk.sd for one in found if one is not None])
    assert len(squares) == 60
    assert abs(squares.mean() - walk**2) < 4.0 * squares.std() / np.sqrt(60.0) + 0.05 * walk**2
    assert 0.5 < squares.std() / claimed.mean() < 2.0
    white = np.mean([one.white for one in found if one is not None], axis=0)
    assert np.sqrt(0.5 * white) == pytest.approx([0.1] * 3, rel=0.1)


def test_outliers_do_not_sway_it() -> None:
    moved = drawn(3, 0.1, 0.05)
    for _, values in moved:
        values[::50] += 30.0
    found, clean = noise_growth(moved, STEP_S), noise_growth(drawn(3, 0.1, 0.05), STEP_S)
    assert found is not None
    assert clean is not None
    assert found.walk.square == pytest.approx(clean.walk.square, rel=0.3)


def test_a_density_has_no_step() -> None:
    """From far below zero to far above: it rises, by no more than a little from one estimate to the next."""
    squares = np.linspace(-40.0, 40.0, 2001)
    for scatter in (0.0, 0.01, 0.5):
        values = np.array([Walk(square, 1.0).density(scatter) for square in squares])
        assert (np.diff(values, axis=0) > 0.0).all()
        assert np.diff(values, axis=0).max() < 0.03
        assert (values[:, 1] > values[:, 0]).all()
    assert Walk(100.0, 1.0).density(0.5)[0] == pytest.approx(10.0, rel=0.01)


def test_what_the_readings_scatter_by_bounds_what_is_hidden() -> None:
    """No less than it, and of gyros beside a poor attitude not what that attitude would hide."""
    hidden = Walk(0.3, 1.0)
    assert hidden.density()[1] > 1.0
    assert 0.01 < hidden.density(0.01)[0] < hidden.density(0.01)[1] < 0.2
    assert Walk(-50.0, 1.0).density(0.01)[0] >= 0.01
    assert Walk(4.0, 0.0).density() == (2.0, 2.0)


def test_one_lag_tells_nothing() -> None:
    assert noise_growth(drawn(1, 0.1, 0.1)[:1], STEP_S) is None
