"""What the site is laid out from: links, tables, downloads; and the code of the tutorials."""

import re
from pathlib import Path

import pytest
from PIL import Image

from tools import build_site
from tools.site_screenshots import SHOTS


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
    assert build_site.outward(root / "docs" / "survey.md", text) == written


def test_every_table_is_documented() -> None:
    """With its columns, types and meaning, from the package itself."""
    page = build_site.tables()
    assert "### RUNS\n" in page
    assert "| `velocity_final_mps` | Float64 |" in page
    assert page.count("| Column | Type |") > 15


def test_every_example_is_on_a_page(root: Path) -> None:
    """In the gallery or among the explanations, in the list and in the tree."""
    pages = [
        (root / "docs" / name / "index.md").read_text(encoding="utf-8") for name in ("gallery", "explanation")
    ]
    for script in build_site.examples():
        assert any(f"examples/{script.name})" in page for page in pages)
        assert any(re.search(rf"^(\.\./gallery/)?{script.stem}$", page, re.MULTILINE) for page in pages)


def test_the_navigators_of_the_tutorial_run(
    root: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """One by names on a recorded dive, and one by hand: at rest it says so, within what it claims."""
    monkeypatch.chdir(root)
    page = (root / "docs" / "tutorials" / "ins.md").read_text(encoding="utf-8")
    ten_lines, example = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert len([line for line in ten_lines.splitlines() if line]) == 9
    exec(compile(ten_lines, "ins.md", "exec"), {})
    assert "<Navigator at " in capsys.readouterr().out
    names: dict[str, object] = {}
    exec(compile(example, "ins.md", "exec"), names)
    assert "m/s" in capsys.readouterr().out
    velocity, sd = names["state"]["velocity_p_mps"], names["velocity_sd_mps"]  # type: ignore[index]
    assert (abs(velocity) < 4.0 * sd).all()  # type: ignore[operator]


def pictures(text: str) -> list[dict[str, str]]:
    """The pictures of a page with a figure for each scheme: `light`, `dark`, `alt`."""
    return [match.groupdict() for match in build_site._PICTURE.finditer(text)]


def test_every_picture_has_both_schemes_and_words(root: Path) -> None:
    """A figure of README and docs/ is a picture of two files of one size and its words; each file is shown."""
    shown: set[Path] = set()
    for page in [root / "README.md", *(root / "docs").rglob("*.md")]:
        text = page.read_text(encoding="utf-8")
        found = pictures(text)
        assert text.count("<picture>") == len(found), page
        assert not re.search(r"!\[[^\]]*\]\([^)]*figures/", text), page
        for one in found:
            light, dark = (page.parent / one[scheme] for scheme in ("light", "dark"))
            assert dark.name == light.name.replace("_light.", "_dark.")
            assert size_of(light) == size_of(dark), light
            assert len(one["alt"]) > 40
            shown |= {light.resolve(), dark.resolve()}
    assert shown == set((root / "docs" / "figures").iterdir())


def size_of(figure: Path) -> tuple[str, str]:
    """Width and height of an SVG, width of a PNG: a page in the other scheme may wrap a line elsewhere."""
    if figure.suffix == ".png":
        with Image.open(figure) as image:
            return str(image.width), ""
    head = figure.read_text(encoding="utf-8")
    width, height = re.findall(r'<svg[^>]* width="([^"]+)" height="([^"]+)"', head)[0]
    return width, height


def test_screenshots_are_small(root: Path) -> None:
    """At most 150 kB each; those that the command takes and no others."""
    taken = {path.name: path.stat().st_size for path in (root / "docs" / "figures").glob("*.png")}
    assert set(taken) == {f"page_{name}_{scheme}.png" for name in SHOTS for scheme in ("light", "dark")}
    assert max(taken.values()) < 150_000


def test_every_figure_of_an_example_has_words(root: Path) -> None:
    """For those who do not see it: the metadata of the cell that shows it."""
    for script in build_site.examples(root):
        cells = re.split(r"^# %%(.*)\n", script.read_text(encoding="utf-8"), flags=re.MULTILINE)
        shown = [head for head, body in zip(cells[1::2], cells[2::2], strict=True) if "plt.show()" in body]
        assert shown, script
        for head in shown:
            assert re.search(r'^ mystnb=\{"image": \{"alt": "[^"]{30,}"\}\}$', head), f"{script}: {head}"
