"""Times that a table writes as dates, by their content: a date and time, both in two columns, or a time of the day."""

import re

import numpy as np
import polars as pl
from numpy.typing import NDArray

Integers = NDArray[np.int64]

MOST_ABSENT = 0.05
"""Part of the cells that may be no date."""
_DATE = r"(?:\d{4}[-/.]\d\d?[-/.]\d\d?|\d\d?\.\d\d?\.\d{4})"
_TIME = r"\d\d?:\d\d(?::\d\d(?:[.,]\d+)?)?"
_ZONE = r"(?:Z|\s*UTC|[+-]00:?00)?"
_DAY_NS = 86_400_000_000_000


def written_times(frame: pl.DataFrame) -> tuple[Integers, str, bool] | None:
    """Times of a table's rows, ns, the columns that hold them, and whether they are Unix times; None without any.

    >>> time_ns, why, epoch = written_times(pl.DataFrame({"Zeit": ["01.05.2024 12:00:00,5", "01.05.2024 12:00:01"]}))
    >>> int(time_ns[1] - time_ns[0]), why, epoch
    (500000000, 'dates of Zeit', True)
    """
    text = [name for name in frame.columns if frame[name].dtype == pl.String]
    for name in text:
        if _is(frame[name], rf"{_DATE}[T ]\s*{_TIME}{_ZONE}"):
            times = _parsed(frame[name])
            if times is not None:
                return times, f"dates of {name}", True
    clocks = [name for name in text if _is(frame[name], rf"{_TIME}{_ZONE}")]
    days = [name for name in text if _is(frame[name], _DATE)]
    for clock in clocks:
        for day in days:
            times = _parsed(frame[day] + pl.Series([" "]) + frame[clock])
            if times is not None:
                return times, f"{day} and {clock} together", True
        times = _parsed(pl.Series(["1970-01-01 "]) + frame[clock])
        if times is not None:
            # A time that falls by hours has passed midnight.
            midnights = np.concatenate([[0], np.cumsum(np.diff(times) < -_DAY_NS // 2)])
            return times + midnights * _DAY_NS, f"time of the day in {clock}", False
    return None


def _is(series: pl.Series, pattern: str) -> bool:
    return re.fullmatch(pattern, str(series.first(ignore_nulls=True) or "").strip()) is not None


def _parsed(series: pl.Series) -> Integers | None:
    """Unix times, ns; None where too many cells are no date."""
    text = (
        series.str.strip_chars()
        .str.replace(rf"{_ZONE}$", "")
        .str.replace(",", ".", literal=True)
        .str.replace(r"^(\d\d?)\.(\d\d?)\.(\d{4})", "$3-$2-$1")
        .str.replace(r"^(\d{4})[/.](\d\d?)[/.](\d\d?)", "$1-$2-$3")
        .str.replace(r"^(\d{4}-\d\d?-\d\d?)T?\s*", "$1 ")
    )
    frame = text.to_frame("text")
    parsed = frame.select(
        pl.coalesce(
            pl.col("text").str.to_datetime(form, time_unit="ns", strict=False)
            for form in ("%Y-%m-%d %H:%M:%S%.f", "%Y-%m-%d %H:%M")
        )
    ).to_series()
    if parsed.null_count() > MOST_ABSENT * len(parsed):
        return None
    filled = parsed.cast(pl.Int64).fill_null(strategy="forward").fill_null(strategy="backward")
    return np.asarray(filled.to_numpy(), dtype=np.int64)
