"""Figures within a page: smaller, in the page's colours, and to the eye the same."""

from __future__ import annotations

import re

import matplotlib as mpl
import numpy as np
import pytest
from numpy.typing import NDArray

from bottomlock.figures.inline_svg import TOLERANCE_PT, compact_path, inline_svg
from bottomlock.figures.palette import STYLE, new_figure, svg_text
from bottomlock.pages.shared_svg import share_svg

Points = NDArray[np.float64]


def _drawn(data: str) -> Points:
    """The points (n, 2) of a path as `compact_path` writes it: one absolute, the others relative."""
    numbers = [float(one) for one in re.findall(r"-?(?:\d+\.?\d*|\.\d+)", data)]
    return np.asarray(np.cumsum(np.array(numbers).reshape(-1, 2), axis=0))


def _distance_to(points: Points, line: Points) -> Points:
    """Distance of each point (n,) from a broken line, by every stretch of it."""
    start, along = line[:-1], np.diff(line, axis=0)
    length = np.maximum((along**2).sum(axis=1), 1e-12)
    share = np.clip(((points[:, None] - start) * along).sum(axis=2) / length, 0.0, 1.0)
    return np.asarray(
        np.hypot(*np.moveaxis(points[:, None] - start - share[..., None] * along, 2, 0)).min(axis=1)
    )


@pytest.mark.parametrize("roughness", [0.0, 0.1, 3.0])
@pytest.mark.parametrize("turns", [0.0, 2.0])
def test_no_point_is_far_from_what_is_drawn(roughness: float, turns: float) -> None:
    """Of a smooth curve, a rough one, and one that turns back; a smooth one loses most of its points."""
    t = np.linspace(0.0, 1.0, 400)
    rng = np.random.default_rng(1)
    x = 300.0 * t if turns == 0.0 else 100.0 + 90.0 * np.cos(2.0 * np.pi * turns * t)
    y = 100.0 + 80.0 * np.sin(2.0 * np.pi * t) + roughness * rng.standard_normal(400)
    points = np.asarray(np.round(np.column_stack([x, y]), 1), dtype=np.float64)
    data = "M " + "\nL ".join(f"{a:.1f} {b:.1f}" for a, b in points) + "\n"
    drawn = _drawn(compact_path(data))
    assert _distance_to(points, drawn).max() <= TOLERANCE_PT + 1e-9
    np.testing.assert_allclose(drawn[[0, -1]], points[[0, -1]], atol=1e-9)
    assert len(drawn) < (120 if roughness == 0.0 else 400)


def test_curves_of_letters_keep_every_point() -> None:
    """Control points are relative to where the curve begins."""
    assert compact_path("M 1 2\nQ 3 4 5 6\nQ 7 8 9 10.5\nC 1 1 2 2 3 3\nz\n") == (
        "M1 2q2 2 4 4 2 2 4 4.5c-8-9.5-7-8.5-6-7.5z"
    )


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
