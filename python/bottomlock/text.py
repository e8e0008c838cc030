"""Text for people: the name that was probably meant, numbers of some digits, a small HTML table for notebooks."""

import difflib
import html
import math
from collections.abc import Iterable, Sequence

ALIKE = 0.5
"""How alike two names are, by `difflib`'s ratio, for one to be proposed for the other."""


def nearest(name: object, known: Iterable[str], *, alike: float = ALIKE) -> str | None:
    """The known name most like one given, whatever the case of its letters; None where none is alike, or it is no text.

    >>> nearest("Strait", ["straight", "lawn_mower"]), nearest("x", ["straight"]), nearest(3, ["straight"])
    ('straight', None, None)
    """
    if not isinstance(name, str):
        return None
    by_lower = {one.lower(): one for one in known}
    close = difflib.get_close_matches(name.lower(), by_lower, n=1, cutoff=alike)
    return by_lower[close[0]] if close else None


def guess(name: object, known: Iterable[str]) -> str:
    """The hint of an error on a name: "did you mean 'straight'?", or "" where none is alike."""
    return did_you_mean(name, known).removeprefix(", ")


def did_you_mean(name: object, known: Iterable[str], otherwise: str = "") -> str:
    """Words that follow the name in a message: ", did you mean 'straight'?", or `otherwise` where none is alike.

    >>> did_you_mean("strait", ["straight"])
    ", did you mean 'straight'?"
    """
    close = nearest(name, known)
    return otherwise if close is None else f", did you mean '{close}'?"


_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def number(value: float | None, digits: int = 3) -> str:
    """A number for a page: some significant digits, no needless zeros or exponents; a dash for None, NaN and infinity.

    >>> number(35.7344), number(0.04686), number(1532.3), number(2.3e6), number(None)
    ('35.7', '0.0469', '1530', '2.3×10⁶', '–')
    """
    if value is None or not math.isfinite(value):
        return "–"
    if value != 0.0 and not 1e-4 <= abs(value) < 1e5:
        mantissa, exponent = f"{value:.{digits - 2}e}".split("e")
        return f"{mantissa}×10{str(int(exponent)).translate(_RAISED)}".replace("-", "−")
    rounded = float(f"{value:.{digits}g}")
    places = max(0, digits - 1 - math.floor(math.log10(abs(rounded)))) if rounded else 0
    return f"{rounded:.{places}f}".replace("-", "−")


def plain(value: float | None, digits: int = 3, decimals: int = 3) -> str:
    """A number for a column of text: `decimals` places, fewer where more than `digits` digits would show; ASCII.

    Integer digits are never rounded away below 10,000; from there on the power of ten stands.

    >>> plain(0.0517), plain(13.04), plain(258.4), plain(52_900.0), plain(None)
    ('0.052', '13.0', '258', '5e4', '-')
    >>> plain(6.0, decimals=1), plain(13.04, digits=4), plain(258.4, digits=9)
    ('6.0', '13.04', '258.400')
    """
    if value is None or not math.isfinite(value):
        return "-"
    if abs(value) >= 1e4:
        return f"{value:.0e}".replace("e+0", "e").replace("e+", "e")
    before = 0 if abs(value) < 1.0 else 1 + int(math.log10(abs(value)))
    return f"{value:.{max(0, min(decimals, digits - before))}f}"


def html_table(title: str, rows: Iterable[Sequence[str]], head: Sequence[str] = ()) -> str:
    """A table with a title; every cell is escaped.

    >>> html_table("a < b", [("x", "1")])
    '<table><caption>a &lt; b</caption><tbody><tr><td>x</td><td>1</td></tr></tbody></table>'
    """
    top = f"<thead>{_row(head, 'th')}</thead>" if head else ""
    body = "".join(_row(row, "td") for row in rows)
    return f"<table><caption>{html.escape(title)}</caption>{top}<tbody>{body}</tbody></table>"


def _row(cells: Sequence[str], tag: str) -> str:
    return f"<tr>{''.join(f'<{tag}>{html.escape(cell)}</{tag}>' for cell in cells)}</tr>"
