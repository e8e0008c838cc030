"""The dive on a page in a real browser, from disk: hover, zoom, cursor, paper, no scripts, no requests, size."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from bottomlock.replay.report import PAGE, report_files
from tests.browser import CUT_OFF, WIDTHS, Browser, chromium
from tests.replay.dive_tables import SPIKE_MPS, SPIKE_S, dive_tables

pytestmark = [pytest.mark.skipif(chromium() is None, reason="no Chromium"), pytest.mark.slow]

READY = "document.getElementById('plots').dataset.ready === 'yes'"
PANELS = "document.querySelectorAll('.canvas')"


def write(folder: Path, seconds: float, rate_hz: float) -> Path:
    text = report_files(dive_tables(seconds, rate_hz))[PAGE]
    assert isinstance(text, str)
    page = folder / PAGE
    page.write_text(text, encoding="utf-8")
    return page


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A minute at 5 Hz."""
    return write(tmp_path_factory.mktemp("dive"), 60.0, 5.0)


@pytest.fixture(scope="module")
def tab() -> Iterator[Browser]:
    with Browser() as opened:
        yield opened


@pytest.fixture
def browser(tab: Browser) -> Browser:
    """As a reader begins."""
    tab.size(1280)
    tab.media()
    tab.scripts(allowed=True)
    return tab


def look(browser: Browser, page: Path) -> None:
    browser.open(page)
    browser.wait(READY)


def area(browser: Browser, panel: int) -> tuple[float, float, float, float]:
    """Where the values of a panel are drawn: left, top, width, height in the window, after it was scrolled there."""
    browser.value(f"{PANELS}[{panel}].scrollIntoView({{block: 'center', behavior: 'instant'}})")
    box = f"{PANELS}[{panel}].querySelector('.u-over').getBoundingClientRect()"
    left, top, width, height = (
        float(browser.value(f"{box}.{side}")) for side in ("left", "top", "width", "height")
    )
    return left, top, width, height


def readout(browser: Browser, panel: int) -> str:
    return str(browser.value(f"document.querySelectorAll('.column .panel')[{panel}].innerText"))


def hover(browser: Browser, panel: int, part: float) -> None:
    left, top, width, height = area(browser, panel)
    browser.mouse((left + 5.0, top + height / 2.0), (left + part * width, top + height / 2.0))


def cursors(browser: Browser) -> list[float]:
    """Where the line of the cursor stands in each panel, as a part of its width."""
    script = (
        f"[...{PANELS}].map(one => new DOMMatrix(getComputedStyle(one.querySelector('.u-cursor-x')).transform).m41"
        " / one.querySelector('.u-over').clientWidth)"
    )
    return [float(one) for one in browser.value(script)]


def text_of(browser: Browser, selector: str) -> str:
    return str(browser.value(f"document.querySelector({selector!r}).textContent"))


def seconds_of(browser: Browser) -> float:
    """The time of the cursor after the start."""
    found = re.search(r"\(([\d.]+) s\)", text_of(browser, ".at"))
    assert found
    return float(found[1])


def test_hover_shows_the_values_of_that_time_everywhere(browser: Browser, page: Path) -> None:
    """At the one sample of the spike; the other panels, the clock and the map follow."""
    look(browser, page)
    hover(browser, 3, SPIKE_S / 59.8)
    assert f"{SPIKE_MPS:.3f} ± 0.01" in readout(browser, 0)
    assert re.search(r"tc 2\d\.\d\d", readout(browser, 4))
    assert seconds_of(browser) == pytest.approx(SPIKE_S, abs=0.11)
    # 1 767 225 610 s is 00:00:10 UTC on the first of January 2026.
    assert text_of(browser, ".at").startswith("00:00:4")
    assert "2026-01-01 00:00:10 to 00:01:10 UTC" in text_of(browser, ".range")
    where = cursors(browser)
    assert len(where) == 9
    assert max(where) - min(where) < 0.005
    assert where[0] == pytest.approx(SPIKE_S / 59.8, abs=0.005)


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("dark", [False, True])
def test_nothing_is_cut_off_and_figures_are_of_natural_size(
    browser: Browser, page: Path, width: int, dark: bool
) -> None:
    browser.size(width)
    browser.media(dark=dark)
    look(browser, page)
    hover(browser, 0, 0.5)
    assert browser.value(CUT_OFF) == []
    stretched = (
        "[...document.querySelectorAll('figure svg')].filter(one => one.clientWidth > 1 + "
        "Number(one.getAttribute('width'))).length"
    )
    assert browser.value(stretched) == 0
