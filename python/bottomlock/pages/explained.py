"""Terms of the field, each explained in the part of a page in which it first stands."""

import re
from collections.abc import Iterator
from dataclasses import replace

from bottomlock.pages.page import Block, Folded, Looked, Page, Picture, Table, Terms

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
        text = "\n".join(words for block in part.blocks for words in _texts(block))
        found = [term for term, (pattern, _) in left.items() if re.search(pattern, text)]
        if found:
            terms = Terms([(term, left.pop(term)[1]) for term in found])
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
            yield from (words for row in block.rows for words in row)
        case Looked():
            yield from (picture.caption for picture in block.still)
        case Folded():
            yield block.summary
