"""Pages in a real browser: nothing is cut off, the keyboard reaches everything, paper shows what is folded."""

from collections.abc import Iterator
from pathlib import Path

import polars as pl
import pytest

from bottomlock.figures.palette import new_figure
from bottomlock.files.columns import CURRENT, SWEEP, VIRTUAL_BEAM_FACTOR
from bottomlock.files.records import write_recorded_table
from bottomlock.pages.page import Detail, Page, Part, Pictures, Table, html
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
    part = Part("cells", "Cells", ["A line of text.", *pictures, Detail("cells", [cells])])
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
