"""Chi-squared bands for many verdicts at once: what a whole table may cost in false alarms, and what it can see."""

from scipy.stats import chi2

CONSISTENT, OVERCONFIDENT, CAUTIOUS = "consistent", "overconfident", "conservative"
VERDICTS = (CONSISTENT, OVERCONFIDENT, CAUTIOUS)


def each_probability(false_alarm: float, tests: int) -> float:
    """Probability of each of `tests` bands so that all hold together with 1 − `false_alarm` or more (Bonferroni).

    The inequality asks nothing of how the tests depend on one another: times of one run, methods and masks on the same
    sensor errors may be as correlated as they are.

    >>> each_probability(0.01, 4)
    0.9975
    """
    if not 0.0 < false_alarm < 1.0 or tests < 1:
        raise ValueError(f"false alarm {false_alarm} of {tests} tests, expected 0 to 1 of one or more")
    return 1.0 - false_alarm / tests


def mean_band(degrees: float, values: int, probability: float) -> tuple[float, float]:
    """Band of the mean of independent chi-squared values: `values` times the mean has `degrees` · `values` degrees.

    `degrees` may be a mean where the number of rows differs from value to value.

    >>> low, high = mean_band(6, 200, 0.95)
    >>> round(low, 2), round(high, 2)
    (5.53, 6.49)
    """
    tails = (0.5 * (1.0 - probability), 0.5 * (1.0 + probability))
    low, high = chi2.ppf(tails, degrees * values) / values
    return float(low), float(high)


def verdict(low: float, least: float, greatest: float, high: float) -> str:
    """What the least and greatest of several means say of a band; a value above it outweighs one below.

    >>> verdict(5.0, 5.5, 6.5, 7.0), verdict(5.0, 4.0, 7.5, 7.0), verdict(5.0, 4.0, 6.0, 7.0)
    ('consistent', 'overconfident', 'conservative')
    """
    if greatest > high:
        return OVERCONFIDENT
    return CAUTIOUS if least < low else CONSISTENT


def detectable_factor(degrees: int, runs: int, probability: float, power: float = 0.9) -> float:
    """Least factor on the covariance error that the band finds with this power: true over claimed variance.

    If every error is √c times what is claimed, the mean over runs is c times chi-squared, and it passes the upper limit
    with `power` for c = limit · runs / quantile(1 − power).

    >>> round(detectable_factor(6, 100, 0.95), 3)
    1.204
    """
    _, high = mean_band(degrees, runs, probability)
    return float(high * runs / chi2.ppf(1.0 - power, degrees * runs))
