"""A value as TOML writes it."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def toml_value(value: Any) -> str:  # noqa: ANN401 - a value of any key
    """The value as TOML writes it, numbers to nine digits, large ones to a millionth of their unit.

    >>> toml_value({"column": "t", "sd_m": (0.5, 1e-7), "on": True}), toml_value(-1699999987.8)
    ('{ column = "t", sd_m = [0.5, 1e-07], on = true }', '-1699999987.8')
    """
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return _number(value)
    if isinstance(value, str | Path):
        return json.dumps(str(value), ensure_ascii=False)
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {toml_value(one)}" for key, one in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml_value(one) for one in value) + "]"
    return str(value)


def _number(value: float) -> str:
    if math.isinf(value) or math.isnan(value):
        return str(value)
    # An offset between clocks of different centuries keeps its microseconds.
    digits = max(9, len(str(int(abs(value)))) + 6) if abs(value) < 1e12 else 17
    short = f"{value:.{digits}g}"
    return short if any(mark in short for mark in ".e") else f"{short}.0"
