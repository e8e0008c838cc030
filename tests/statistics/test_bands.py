"""Bands by hand: tabulated chi-squared quantiles, Bonferroni's arithmetic, and what a band can see."""

import pytest
from scipy.stats import chi2

from bottomlock.statistics.chi_squared import (
    each_probability,
    family_band,
    judged_samples,
    mean_band,
    verdict,
)


@pytest.mark.parametrize(
    ("degrees", "values", "low", "high"),
    [(1, 100, 74.222, 129.561), (2, 50, 74.222, 129.561), (5, 2, 3.247, 20.483), (0.5, 20, 3.247, 20.483)],
)
def test_mean_band_from_the_printed_table(degrees: float, values: int, low: float, high: float) -> None:
    """Quantiles 2.5 and 97.5 % of chi-squared with 100 and 10 degrees, as every table prints them, over the number."""
    assert mean_band(degrees, values, 0.95) == pytest.approx((low / values, high / values), rel=2e-5)


def test_bonferroni() -> None:
    """A hundredth shared by four tests is a quarter of a hundredth each; no number of tests is rejected quietly."""
    assert each_probability(0.01, 4) == pytest.approx(0.9975)
    for false_alarm, tests in ((0.0, 3), (1.0, 3), (0.01, 0)):
        with pytest.raises(ValueError, match="expected 0 to 1"):
            each_probability(false_alarm, tests)


@pytest.mark.parametrize(
    ("at_low", "at_high", "expected"),
    [
        (1.001, 0.999, "consistent"),
        (1.001, 1.001, "overconfident"),
        (0.999, 0.999, "conservative"),
        (0.999, 1.001, "overconfident"),
    ],
)
@pytest.mark.parametrize("degrees", [6, 20])
def test_verdicts_at_the_limits(degrees: int, at_low: float, at_high: float, expected: str) -> None:
    """A thousandth inside and outside either limit, which scipy gives: 1 % is shared by 48 means, each with two tails.

    Overconfidence at one time outweighs caution at another: it is the fault that does harm.
    """
    low, high = chi2.ppf([0.005 / 48, 1.0 - 0.005 / 48], 40 * degrees) / 40
    assert family_band(degrees, 40, 48) == pytest.approx((low, high))
    assert verdict([float(degrees), at_low * low, at_high * high], 40, degrees, 48) == expected


def test_the_judged_samples_are_the_ends_of_fifths() -> None:
    """Of a second each: 50, 100, … 250 s; the last one always is, and of few samples every one."""
    assert judged_samples(250) == [49, 99, 149, 199, 249]
    assert judged_samples(301) == [59, 119, 180, 240, 300]
    assert [judged_samples(count) for count in (1, 3, 5)] == [[0], [0, 1, 2], [0, 1, 2, 3, 4]]
