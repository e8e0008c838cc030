"""A result laid out once, title, conclusion, and parts of text, figures and tables; and its writer to HTML.

Texts are Markdown: paragraphs, lists, `code`, **bold** and *emphasis*. A method in code is shown with its look where
there are colours. Tables are of strings, in which `<br>` begins a line.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from typing import Any, Self

import jinja2
from markdown_it import MarkdownIt
from markdown_it.token import Token
from markupsafe import Markup, escape
from matplotlib.figure import Figure as Paper

from bottomlock.figures.drawing import on_paper
from bottomlock.figures.palette import STROKES, figure_files, inline_svg, stroke, swatch_svg
from bottomlock.figures.series import Figure
from bottomlock.files.overwriting import Files
from bottomlock.pages.plots import Plots


def method(name: str) -> Markup:
    """A method with its look, and what it is where the pointer rests."""
    meaning, look = escape(stroke(name).meaning), swatch_svg(name)
    return Markup(f'<span class="method" title="{meaning}">{look}{escape(name)}</span>')  # noqa: S704 - numbers, colours


@cache
def _file(name: str) -> Markup:
    """A stylesheet, script or licence of the package as it is."""
    return Markup(files("bottomlock.pages").joinpath(name).read_text(encoding="utf-8"))  # noqa: S704 - our own


def _render(content: dict[str, Any]) -> str:
    """The template with its content, as text."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("bottomlock.pages"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return environment.get_template("page.html.j2").render(content | {"file": _file, "markup": Markup})


VERDICTS = ("consistent", "overconfident", "conservative", "fault", "warning", "note")
"""Cells that are shown in colours of their own."""


class Coloured(str):
    """A text in a colour of the stylesheet: "less", "more", "yes", "no", or a verdict's.

    >>> Coloured("Partly", "partly").kind
    'partly'
    """

    __slots__ = ("kind",)
    kind: str

    def __new__(cls, text: str, kind: str) -> Self:
        """A text and the colour's name."""
        coloured = super().__new__(cls, text)
        coloured.kind = kind
        return coloured


@dataclass(frozen=True)
class Picture:
    """A figure in the colours of the page, and what it shows.

    Attributes:
        svg: within the page.
        caption: below it, and for screen readers.
        kind: class of the stylesheet: "wide", "third", or "" for half of a wide page.
        files: of the figure, by their paths from the page; it links them below the caption.
    """

    svg: Markup
    caption: str
    kind: str = "wide"
    files: Sequence[str] = ()


@dataclass(frozen=True)
class Pictures:
    """The figures of a page, each with its PNG and SVG.

    Attributes:
        folder: of the files, from the page, with its stroke; "" for beside it.
        files: of all figures, by their paths from the page.
    """

    folder: str = "figures/"
    files: Files = field(default_factory=dict)

    def add(self, figure: Figure | Paper, name: str, caption: str, kind: str = "wide") -> Picture:
        """Draws a figure, under a name of letters, digits and underscores that no other figure of the page has."""
        files = figure_files(figure if isinstance(figure, Paper) else on_paper(figure), self.folder + name)
        self.files.update(files)
        svg = inline_svg(str(files[f"{self.folder}{name}.svg"]), name, caption)
        return Picture(Markup(svg), caption, kind, list(files))  # noqa: S704 - our own


@dataclass(frozen=True)
class Table:
    """Strings in rows; the first cell names the row.

    Attributes:
        columns: names.
        rows: as wide as `columns`.
        caption: beside it, where it needs one.
        left: columns from the left that hold words; the others hold numbers.
        ids: of the rows, for links; none where there is no link to them.
    """

    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""
    left: int = 1
    ids: Sequence[str] = ()


@dataclass(frozen=True)
class Terms:
    """Terms, or methods in code, and what they are.

    Attributes:
        rows: pairs of texts.
    """

    rows: Sequence[tuple[str, str]]


