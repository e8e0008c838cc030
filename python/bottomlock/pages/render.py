"""The packaged templates, rendered in one environment with the same filters for all."""

from typing import Any

import jinja2
from markupsafe import Markup

from bottomlock.figures.palette import stroke, swatch_svg
from bottomlock.pages.numbers import number
from bottomlock.pages.shared_svg import share_svg

HOME = "bottomlock.pages"


def render(template: str, content: dict[str, Any], *, package: str = HOME) -> str:
    """A template of a package's folder `templates`, or of this one's, with its content, as text.

    The templates use the filters `number` (three significant digits), `swatch` (the look of a method),
    `words` (a line on it) and `title` (a name with underscores as a title).
    """
    environment = jinja2.Environment(
        loader=jinja2.ChoiceLoader([jinja2.PackageLoader(package), jinja2.PackageLoader(HOME)]),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["number"] = number
    environment.filters["swatch"] = lambda method: Markup(swatch_svg(method))  # noqa: S704 - numbers and colours
    environment.filters["words"] = lambda method: stroke(method).words
    environment.filters["title"] = lambda name: str(name).replace("_", " ").capitalize()
    return share_svg(environment.get_template(template).render(content))
