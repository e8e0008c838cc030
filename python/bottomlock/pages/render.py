"""The one template, and how a method looks within it."""

from typing import Any

import jinja2
from markupsafe import Markup, escape

from bottomlock.figures.palette import stroke, swatch_svg
from bottomlock.pages.shared_svg import share_svg


def method(name: str) -> Markup:
    """A method with its look, and what it is where the pointer rests."""
    words, look = escape(stroke(name).words), swatch_svg(name)
    return Markup(f'<span class="method" title="{words}">{look}{escape(name)}</span>')  # noqa: S704 - numbers, colours


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
    return share_svg(environment.get_template("page.html.j2").render(content))
