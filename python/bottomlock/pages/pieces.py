"""Pieces that several pages have: titles, methods with their lines, findings, JSON behind a summary, differences."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from bottomlock.figures.palette import stroke
from bottomlock.pages.page import Block, Coloured, Folded, Part, Table, Terms, plain_text
from bottomlock.support.notebook import html_table


def title_of(name: str) -> str:
    """A name as a title.

    >>> title_of("figure_eight")
    'Figure eight'
    """
    return name.replace("_", " ").capitalize()


def glossary(methods: Iterable[str], words: Mapping[str, str] | None = None) -> Terms:
    """Methods, each with a line on it; `words` replaces some of the lines."""
    own = words or {}
    return Terms([(f"`{method}`", own.get(method, stroke(method).words)) for method in methods])


def glossaries(
    methods: Iterable[str], first: Iterable[str], words: Mapping[str, str] | None = None
) -> list[Block]:
    """The first methods with their lines, and the others behind a summary."""
    shown = list(first)
    others = [method for method in dict.fromkeys(methods) if method not in shown]
    summary = f"The other {len(others)} methods, in a line each: {', '.join(others)}"
    return [glossary(shown, words), *([Folded(summary, [glossary(others, words)])] if others else [])]


def json_part(id_: str, heading: str, name: str, content: Mapping[str, Any]) -> Part:
    """A JSON file behind its name, not on paper."""
    text = json.dumps(content, indent=2, sort_keys=True, ensure_ascii=False)
    return Part(id_, heading, [Folded(name, [f"```\n{text}\n```"], printed=False)])


def interval(value: float, low: float, high: float, number: Callable[[float], str]) -> str:
    """A cell: a value, and below it its interval."""
    return f"{number(value)}<br>{number(low)} … {number(high)}"


def difference(row: Mapping[str, Any] | None, number: Callable[[float], str], note: str = "") -> str:
    """A cell: a difference with its interval, in colours where that excludes zero; a dash where there is none."""
    if row is None or row["difference"] is None:
        return "–"
    value, low, high = (row[f"difference{end}"] for end in ("", "_lo", "_hi"))
    words = f"{'+' if value > 0 else ''}{number(value)}{note}<br>{number(low)} … {number(high)}"
    return Coloured(words, "less" if high < 0 else "more" if low > 0 else "")


_COLUMNS = ("Severity", "Finding", "Evidence", "What to do")


def findings_part(findings: Sequence[Mapping[str, Any]], *after: Block) -> Part:
    """What is wrong or remarkable, the worst first, from findings as `Finding.to_json` has them."""
    rows = [[one["severity"], one["text"], one["evidence"], one["hint"]] for one in findings]
    caption = "What is wrong or remarkable, the worst first."
    told: Block = Table(_COLUMNS, rows, caption, left=len(_COLUMNS)) if rows else "No finding."
    return Part("findings", "Findings", [told, *after])


def notebook_table(table: Table) -> str:
    """The table as HTML without a style of its own, without marks."""
    rows = [[plain_text(cell) for cell in row] for row in table.rows]
    return html_table(plain_text(table.caption), rows, [plain_text(name) for name in table.columns])
