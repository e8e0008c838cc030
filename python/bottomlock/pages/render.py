"""The packaged templates, rendered in one environment with the same filters for all."""

from typing import Any

import jinja2
from markupsafe import Markup, escape

from bottomlock.figures.palette import stroke, swatch_svg
from bottomlock.pages.numbers import number
from bottomlock.pages.shared_svg import share_svg


def method(name: str) -> Markup:
    """A method with its look, and what it is where the pointer rests."""
    words, look = escape(stroke(name).words), swatch_svg(name)
    return Markup(f'<span class="method" title="{words}">{look}{escape(name)}</span>')  # noqa: S704 - numbers, colours


def render(template: str, content: dict[str, Any]) -> str:
    """A template of the folder `templates` with its content, as text.

    The templates use `method` (its look and name), and the filters `number` (three significant digits), `words` (a line
    on a method) and `title` (a name with underscores as a title).
    """
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("bottomlock.pages"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["number"] = number
    environment.filters["words"] = lambda name: stroke(name).words
    environment.globals["method"] = method
    environment.filters["title"] = lambda name: str(name).replace("_", " ").capitalize()
    return share_svg(environment.get_template(template).render(content))
