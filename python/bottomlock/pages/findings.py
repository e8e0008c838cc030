"""Findings of an audit or a replay as a part of a page."""

from collections.abc import Mapping, Sequence
from typing import Any

from bottomlock.pages.page import Block, Part, Table

_COLUMNS = ("Severity", "Finding", "Evidence", "What to do")


def findings_part(findings: Sequence[Mapping[str, Any]], *after: Block) -> Part:
    """What is wrong or remarkable, the worst first, from findings as `Finding.to_json` has them."""
    rows = [[one["severity"], one["text"], one["evidence"], one["hint"]] for one in findings]
    caption = "What is wrong or remarkable, the worst first."
    told: Block = Table(_COLUMNS, rows, caption, left=len(_COLUMNS)) if rows else "No finding."
    return Part("findings", "Findings", [told, *after])
