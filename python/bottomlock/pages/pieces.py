"""Pieces that several pages have: titles, methods with their lines, findings, JSON behind a summary, differences."""

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from bottomlock.figures.palette import STROKES, stroke
from bottomlock.pages.page import (
    Block,
    Detail,
    Page,
    Part,
    Picture,
    Table,
    Terms,
    Viewer,
    plain_text,
)
from bottomlock.text import html_table, number

MOST = 5
"""Methods in a figure that stands open; the others are one click away."""

ORDER = (
    "dead_reckoning", "lc", "tc", "nsv", "ins", "vb", "sway_current", "weak_sway", "plcf", "vhv", "elc", "info",
)  # fmt: skip
"""Who comes first after the methods of one's own and the recommended one: dead reckoning, which a filter has to beat,
the reference with every beam, the method without assumptions, the usual assumption, what happens without beams."""


def featured(methods: Sequence[str], recommended: Sequence[str]) -> list[str]:
    """At most `MOST` methods for the first figures, in the order of `methods`.

    Args:
        methods: of the campaign.
        recommended: those of them that the report recommends, the best first.

    >>> featured(["ins", "lc", "tc", "vb", "nsv", "plcf", "elc"], ["elc"])
    ['ins', 'lc', 'tc', 'nsv', 'elc']
    >>> featured(["ins", "lc", "tc", "vb", "nsv", "dead_reckoning"], ["tc"])
    ['ins', 'lc', 'tc', 'nsv', 'dead_reckoning']
    >>> featured(["ins", "lc", "tc", "nsv", "mine"], ["tc"])
    ['ins', 'lc', 'tc', 'nsv', 'mine']
    """
    others = [method for method in methods if method not in STROKES]
    wanted = dict.fromkeys([*recommended[:1], *others[:2], *ORDER, *methods])
    chosen = [method for method in wanted if method in methods][:MOST]
    return [method for method in methods if method in chosen]


_CLOSURE = (
    "the one combination of a ping's beams that no velocity can cause: noise, outliers, a wrong geometry"
)
_NIS = (
    "normalised innovation squared: measured less predicted beams, squared, over the variance that the filter claims "
    "of them; its mean in a consistent filter is its degrees of freedom, the number of beams used"
)
EXPLANATIONS = {
    "Closure": (r"\b[Cc]losures?\b", _CLOSURE),
    "NIS": (r"\bNIS\b", _NIS),
    "% DT": (r"% DT\b", "position error in percent of the distance travelled"),
}
"""By term: how it stands in a text, and what it means."""


def explained(page: Page) -> Page:
    """The page with each of `EXPLANATIONS` at the end of the part in which its term first stands."""
    left = dict(EXPLANATIONS)
    parts = []
    for part in page.parts:
        text = "\n".join(line for block in part.blocks for line in _texts(block))
        here = [term for term, (pattern, _) in left.items() if re.search(pattern, text)]
        if here:
            terms = Terms([(term, left.pop(term)[1]) for term in here])
            parts.append(replace(part, blocks=[*part.blocks, terms]))
        else:
            parts.append(part)
    return replace(page, parts=parts)


def _texts(block: Block) -> Iterator[str]:
    """What a reader reads of a block without unfolding it."""
    match block:
        case str():
            if not block.startswith("```"):
                yield block
        case Picture():
            yield block.caption
        case Table():
            yield from (block.caption, *block.columns, *(cell for row in block.rows for cell in row))
        case Terms():
            yield from (text for row in block.rows for text in row)
        case Viewer():
            yield from (picture.caption for picture in block.still)
        case Detail():
            yield block.summary


def title_of(name: str) -> str:
    """A name as a title.

    >>> title_of("figure_eight")
    'Figure eight'
    """
    return name.replace("_", " ").capitalize()


def glossary(methods: Iterable[str], meanings: Mapping[str, str] | None = None) -> Terms:
    """Methods, each with a line on it; `meanings` replaces some of the lines."""
    given = meanings or {}
    return Terms([(f"`{method}`", given.get(method, stroke(method).meaning)) for method in methods])


def glossaries(
    methods: Iterable[str], first: Iterable[str], meanings: Mapping[str, str] | None = None
) -> list[Block]:
    """The first methods with their lines, and the others behind a summary."""
    shown = list(first)
    others = [method for method in dict.fromkeys(methods) if method not in shown]
    summary = f"The other {len(others)} methods, in a line each: {', '.join(others)}"
    return [glossary(shown, meanings), *([Detail(summary, [glossary(others, meanings)])] if others else [])]


def json_part(id_: str, heading: str, name: str, content: Mapping[str, Any]) -> Part:
    """A JSON file behind its name, not on paper."""
    text = json.dumps(content, indent=2, sort_keys=True, ensure_ascii=False)
    return Part(id_, heading, [Detail(name, [f"```\n{text}\n```"], printed=False)])


def interval(value: float, low: float, high: float) -> str:
    """A cell: a value, and below it its interval."""
    return f"{number(value)}<br>{number(low)} … {number(high)}"


_COLUMNS = ("Severity", "Finding", "Evidence", "What to do")


def findings_part(findings: Sequence[Mapping[str, Any]], *after: Block) -> Part:
    """What is wrong or remarkable, the worst first, from findings as `Finding.to_json` has them."""
    rows = [
        [finding["severity"], finding["text"], finding["evidence"], finding["hint"]] for finding in findings
    ]
    caption = "What is wrong or remarkable, the worst first."
    block: Block = Table(_COLUMNS, rows, caption, left=len(_COLUMNS)) if rows else "No finding."
    return Part("findings", "Findings", [block, *after])


def notebook_table(table: Table) -> str:
    """The table as HTML without a style of its own, without marks."""
    rows = [[plain_text(cell) for cell in row] for row in table.rows]
    return html_table(plain_text(table.caption), rows, [plain_text(name) for name in table.columns])
