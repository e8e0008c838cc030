"""A figure within a page: an SVG in the page's colours, with ids of its own."""

import re
from html import escape

from bottomlock.figures.palette import FAINT, INK, PAPER

_HEAD = re.compile(r"<svg[^>]*>")
_NAMED = re.compile(r'(?<= id=")[^"]+|(?<=href="#)[^"]+|(?<=url\(#)[^)]+')
_METADATA = re.compile(r"<metadata>.*?</metadata>\s*", re.DOTALL)


def inline_svg(svg: str, name: str, caption: str) -> str:
    """The SVG for a page: ids made unique, ink replaced by the colours of the page, background removed.

    Args:
        svg: from `palette.svg_text`.
        name: letters, digits and underscores, different for each figure of a page.
        caption: what the figure shows, for screen readers.
    """
    head = _HEAD.search(svg)
    assert head is not None  # an SVG
    inside = _METADATA.sub("", svg[head.end() :])
    inside = _NAMED.sub(lambda match: f"{name}-{match[0]}", inside).replace("xlink:href", "href")
    inside = inside.replace(f"fill: {PAPER}", "fill: none").replace(INK, "var(--ink)")
    box = re.search(r' viewBox="[^"]*"', head[0])
    width = _natural_width(head[0])
    return (
        f'<svg role="img" aria-label="{escape(caption)}"{width}{box[0] if box else ""}>'
        f"{inside.replace(FAINT, 'var(--faint)').strip()}"
    )


def _natural_width(head: str) -> str:
    """The width in CSS pixels, so that a figure is shown at the size at which its letters are.

    >>> _natural_width('<svg width="403.2pt">'), _natural_width("<svg>")
    (' width="538"', '')
    """
    said = re.search(r' width="([\d.]+)pt"', head)
    return "" if said is None else f' width="{round(float(said[1]) * 4.0 / 3.0)}"'
