"""The one template, and how a method looks within it."""

import re
from functools import cache
from importlib.resources import files
from typing import Any

import jinja2
from markupsafe import Markup, escape

from bottomlock.figures.palette import stroke, swatch_svg
from bottomlock.pages.shared_svg import share_svg


def method(name: str) -> Markup:
    """A method with its look, and what it is where the pointer rests."""
    words, look = escape(stroke(name).words), swatch_svg(name)
    return Markup(f'<span class="method" title="{words}">{look}{escape(name)}</span>')  # noqa: S704 - numbers, colours


def compact_css(sheet: str) -> str:
    """A stylesheet without comments and needless blanks.

    >>> compact_css("a:hover { color: red; } /* none */ @media (x) and (y) { b > c { d: 0 1px } }")
    'a:hover{color: red}@media (x) and (y){b>c{d: 0 1px}}'
    """
    bare = re.sub(r"\s+", " ", re.sub(r"/\*.*?\*/", "", sheet, flags=re.DOTALL))
    return re.sub(r" ?([{};,>]) ?", r"\1", bare).replace(";}", "}").strip()


@cache
def _file(name: str) -> str:
    return files("bottomlock.pages").joinpath(name).read_text(encoding="utf-8")


def sheet(name: str) -> Markup:
    """A stylesheet of the package."""
    return Markup(compact_css(_file(name)))  # noqa: S704 - our own


def script(name: str) -> Markup:
    """A script or licence of the package as it is."""
    return Markup(_file(name))  # noqa: S704 - our own


def render(content: dict[str, Any]) -> str:
    """The template with its content, as text; what its figures have in common stands in it once."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("bottomlock.pages"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    template = environment.get_template("page.html.j2")
    return share_svg(template.render(content | {"sheet": sheet, "script": script, "markup": Markup}))
