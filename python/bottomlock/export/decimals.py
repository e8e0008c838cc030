"""Numbers and times as text that reads back to the same value."""

import numpy as np


def decimal(value: float) -> str:
    """The shortest decimal number that reads back as the same double, without an exponent.

    >>> decimal(54.1), decimal(-1e-7), decimal(12.0)
    ('54.1', '-0.0000001', '12')
    """
    return np.format_float_positional(value, trim="-")


def seconds(time_ns: int) -> str:
    """A time in seconds, exact to the nanosecond.

    >>> seconds(1_767_225_610_250_000_001), seconds(-1)
    ('1767225610.250000001', '-0.000000001')
    """
    whole, rest = divmod(abs(int(time_ns)), 10**9)
    return f"{'-' if time_ns < 0 else ''}{whole}.{rest:09d}"


def utc(time_ns: int) -> str:
    """Unix time in ISO 8601, exact to the nanosecond; the fraction is left out where it is zero.

    >>> utc(1_767_225_610_250_000_001), utc(1_767_225_610 * 10**9)
    ('2026-01-01T00:00:10.250000001Z', '2026-01-01T00:00:10Z')
    """
    whole, rest = divmod(int(time_ns), 10**9)
    fraction = f".{rest:09d}".rstrip("0").rstrip(".")
    return f"{np.datetime64(whole, 's')}{fraction}Z"
