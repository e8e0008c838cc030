"""Figures within a page: in the page's colours, with ids of their own."""

import re
import warnings
from xml.etree import ElementTree as ET

import matplotlib as mpl
import matplotlib.pyplot as plt

from bottomlock.figures.palette import (
    FAINT,
    INK,
    PAPER,
    STYLE,
    inline_svg,
    new_figure,
    shown_figure,
    svg_text,
)

_ID = re.compile(r' id="([^"]+)"')
_REFERENCE = re.compile(r'href="#([^"]+)"|url\(#([^)]+)\)')


def _uses(text: str) -> set[str]:
    """What a figure refers to."""
    return {one for found in _REFERENCE.findall(text) for one in found if one}


def _figure_svg(name: str) -> str:
    with mpl.rc_context(STYLE):
        figure = new_figure()
        axes = figure.add_subplot()
        axes.plot([0, 1, 2], [0, 1, 0], marker="o", color="#9233d2")
        axes.set_xlabel("time & σ, s")
    return inline_svg(svg_text(figure), name, 'a "b" <c> & d')


def test_ids_are_the_figures_own() -> None:
    text = _figure_svg("velocity_one")
    ids, uses = set(_ID.findall(text)), _uses(text)
    assert uses
    assert uses <= ids
    assert all(one.startswith("velocity_one-") for one in ids)
    assert 'aria-label="a &quot;b&quot; &lt;c&gt; &amp; d"' in text


def test_ink_is_that_of_the_page_and_the_background_is_gone() -> None:
    text = _figure_svg("one")
    assert "var(--ink)" in text
    assert "var(--faint)" in text
    assert not re.search(f"{INK}|{FAINT}|fill: {PAPER}", text)
    assert "#9233d2" in text
    assert "<metadata" not in text
    assert ET.fromstring(text).attrib["width"] == "538"


def test_axes_stay_where_they_are_put() -> None:
    """Also where a user's matplotlib places axes by itself, which would warn of axes that it cannot move."""
    with mpl.rc_context({"figure.constrained_layout.use": True}), warnings.catch_warnings():
        warnings.simplefilter("error")
        with mpl.rc_context(STYLE):
            figure = new_figure()
        figure.add_axes((0.1, 0.1, 0.8, 0.8))
        assert svg_text(figure) == svg_text(figure)
        shown = shown_figure((3.0, 2.0))
    assert shown.get_layout_engine() is None
    plt.close(shown)
