"""The one verdict on consistency, and its chi-squared bands for the false-alarm rate of a family."""

from collections.abc import Sequence

from scipy.stats import chi2

CONSISTENT, OVERCONFIDENT, CONSERVATIVE = "consistent", "overconfident", "conservative"

FALSE_ALARM = 0.01
"""Probability, at most, that any verdict of a family of consistent filters is another one."""

TIMES = 5
"""Times of a run at which its NEES is judged."""


def judged_samples(samples: int) -> list[int]:
    """Which of a run's samples are judged: the last one of each fifth.

    NEES at neighbouring times is nearly the same number, so a mean over time has no chi-squared band. A mean over
    independent runs at one time has.

    >>> judged_samples(250), judged_samples(2)
    ([49, 99, 149, 199, 249], [0, 1])
    """
    return sorted({max(1, round(samples * (k + 1) / TIMES)) - 1 for k in range(TIMES)})


def each_probability(false_alarm: float, tests: int) -> float:
    """Probability of each of `tests` bands for which all hold together with 1 − `false_alarm` or more (Bonferroni).

    The inequality holds for any dependence of the tests: times of one run, and methods and masks on the same sensor
    errors, are correlated.

    Raises:
        ValueError: for a false-alarm rate outside 0 to 1, or no test.

    >>> each_probability(0.01, 4)
    0.9975
    """
    if not 0.0 < false_alarm < 1.0 or tests < 1:
        raise ValueError(f"false alarm {false_alarm} of {tests} tests, expected 0 to 1 of one or more")
    return 1.0 - false_alarm / tests


def mean_band(degrees: float, values: int, probability: float) -> tuple[float, float]:
    """Band of the mean of independent chi-squared values: `values` times the mean has `degrees` · `values` degrees.

    `degrees` may be a mean where the values differ in their number of rows.

    >>> low, high = mean_band(6, 200, 0.95)
    >>> round(low, 2), round(high, 2)
    (5.53, 6.49)
    """
    tails = (0.5 * (1.0 - probability), 0.5 * (1.0 + probability))
    low, high = chi2.ppf(tails, degrees * values) / values
    return float(low), float(high)


def family_band(degrees: float, values: int, family: int) -> tuple[float, float]:
    """Band of each of the means of a family, all of which lie within theirs with 1 − `FALSE_ALARM` or more.

    Args:
        degrees: expected value of each chi-squared value.
        values: number of independent values behind the mean.
        family: number of means that are judged together.
    """
    return mean_band(degrees, values, each_probability(FALSE_ALARM, family))


def verdict(nees: Sequence[float], runs: int, degrees: float, family: int) -> str:
    """The verdict of every table, page and recommendation on the NEES of a filter.

    Overconfident above the band at any of the times; conservative below it at some time and above it at none.

    Args:
        nees: mean over the runs at each of the judged times.
        runs: number of independent runs.
        degrees: expected value for a consistent filter.
        family: number of means that are judged together: methods, trajectories, times, and so on.

    >>> verdict([6.1, 5.9], 100, 6, 2), verdict([4.0, 7.9], 100, 6, 2), verdict([4.0, 6.0], 100, 6, 2)
    ('consistent', 'overconfident', 'conservative')
    """
    low, high = family_band(degrees, runs, family)
    if max(nees) > high:
        return OVERCONFIDENT
    return CONSERVATIVE if min(nees) < low else CONSISTENT
