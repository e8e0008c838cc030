"""Figures within a page: in the page's colours, with ids of their own."""

from __future__ import annotations

import re

import matplotlib as mpl

from bottomlock.figures.inline_svg import inline_svg
from bottomlock.figures.palette import STYLE, new_figure, svg_text
from bottomlock.pages.page import share_svg


def _figure_svg(name: str) -> str:
    with mpl.rc_context(STYLE):
        figure = new_figure()
        axes = figure.add_subplot()
        axes.plot([0, 1, 2], [0, 1, 0], marker="o", color="#9233d2")
        axes.set_xlabel("time & σ, s")
    return inline_svg(svg_text(figure), name, 'a "b" <c> & d')


def test_ids_are_the_figures_own_and_all_are_used() -> None:
    text = _figure_svg("velocity_one")
    ids, uses = set(re.findall(r' id="([^"]+)"', text)), set(re.findall(r"#([\w-]+-[\w-]+)", text))
    assert ids
    assert ids == uses
    assert all(one.startswith("velocity_one-") for one in ids)
    assert 'aria-label="a &quot;b&quot; &lt;c&gt; &amp; d"' in text
    assert "var(--ink)" in text
    assert "#1b1f24" not in text


_REFERENCE = re.compile(r'href="#([^"]+)"|url\(#([^)]+)\)')


def test_every_figure_of_a_page_refers_to_what_it_did() -> None:
    """Clip paths and marks of its own, in their order, under other names."""
    pictures = [_figure_svg("one"), _figure_svg("two")]
    page = share_svg(f"<head></head><body><header></header>{''.join(pictures)}</body>")
    for before, after in zip(pictures, re.findall(r'<svg role="img".*?</svg>', page), strict=True):
        named = re.findall(r'(?:id="|#)((?:one|two)-\d+)', before)
        numbered = re.findall(r' id="(\.\d+)"', after)
        own = [one for one in re.findall(r'(?:id="|#)(\.\d+)', after) if one in numbered]
        assert len(named) == len(own) > 5
        assert len(set(zip(named, own, strict=True))) == len(set(named)) == len(set(own))


def test_figures_of_a_page_share_letters_and_styles() -> None:
    """Every reference is there once, and what each figure refers to is what it was."""
    pictures = [_figure_svg("one"), _figure_svg("two")]
    page = share_svg(f"<head></head><body><header></header>{''.join(pictures)}</body>")
    assert len(page) < 0.75 * sum(map(len, pictures))
    ids = re.findall(r' id="([^"]+)"', page)
    assert len(ids) == len(set(ids))
    assert {one for use in _REFERENCE.findall(page) for one in use if one} == set(ids)
    # A trajectory may have any of these letters in its name, and names a part of a page.
    assert not any(re.fullmatch(r"[\w-]+", one) for one in ids)
    assert ' style="' not in page
    classes = dict(re.findall(r"\.(s\d+) \{ (.*) \}", page))
    for picture in pictures:
        styles = re.findall(r' style="([^"]*)"', picture)
        assert set(styles) == set(classes.values())
    shown = re.findall(r' class="(s\d+)"', page)
    expected = [
        one for picture in pictures for one in re.findall(r' style="([^"]*)"', _without_letters(picture))
    ]
    assert [classes[one] for one in shown] == expected
    assert share_svg("<p>none</p>") == "<p>none</p>"


def _without_letters(picture: str) -> str:
    return re.sub(r'<path id="[^"]*DejaVu[^>]*/>', "", picture)
