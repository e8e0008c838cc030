"""Chi-squared bands for many verdicts at once: false-alarm rate of a whole table, and the departure it detects."""

from scipy.stats import chi2

CONSISTENT, OVERCONFIDENT, CONSERVATIVE = "consistent", "overconfident", "conservative"
VERDICTS = (CONSISTENT, OVERCONFIDENT, CONSERVATIVE)


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


def verdict(low: float, least: float, greatest: float, high: float) -> str:
    """Verdict on several means from the least and the greatest of them; one above the band outweighs one below.

    >>> verdict(5.0, 5.5, 6.5, 7.0), verdict(5.0, 4.0, 7.5, 7.0), verdict(5.0, 4.0, 6.0, 7.0)
    ('consistent', 'overconfident', 'conservative')
    """
    if greatest > high:
        return OVERCONFIDENT
    return CONSERVATIVE if least < low else CONSISTENT


def detectable_factor(degrees: int, runs: int, probability: float, power: float = 0.9) -> float:
    """Least ratio of true to claimed variance that the upper limit of the band detects with this power.

    If every error is √c times its claimed size, the sum over runs is c times chi-squared. It exceeds the upper limit
    with probability `power` for c = limit · runs / quantile(1 − power).

    >>> round(detectable_factor(6, 100, 0.95), 3)
    1.204
    """
    _, high = mean_band(degrees, runs, probability)
    return float(high * runs / chi2.ppf(1.0 - power, degrees * runs))
