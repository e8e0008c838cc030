"""What a name that is not known was probably meant to be: the one place that decides it."""

import difflib
from collections.abc import Iterable

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
