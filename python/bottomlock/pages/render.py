"""The one template, how a method looks within it, and what its figures have in common."""

import re
from functools import cache
from importlib.resources import files
from typing import Any

import jinja2
from markupsafe import Markup, escape

from bottomlock.figures.palette import stroke, swatch_svg


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


_PICTURE = re.compile(r'<svg role="img".*?</svg>', re.DOTALL)
_GLYPH = re.compile(r'<path id="[\w-]+?-(DejaVu[\w.-]+)"(.*?)/>')
_GLYPH_USE = re.compile(r'href="#[\w-]+?-(DejaVu[\w.-]+)"')
_ID = re.compile(r'(?<= id=")[\w-]+')
_USE = re.compile(r'(?<=href="#)[\w-]+|(?<=url\(#)[\w-]+')
_STYLE = re.compile(r' style="([^"]*)"')
_OWN_SHEET = re.compile(r"<style[^>]*>.*?</style>", re.DOTALL)


def share_svg(page: str) -> str:
    """A page whose figures refer to one set of letters and to classes in place of styles, by numbers in place of names.

    A page without figures stays as it is.
    """
    pictures = _PICTURE.findall(page)
    if not pictures:
        return page
    outlines: dict[str, str] = {}
    for picture in pictures:
        outlines |= dict(_GLYPH.findall(picture))
    own = dict.fromkeys(one for picture in pictures for one in _ID.findall(_GLYPH.sub("", picture)))
    # No name of a part of a page has a dot.
    letters = {glyph: f".{k}" for k, glyph in enumerate(outlines)}
    ids = {one: f".{k}" for k, one in enumerate(own, start=len(letters))}
    words = dict.fromkeys(style for picture in pictures for style in _STYLE.findall(picture))
    styles = {style: f"s{k}" for k, style in enumerate(words)}
    sheets = dict.fromkeys(sheet for picture in pictures for sheet in _OWN_SHEET.findall(picture))

    def shared(found: re.Match[str]) -> str:
        text = _OWN_SHEET.sub("", _GLYPH.sub("", found[0]))
        text = _GLYPH_USE.sub(lambda use: f'href="#{letters[use[1]]}"', text)
        text = _USE.sub(lambda use: ids[use[0]], _ID.sub(lambda one: ids[one[0]], text))
        text = _STYLE.sub(lambda style: f' class="{styles[style[1]]}"', text)
        return text.replace("<defs></defs>", "")

    defined = "".join(f'<path id="{letters[glyph]}"{outlines[glyph]}/>' for glyph in outlines)
    rules = "\n".join(f".{name} {{ {style} }}" for style, name in styles.items())
    common = f'<svg class="shared" aria-hidden="true" width="0" height="0"><defs>{defined}</defs></svg>'
    page = _PICTURE.sub(shared, page)
    page = page.replace("</head>", f"{''.join(sheets)}\n<style>\n{rules}\n</style>\n</head>", 1)
    return page.replace("</header>", f"</header>\n{common}", 1)
