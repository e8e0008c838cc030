"""Dates of records as nanoseconds since 1970, for many records at once."""

import numpy as np

from bottomlock.io.beam_table import Flags, Integers


def minute_ns(
    year: Integers, month: Integers, day: Integers, hour: Integers, minute: Integers
) -> tuple[Integers, Flags]:
    """Nanoseconds since 1970 of the beginnings of minutes (n,), and which of them the calendar has (n,).

    >>> found, good = minute_ns(*(np.array(v) for v in ([1970, 2024], [1, 2], [2, 30], [0, 0], [1, 0])))
    >>> found[0], good.tolist()
    (np.int64(86460000000000), [True, False])
    """
    months = (year.astype(np.int64) - 1970) * 12 + month - 1
    first, after = (
        each.astype("datetime64[M]").astype("datetime64[D]").astype(np.int64) for each in (months, months + 1)
    )
    good = (month >= 1) & (month <= 12) & (day >= 1) & (day <= after - first) & (hour <= 23) & (minute <= 59)
    return ((first + day - 1) * 1440 + hour * 60 + minute) * 60_000_000_000, np.asarray(good, dtype=bool)
