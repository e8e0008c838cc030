"""A result laid out once, title, answer, and parts of text, figures and tables; and its writers to HTML and Markdown.

Texts are Markdown: paragraphs, lists, `code`, **bold** and *emphasis*. Tables are of strings, in which `<br>` begins a
line; a cell that is a method in code is shown with the method's look where there are colours.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from markdown_it import MarkdownIt
from markupsafe import Markup
from matplotlib.figure import Figure

from bottomlock.figures.inline_svg import inline_svg
from bottomlock.figures.palette import svg_text
from bottomlock.files.atomic_write import write_text
from bottomlock.pages.render import render

VERDICTS = ("consistent", "overconfident", "conservative")


@dataclass(frozen=True)
class Picture:
    """A figure in the colours of the page, and what it shows.

    Attributes:
        svg: within the page.
        caption: below it, and for screen readers.
        kind: class of the stylesheet: "wide", or "" for half of a wide page.
    """

    svg: Markup
    caption: str
    kind: str = "wide"

    @classmethod
    def of(cls, figure: Figure, name: str, caption: str, *, kind: str = "wide") -> Self:
        """A figure under a name of letters, digits and underscores that no other figure of the page has."""
        return cls(Markup(inline_svg(svg_text(figure), name, caption)), caption, kind)  # noqa: S704 - our own


@dataclass(frozen=True)
class Table:
    """Strings in rows; the first cell names the row.

    Attributes:
        columns: names.
        rows: as wide as `columns`.
        caption: beside it, where it needs one.
        left: columns from the left that hold words; the others hold numbers.
        folded: whether it stands behind a summary on a page that can unfold.
    """

    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""
    left: int = 1
    folded: bool = False


@dataclass(frozen=True)
class Part:
    """A heading with text, figures and tables in their order.

    Attributes:
        id: of the heading, for links.
        heading: words.
        blocks: a string is a paragraph or a list.
    """

    id: str
    heading: str
    blocks: Sequence[str | Picture | Table]


@dataclass(frozen=True)
class Page:
    """A result.

    Attributes:
        title: words.
        answer: the conclusions, a sentence each.
        parts: what they rest on.
        intro: paragraphs after the answer.
        about: what it is of, in a line below the title of a page of its own.
        made_with: names and versions.
    """

    title: str
    answer: Sequence[str]
    parts: Sequence[Part]
    made_with: str
    intro: Sequence[str] = ()
    about: str = ""


def html(page: Page) -> str:
    """The page as HTML that needs no network.

    >>> page = Page("A study", ["None in `tc`."], [Part("a", "Of what", ["Two *runs*."])], "bottomlock")
    >>> text = html(page)
    >>> "<h1>A study</h1>" in text, "<li>None in <code>tc</code>.</li>" in text, 'href="#a"' in text
    (True, True, True)
    """
    answer = [Part("answer", "Answer", [_numbered(page.answer), *page.intro])] if page.answer else []
    content = {
        "page": page,
        "parts": [*answer, *page.parts],
        "text": _html,
        "cell": _cell,
        "method_of": _method,
        "verdicts": VERDICTS,
        "plain": plain_text,
    }
    return render("page.html.j2", content)


def markdown(page: Page) -> str:
    """The page in Markdown, without its figures.

    >>> print(markdown(Page("A study", ["None."], [Part("a", "Of what", [Table(["a", "b"], [["1", "2"]])])], "")))
    # A study
    <BLANKLINE>
    1. None.
    <BLANKLINE>
    ## Of what
    <BLANKLINE>
    | a | b |
    | --- | ---: |
    | 1 | 2 |
    <BLANKLINE>
    """
    blocks = [f"# {page.title}", *([_numbered(page.answer)] if page.answer else []), *page.intro]
    for part in page.parts:
        blocks.append(f"## {part.heading}")
        for block in part.blocks:
            if isinstance(block, str):
                blocks.append(block)
            elif isinstance(block, Table):
                blocks += [*([block.caption] if block.caption else []), _markdown_table(block)]
    return "\n\n".join(blocks) + "\n"


def write_pages(stem: Path, page: Page) -> None:
    """Writes `stem`.md and `stem`.html."""
    write_text(stem.with_name(f"{stem.name}.md"), markdown(page))
    write_text(stem.with_name(f"{stem.name}.html"), html(page))


def listed(lines: Sequence[str]) -> str:
    """A list in Markdown."""
    return "\n".join(f"- {line}" for line in lines)


def plain_text(marked: str) -> str:
    """A text without its marks.

    >>> plain_text("**`tc`**: 0.2 †<br>0.1–0.4")
    'tc: 0.2 † 0.1–0.4'
    """
    return re.sub(r"\*\*|`|\*", "", marked.replace("<br>", " "))


def _numbered(lines: Sequence[str]) -> str:
    return "\n".join(f"{place}. {line}" for place, line in enumerate(lines, start=1))


def _markdown_table(table: Table) -> str:
    def line(cells: Sequence[str]) -> str:
        return "| " + " | ".join(cells) + " |"

    ruler = ["---" if place < table.left else "---:" for place in range(len(table.columns))]
    return "\n".join([line(table.columns), line(ruler), *(line(row) for row in table.rows)])


_MARKDOWN = MarkdownIt("js-default")


def _html(marked: str) -> Markup:
    return Markup(_MARKDOWN.render(marked))  # noqa: S704 - the library escapes what is HTML in it


def _cell(marked: str) -> Markup:
    """A cell in HTML, its lines with a break between."""
    lines = (Markup(_MARKDOWN.renderInline(line)) for line in marked.split("<br>"))  # noqa: S704
    return Markup("<br>").join(lines)


def _method(cell: str) -> str:
    """The method that a cell is in code; "" for another cell."""
    found = re.fullmatch(r"`(\w+)`", cell)
    return found[1] if found else ""
