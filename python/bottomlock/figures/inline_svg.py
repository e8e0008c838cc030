"""A figure within a page: an SVG in the page's colours, without what nothing refers to."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from html import escape

from bottomlock.figures.palette import FAINT, INK, PAPER

_REFERENCE = re.compile(r"#([\w.-]+)")
_MOVED = re.compile(r"translate\((\S+?)(?: (\S+?))?\)")


def inline_svg(svg: str, name: str, words: str) -> str:
    """The SVG for a page: ids made unique, ink replaced by the colours of the page, background removed.

    Places are written in tenths of a point, and what nothing refers to is left out.

    Args:
        svg: from `palette.svg_text`.
        name: letters, digits and underscores, different for each figure of a page.
        words: what the figure shows, for screen readers.
    """
    top = ET.fromstring(svg[svg.index("<svg") :].replace("xlink:href", "href"))  # noqa: S314 - our own
    uses = {
        found
        for element in top.iter()
        for key, value in element.attrib.items()
        if key == "href" or "url(#" in value
        for found in _REFERENCE.findall(value)
    }
    ids = {one: f"{name}-{k}" for k, one in enumerate(sorted(uses))}
    glyphs = {one: f"{name}-{one}" for one in uses if "DejaVu" in one}
    box = f' viewBox="{top.attrib["viewBox"]}"' if "viewBox" in top.attrib else ""
    inside = "".join(part for child in top for part in _written(child, ids | glyphs))
    width = _natural_width(top.attrib.get("width", ""))
    return f'<svg role="img" aria-label="{escape(words)}"{width}{box}>{inside}</svg>'


def _natural_width(said: str) -> str:
    """The width in CSS pixels, so that a figure is shown at the size at which its letters are.

    >>> _natural_width("403.2pt"), _natural_width("")
    (' width="538"', '')
    """
    return f' width="{round(float(said.removesuffix("pt")) * 4.0 / 3.0)}"' if said.endswith("pt") else ""


def _written(element: ET.Element, ids: dict[str, str]) -> Iterator[str]:
    """An element and what it holds; of a group that says nothing, what it holds."""
    tag = element.tag.rpartition("}")[2]
    if tag == "metadata":
        return
    said = "".join(f' {key}="{escape(value)}"' for key, value in _attributes(tag, element.attrib, ids))
    inside = (element.text or "").strip() + "".join(
        part for child in element for part in _written(child, ids)
    )
    if tag in {"g", "defs"} and not (said and inside):
        yield inside if tag == "g" or not inside else f"<defs>{inside}</defs>"
    else:
        yield f"<{tag}{said}>{inside}</{tag}>" if inside else f"<{tag}{said}/>"


def _attributes(tag: str, given: dict[str, str], ids: dict[str, str]) -> Iterator[tuple[str, str]]:
    for key, value in given.items():
        if key == "id":
            if value in ids:
                yield key, ids[value]
        elif key == "d":
            yield key, " ".join(value.split())
        elif key == "style":
            yield key, _coloured(value)
        elif tag == "use" and key == "transform" and _MOVED.fullmatch(value):
            x, y = _MOVED.fullmatch(value).groups()  # type: ignore[union-attr]
            yield from (
                (axis, _tenths(one)) for axis, one in (("x", x), ("y", y or "0")) if float(one) != 0.0
            )
        elif key == "transform":
            yield key, _MOVED.sub(_moved, value)
        elif key in {"x", "y"}:
            yield key, _tenths(value)
        else:
            yield key, _REFERENCE.sub(lambda found: f"#{ids[found[1]]}", value) if "#" in value else value


def _moved(found: re.Match[str]) -> str:
    return f"translate({_tenths(found[1])} {_tenths(found[2] or '0')})"


def _tenths(number: str) -> str:
    """A number with one decimal.

    >>> _tenths("63.623047"), _tenths("0.04"), _tenths("12.0")
    ('63.6', '0', '12')
    """
    return f"{round(float(number), 1) + 0.0:g}" if abs(float(number)) < 1e5 else number


def _coloured(style: str) -> str:
    """A style without blanks, its ink and paper those of the page."""
    style = re.sub(r"([:;]) ", r"\1", style).replace(f"fill:{PAPER}", "fill:none")
    return style.replace(INK, "var(--ink)").replace(FAINT, "var(--faint)")
