"""How a number is written: on pages, in Markdown tables, in the terminal."""

import numpy as np

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def number(value: float | None, digits: int = 3) -> str:
    """A number for a page: some significant digits, no needless zeros or exponents; a dash for None, NaN and infinity.

    >>> number(35.7344), number(0.04686), number(1532.3), number(2.3e6), number(None)
    ('35.7', '0.0469', '1530', '2.3×10⁶', '–')
    """
    if value is None or not np.isfinite(value):
        return "–"
    if value != 0.0 and not 1e-4 <= abs(value) < 1e5:
        mantissa, exponent = f"{value:.{digits - 2}e}".split("e")
        return f"{mantissa}×10{str(int(exponent)).translate(_RAISED)}".replace("-", "−")
    rounded = float(f"{value:.{digits}g}")
    places = max(0, digits - 1 - int(np.floor(np.log10(abs(rounded))))) if rounded else 0
    return f"{rounded:.{places}f}".replace("-", "−")


def plain(value: float | None, digits: int = 3, decimals: int = 3) -> str:
    """A number for a column of text: `decimals` places, fewer where more than `digits` digits would show; ASCII.

    Integer digits are never rounded away below 10,000; from there on the power of ten stands.

    >>> plain(0.0517), plain(13.04), plain(258.4), plain(52_900.0), plain(None)
    ('0.052', '13.0', '258', '5e4', '-')
    >>> plain(6.0, decimals=1), plain(13.04, digits=4), plain(258.4, digits=9)
    ('6.0', '13.04', '258.400')
    """
    if value is None or not np.isfinite(value):
        return "-"
    if abs(value) >= 1e4:
        return f"{value:.0e}".replace("e+0", "e").replace("e+", "e")
    before = 0 if abs(value) < 1.0 else 1 + int(np.log10(abs(value)))
    return f"{value:.{max(0, min(decimals, digits - before))}f}"
