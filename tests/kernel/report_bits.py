"""A report as it is compared: every attribute, numbers whole."""

from typing import Any

import numpy as np

from bottomlock.kernel import Report

FIELDS = tuple(name for name in dir(Report) if not name.startswith("_"))


def report_bits(report: Report, *, without: tuple[str, ...] = ()) -> list[Any]:
    """Arrays as bytes, all else as text, in the order of the names."""
    values = (getattr(report, name) for name in FIELDS if name not in without)
    return [value.tobytes() if isinstance(value, np.ndarray) else repr(value) for value in values]
