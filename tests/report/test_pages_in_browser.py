"""Pages in a real browser: nothing is cut off, the keyboard reaches everything, paper shows what is folded."""

import itertools
from collections.abc import Iterator
from pathlib import Path

import polars as pl
import pytest

from bottomlock.figures.palette import new_figure
from bottomlock.files.columns import CURRENT, SWEEP, VIRTUAL_BEAM_FACTOR
from bottomlock.files.records import write_recorded_table
from bottomlock.pages.page import Page, Part, Pictures, Table, folded, html
from bottomlock.report.compare import compare
from bottomlock.report.page import make_report
from tests.browser import CUT_OFF, WIDTHS, Browser, chromium
from tests.report.synthetic_campaign import write_campaign

pytestmark = [pytest.mark.skipif(chromium() is None, reason="no Chromium"), pytest.mark.slow]


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with Browser() as opened:
        yield opened


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two campaigns with every method of the kernel; the first has a sweep."""
    top = tmp_path_factory.mktemp("pages")
    methods = ["ins", "lc", "tc", "vb", "nsv", "sway_current", "quite_a_long_name_of_ones_own"]
    for name in ("a", "b"):
        write_campaign(top / name, trajectories=["straight"], methods=methods, runs=4)
    rows = [
        (VIRTUAL_BEAM_FACTOR, "1", "straight", "vb", 14.0, 1.3, 3.9e6, 0.1),
        (VIRTUAL_BEAM_FACTOR, "10", "straight", "vb", 0.2, 1.3, 19.9, None),
        (CURRENT, "0", "straight", "tc", 0.3, 1.3, 20.1, None),
    ]
    sweep = pl.DataFrame(rows, schema=dict(SWEEP), orient="row")
    write_recorded_table(top / "a" / "sweep.parquet", sweep, {"configuration_hash": "0" * 64})
    make_report(top / "a")
    compare([top / "a", top / "b"], top / "both")
    pictures = [
        Pictures().add(new_figure(), name, "Nothing.", kind) for name, kind in (("one", "wide"), ("two", ""))
    ]
    cells = Table(
        ["Method", *(f"beams {k}" for k in range(15))],
        [["`tc`", *("12.3 ▲" for _ in range(15))]],
        "A table with more columns than a telephone has room for.",
    )
    part = Part("cells", "Cells", ["A line of text.", *pictures, folded(cells)])
    page = Page("A study", [part], "hands", about="of one")
    (top / "sheet.html").write_text(html(page), encoding="utf-8")
    return top


@pytest.mark.first_cases(3)
@pytest.mark.parametrize("page", ["a/report.html", "both/compare.html", "sheet.html"])
@pytest.mark.parametrize("width", WIDTHS)
def test_nothing_is_cut_off(browser: Browser, folder: Path, page: str, width: int) -> None:
    """With everything unfolded no element is wider than the window, and none hides a part until it is scrolled."""
    browser.size(width)
    browser.open(folder / page)
    assert browser.value(CUT_OFF) == []


def test_the_check_sees_what_is_cut_off(browser: Browser, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text(
        '<!doctype html><meta name="viewport" content="width=device-width">'
        '<div style="overflow-x: auto"><p style="width: 900px">wide</p></div>'
    )
    browser.size(390)
    browser.open(page)
    found = browser.value(CUT_OFF)
    assert any(line.startswith("P#") for line in found)
    assert any(line.startswith("DIV#") for line in found)


def test_the_keyboard_reaches_and_unfolds(browser: Browser, folder: Path) -> None:
    """First the way past the contents, shown where it is; focus is outlined; Enter opens what is folded."""
    browser.size(1100)
    browser.open(folder / "a" / "report.html")
    browser.press("Tab")
    assert browser.value("document.activeElement.textContent") == "Skip to the results"
    assert browser.value("document.activeElement.getBoundingClientRect().left") >= 0.0
    for _ in range(60):
        browser.press("Tab")
        if browser.value("document.activeElement.tagName") == "SUMMARY":
            break
    assert browser.value("getComputedStyle(document.activeElement).outlineStyle") == "solid"
    browser.press("Enter")
    assert browser.value("document.activeElement.parentElement.open") is True


def test_a_screen_reader_is_told(browser: Browser, folder: Path) -> None:
    """Landmarks, one first heading and no level left out, a name for every figure, table and link."""
    browser.size(1100)
    browser.open(folder / "a" / "report.html")
    levels = browser.value("[...document.querySelectorAll('h1, h2, h3, h4')].map(one => +one.tagName[1])")
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after <= before + 1 for before, after in itertools.pairwise(levels))
    assert browser.value("[...document.querySelectorAll('table')].filter(one => !one.caption).length") == 0
    roles: dict[str, list[str]] = {}
    for node in browser.accessible():
        role = node.get("role", {}).get("value")
        if not node["ignored"]:
            roles.setdefault(role, []).append(str(node.get("name", {}).get("value", "")))
    for landmark in ("banner", "navigation", "main", "contentinfo"):
        assert len(roles[landmark]) == 1, landmark
    assert len(roles["image"]) >= 5
    for role in ("image", "table", "link", "region"):
        assert all(roles[role]), role


def test_paper_is_white_and_shows_what_is_folded(browser: Browser, folder: Path) -> None:
    """Also for a reader of dark pages; settings, manifest and links to files stay off the paper."""
    browser.open(folder / "a" / "report.html")
    browser.media(dark=True)
    dark = browser.value("getComputedStyle(document.body).backgroundColor")
    browser.media(dark=True, paper=True)
    try:
        assert (
            dark != browser.value("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
        )
        for hidden in ("nav", "details.long", "figure .files"):
            assert browser.value(f"getComputedStyle(document.querySelector({hidden!r})).display") == "none"
        height = "document.querySelector('details:not(.long)').getBoundingClientRect().height"
        on_paper = browser.value(height)
        browser.media()
        assert on_paper > 1.5 * browser.value(height)
    finally:
        browser.media()
