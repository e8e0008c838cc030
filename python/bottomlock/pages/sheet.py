"""A page of tables and pictures, in the look of all pages, for studies without a page of their own kind."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

from markupsafe import Markup
from matplotlib.figure import Figure

from bottomlock.figures.inline_svg import inline_svg
from bottomlock.figures.palette import svg_text
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
class Part:
    """A heading with lines of text, pictures and a table.

    Attributes:
        id: of the heading, for links.
        heading: words.
        lines: paragraphs.
        pictures: figures.
        caption: of the table.
        columns: names of its columns.
        rows: as wide as `columns`; the first cell names the row.
        methods: whether the first cells are methods, shown with their look.
        folded: whether the table stands behind a summary.
    """

    id: str
    heading: str
    lines: Sequence[str] = ()
    pictures: Sequence[Picture] = ()
    caption: str = ""
    columns: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    methods: bool = False
    folded: bool = False
    verdicts: tuple[str, ...] = field(default=VERDICTS)


def sheet(title: str, about: Sequence[str], parts: Sequence[Part], *, made_with: str) -> str:
    """The page as HTML.

    >>> page = sheet("A study", ["of one thing"], [Part("a", "Answer", ["None."])], made_with="bottomlock")
    >>> "<h1>A study</h1>" in page, 'href="#a"' in page
    (True, True)
    """
    content = {
        "title": title.lower(),
        "heading": title,
        "about": about,
        "parts": parts,
        "made_with": made_with,
    }
    return render("sheet.html.j2", content)
