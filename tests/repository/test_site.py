"""What the site is laid out from: links, tables, downloads; and the code of the tutorials."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from tools import build_site


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("[us](../CONTRIBUTING.md#style)", f"[us]({build_site.REPOSITORY}CONTRIBUTING.md#style)"),
        ("[x](keys.md#scenario) [y](https://x.org/a)", "[x](keys.md#scenario) [y](https://x.org/a)"),
        ("[page](../examples/slope.py)", "[page](gallery/slope.py)"),
        ("`[c](../Makefile)`", "`[c](../Makefile)`"),
        ("[gone](../nothing.md)", "[gone](../nothing.md)"),
    ],
)
def test_links_out_of_docs_lead_to_the_repository(root: Path, text: str, written: str) -> None:
    """Examples are pages of the gallery; code, pages beside and what is not there stay as they are."""
    assert build_site.outward(root / "docs" / "masks.md", text) == written


def test_every_table_is_documented() -> None:
    """With its columns, types and meaning, from the package itself."""
    page = build_site.tables()
    assert "### RUNS\n" in page
    assert "| `velocity_final_mps` | Float64 |" in page
    assert page.count("| Column | Type |") > 15


def test_an_example_is_offered_in_two_forms(root: Path) -> None:
    script = root / "examples" / "slope.py"
    text = script.read_text(encoding="utf-8")
    page = build_site.with_downloads(script, text)
    assert "](../plant.md)" in page
    assert "../docs/" not in page
    assert "_downloads/slope.ipynb" in page


def test_broken_links_within_the_site_count(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What is outside is told and does not fail, since it may be away for a day."""
    link = {"filename": "masks.md", "lineno": 3, "status": "broken", "info": "404"}
    found = [
        link | {"uri": "https://x.org"},
        link | {"uri": "gone.md"},
        link | {"uri": "a", "status": "working"},
    ]
    report = tmp_path / "output.json"
    report.write_text("\n".join(map(json.dumps, found)), encoding="utf-8")
    assert build_site.broken_links(report) == 1
    assert "3 links, 1 broken within the site, 1 outside not reached" in capsys.readouterr().out


def test_every_example_is_on_a_page(root: Path) -> None:
    """In the gallery or among the explanations, in the list and in the tree."""
    pages = [
        (root / "docs" / name / "index.md").read_text(encoding="utf-8") for name in ("gallery", "explanation")
    ]
    for script in build_site.examples():
        assert any(f"examples/{script.name})" in page for page in pages)
        assert any(re.search(rf"^(\.\./gallery/)?{script.stem}$", page, re.MULTILINE) for page in pages)


def test_the_navigator_of_the_tutorial_runs(root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """At rest it says so, within what it claims."""
    page = (root / "docs" / "tutorials" / "ins.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    names: dict[str, object] = {}
    exec(compile(example, "ins.md", "exec"), names)
    assert "m/s" in capsys.readouterr().out
    velocity, sd = names["state"]["velocity_p_mps"], names["velocity_sd_mps"]  # type: ignore[index]
    assert (abs(velocity) < 4.0 * sd).all()  # type: ignore[operator]
