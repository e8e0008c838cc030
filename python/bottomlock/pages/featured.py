"""Which methods the first figures of a report show: few enough to be told apart."""

from collections.abc import Sequence

from bottomlock.figures.palette import STROKES

MOST = 5
"""Methods in a figure that stands open; the others are one click away, a panel each."""

ORDER = (
    "dead_reckoning",
    "lc",
    "tc",
    "nsv",
    "ins",
    "vb",
    "sway_current",
    "consistent",
    "weak_sway",
    "plcf",
    "vhv",
    "elc",
    "info",
)
"""Who comes first after the methods of one's own and the recommended one: dead reckoning, which a filter has to beat,
the reference with every beam, the method without assumptions, the usual assumption, what happens without beams."""


def featured(methods: Sequence[str], recommended: Sequence[str]) -> list[str]:
    """At most `MOST` methods for the first figures, in the order of `methods`.

    Args:
        methods: of the campaign.
        recommended: those of them that the report recommends, the best first.

    >>> featured(["ins", "lc", "tc", "vb", "nsv", "plcf", "consistent"], ["consistent"])
    ['ins', 'lc', 'tc', 'nsv', 'consistent']
    >>> featured(["ins", "lc", "tc", "vb", "nsv", "dead_reckoning"], ["tc"])
    ['ins', 'lc', 'tc', 'nsv', 'dead_reckoning']
    >>> featured(["ins", "lc", "tc", "nsv", "mine"], ["tc"])
    ['ins', 'lc', 'tc', 'nsv', 'mine']
    """
    own = [method for method in methods if method not in STROKES]
    wanted = dict.fromkeys([*recommended[:1], *own[:2], *ORDER, *methods])
    chosen = [method for method in wanted if method in methods][:MOST]
    return [method for method in methods if method in chosen]