@dataclass(frozen=True)
class Detail:
    """Blocks behind a summary on a page that can unfold.

    Attributes:
        summary: words.
        blocks: what is behind it.
        printed: whether it is on paper, unfolded.
    """

    summary: str
    blocks: "Sequence[Block]"
    printed: bool = True


@dataclass(frozen=True)
class Viewer:
    """Plots that a reader looks into where the page's script runs, and the figures that stand for them elsewhere.

    Attributes:
        plots: for the script. A page has at most one of these blocks.
        still: the same on paper and without scripts.
    """

    plots: Plots
    still: Sequence[Picture]

    @property
    def hint(self) -> str:
        """How to look, for those who can."""
        return _HINT.format(map=" and map" if self.plots.has_map else "", parts=self.plots.buckets)


_HINT = (
    "Drag over a plot to zoom into the time, double-click for all; with Ctrl the wheel zooms plots{map}. From the "
    "keyboard: Tab to a plot, ← → move the cursor (with Shift faster), + − zoom, 0 shows all. Of each of {parts} equal "
    "parts of the time a curve keeps its least and greatest value, so no extreme is lost; what lies between is in the "
    "tables."
)


Block = str | Picture | Table | Terms | Detail | Viewer
"""A string is a paragraph, a list, a smaller heading or lines of code."""


@dataclass(frozen=True)
class Part:
    """A heading with text, figures and tables in their order.

    Attributes:
        id: of the heading, for links.
        heading: words.
        blocks: in their order; figures that follow each other stand side by side.
    """

    id: str
    heading: str
    blocks: Sequence[Block]


@dataclass(frozen=True)
class Page:
    """A result.

    Attributes:
        title: words.
        parts: what they rest on.
        made_with: names and versions.
        about: what it is of, below the title.
        headline: the one conclusion, in large letters below the title; its pieces may have colours.
    """

    title: str
    parts: Sequence[Part]
    made_with: str
    about: str = ""
    headline: Sequence[str] = ()


def html(page: Page) -> str:
    """The page as HTML that needs no network.

    >>> page = Page("A study", [Part("a", "Of what", ["None in `tc`."])], "bottomlock")
    >>> text = html(page)
    >>> "<h1>A study</h1>" in text, '<p>None in <span class="method"' in text, 'href="#a"' in text
    (True, True, True)
    """
    content = {
        "page": page,
        "parts": page.parts,
        "text": _html,
        "line": _line,
        "kind": kind_of,
        "plain": plain_text,
        "interactive": any(isinstance(block, Viewer) for part in page.parts for block in part.blocks),
    }
    return _render(content)


def kind_of(text: str) -> str:
    """The colour of a text, "" for none."""
    return getattr(text, "kind", text if text in VERDICTS else "")


def listed(lines: Sequence[str]) -> str:
    """A list in Markdown."""
    return "\n".join(f"- {line}" for line in lines)


def plain_text(marked: str) -> str:
    """A text without its marks.

    >>> plain_text("**`tc`**: 0.2 †<br>0.1–0.4")
    'tc: 0.2 † 0.1–0.4'
    """
    return re.sub(r"\*\*|`|\*", "", marked.replace("<br>", " "))


def _code(tokens: Sequence[Token], place: int, *_: object) -> str:
    """Code within a line; a method with its look."""
    name = tokens[place].content
    return str(method(name)) if name in STROKES else f"<code>{escape(name)}</code>"


_MARKDOWN = MarkdownIt("js-default")
_MARKDOWN.renderer.rules["code_inline"] = _code  # type: ignore[attr-defined]


def _html(marked: str) -> Markup:
    return Markup(_MARKDOWN.render(marked))  # noqa: S704 - the library escapes what is HTML in it


def _line(marked: str) -> Markup:
    """Words or a cell in HTML, its lines with a break between; a cell that is a name in code is a method."""
    name = re.fullmatch(r"`(\w+)`", marked)
    if name:
        return method(name[1])
    lines = (Markup(_MARKDOWN.renderInline(line)) for line in marked.split("<br>"))  # noqa: S704
    return Markup("<br>").join(lines)
