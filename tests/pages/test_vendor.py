"""The library is the one that it says it is; a page that has it keeps its licence and loads nothing."""

import hashlib
import re
from importlib.resources import files

import pytest

from bottomlock.figures.palette import new_figure
from bottomlock.pages.page import Page, Part, Pictures, Viewer, html
from tests.pages.test_plots import plots

SHA256 = {
    "uPlot.iife.min.js": "2d27e8ad3d228164525ce213f9dc716f39b4e3aee0cc773fb3491c96cf4921a2",
    "uPlot.min.css": "df630c6a8d6f8eeaff264b50f73ce5b114f646ffd9a0bb74f049b0a00135fa04",
}
FOLDER = files("bottomlock.pages") / "vendor" / "uplot"
CALLS = (
    r"\bfetch\s*\(|XMLHttpRequest|WebSocket|EventSource|sendBeacon|importScripts"
    r"|\bimport\s*\(|\beval\s*\(|new Function"
)


@pytest.mark.parametrize("name", SHA256)
def test_files_are_unchanged(name: str) -> None:
    assert hashlib.sha256((FOLDER / name).read_bytes()).hexdigest() == SHA256[name]


def test_version_and_provenance_agree() -> None:
    (version,) = re.findall(r"^/\*! https://github.com/leeoniya/uPlot \(v([\d.]+)\) \*/", script())
    assert f"# uPlot {version}\n" in (FOLDER / "PROVENANCE.md").read_text(encoding="utf-8")


def script() -> str:
    return (FOLDER / "uPlot.iife.min.js").read_text(encoding="utf-8")


def page(*, looked: bool) -> str:
    picture = Pictures().add(new_figure(), "one", "Nothing.")
    block = Viewer(plots(), [picture]) if looked else picture
    return html(Page("A dive", [Part("dive", "The dive", [block])], "hands"))


def test_page_has_the_licence_and_loads_nothing() -> None:
    text = page(looked=True)
    assert (FOLDER / "LICENSE").read_text(encoding="utf-8").strip() in text
    assert script().strip() in text
    assert re.findall(r"""(?:src|href|action|data)\s*=\s*["'](?:https?:)?//""", text) == []
    assert re.findall(r"@import|url\(\s*['\"]?(?!#)", text.partition("<body>")[0]) == []
    for code in re.findall(r"<script>(.*?)</script>", text, flags=re.DOTALL):
        assert re.findall(CALLS, code) == []
    assert "default-src 'none'" in text


def test_page_without_plots_has_no_script() -> None:
    text = page(looked=False)
    assert "<script" not in text
    assert "script-src" not in text
    assert "uPlot" not in text
