"""Packaged pages filled in: one environment for all, numbers written as everywhere."""

from typing import Any

import jinja2
import numpy as np

from bottomlock.figures.palette import stroke

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def number(value: float | None, digits: int = 3) -> str:
    """A number to some significant digits, without needless zeros or exponents; a dash where there is none.

    >>> number(35.7344), number(0.04686), number(1532.3), number(2.3e6), number(None)
    ('35.7', '0.0469', '1530', '2.3×10⁶', '–')
    """
    if value is None or not np.isfinite(value):
        return "–"
    if value != 0.0 and not 1e-4 <= abs(value) < 1e5:
        mantissa, exponent = f"{value:.{digits - 2}e}".split("e")
        return f"{mantissa}×10{str(int(exponent)).translate(_RAISED)}".replace("-", "−")
    rounded = float(f"{value:.{digits}g}")
    decimals = max(0, digits - 1 - int(np.floor(np.log10(abs(rounded))))) if rounded else 0
    return f"{rounded:.{decimals}f}".replace("-", "−")


def render(template: str, content: dict[str, Any]) -> str:
    """A packaged page, its numbers, methods' colours and titles written as everywhere."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("bottomlock.pages", "templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["number"] = number
    environment.filters["colour"] = lambda method: stroke(method).colour
    environment.filters["title"] = lambda name: str(name).replace("_", " ").capitalize()
    return environment.get_template(template).render(content)
