"""A page of tables and pictures, in the look of all pages, for studies without a page of their own kind."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from bottomlock.pages.render import render

VERDICTS = ("consistent", "overconfident", "conservative")


@dataclass(frozen=True)
class Picture:
    """A PNG, and what it shows."""

    path: Path
    caption: str

    @property
    def address(self) -> str:
        """The picture itself as an address, so that the page stands alone."""
        return "data:image/png;base64," + base64.b64encode(self.path.read_bytes()).decode()


@dataclass(frozen=True)
class Part:
    """A heading with lines of text, pictures and a table.

    Attributes:
        id: of the heading, for links.
        heading: words.
        lines: paragraphs.
        pictures: PNGs.
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
