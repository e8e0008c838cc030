"""The report is made from the tables alone, is one page, and says what is wrong with a directory."""

import re
import shutil
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from bottomlock.errors import DataError
from bottomlock.figures import palette
from bottomlock.files.campaign_tables import read_campaign_tables
from bottomlock.files.records import write_recorded_table
from bottomlock.kernel import METHODS as KERNEL_METHODS
from bottomlock.own_method import DEAD_RECKONING
from bottomlock.pages.pieces import MOST, featured
from bottomlock.report.page import make_report
from bottomlock.statistics.rms import Array
from bottomlock.statistics.run_errors import read_run_errors
from tests.recorded import add_table, edit_record
from tests.report.synthetic_campaign import METHODS, edit_manifest, write_campaign, write_whole
from tests.undrawn import figures_undrawn


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with everything that a campaign may have, and its report."""
    folder = write_whole(tmp_path_factory.mktemp("campaign") / "c", [*METHODS, "quite_new"])
    with figures_undrawn(but_svg=True):
        make_report(folder)
    return folder


class _Page(HTMLParser):
    """Collects what a self-contained page may not have twice, or at all."""

    def __init__(self) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.links: list[str] = []
        self.tags: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        for name, value in attrs:
            if name == "id":
                self.ids.append(value or "")
            if name in {"href", "src", "xlink:href"}:
                self.links.append(value or "")


def test_the_page_stands_alone(made: Path) -> None:
    """No script, no address outside but the figures' files, no link to nowhere, no id twice."""
    page = _Page()
    text = (made / "report.html").read_text(encoding="utf-8")
    page.feed(text)
    assert "script" not in page.tags
    assert len(re.findall('<svg role="img"', text)) == 20
    assert len(page.ids) == len(set(page.ids))
    outside = [link for link in page.links if not link.startswith("#")]
    assert sorted(outside) == sorted(f"figures/{path.name}" for path in (made / "figures").iterdir())
    assert {link.removeprefix("#") for link in page.links} - set(outside) <= set(page.ids)
    assert set(re.findall(r"url\(#([^)]+)\)", text)) <= set(page.ids)
    assert "@import" not in text
    assert not re.search(r"url\((?!#)", text)


def test_the_page_says_what_it_found(made: Path) -> None:
    """Every claim's verdict, and no number that is none."""
    text = (made / "report.html").read_text(encoding="utf-8")
    table = pl.read_parquet(made / "tables" / "claims.parquet")
    for row in table.iter_rows(named=True):
        section = text.split(f'<tr id="{row["claim"]}">')[1].split("</tr>")[0]
        assert row["verdict"] in section
    assert "nan" not in re.sub(r"<svg.*?</svg>", "", text, flags=re.DOTALL).lower().split("manifest.json")[0]


def test_the_page_takes_the_readers_colours(made: Path) -> None:
    """Ink and paper of the figures are the page's, so that a dark page has no white boxes and no black text."""
    text = (made / "report.html").read_text(encoding="utf-8")
    assert "prefers-color-scheme: dark" in text
    figures = "".join(re.findall(r"<svg.*?</svg>", text, flags=re.DOTALL))
    assert palette.INK not in figures
    assert palette.PAPER not in figures


def test_errors_are_read_back_run_by_run(tmp_path: Path) -> None:
    """Cut into chunks or not, with chunks of a smaller campaign beside them: the same errors in the same order."""
    whole = write_campaign(tmp_path / "a", runs=12, chunks=1)
    cut = write_campaign(tmp_path / "b", runs=12, chunks=3)
    folder = cut / "chunks" / "straight"
    shutil.copy(folder / "samples-00000004-00000007.parquet", folder / "samples-00000004-00000006.parquet")
    errors = [read_run_errors(read_campaign_tables(place), "straight") for place in (whole, cut)]
    for method in METHODS:
        np.testing.assert_array_equal(errors[0].velocity_mps[method], errors[1].velocity_mps[method])
        np.testing.assert_allclose(
            errors[0].normalised_rms[method], errors[1].normalised_rms[method], rtol=1e-12
        )
    assert errors[0].velocity_mps["ins"].shape[0] == 12


def _damage(name: str) -> Callable[[Path], object]:
    return lambda folder: (folder / name).write_bytes(b"not a table")


def _fewer_rows(folder: Path) -> None:
    path = folder / "chunks" / "straight" / "samples-00000000-00000003.parquet"
    pl.read_parquet(path).head(-1).write_parquet(path)
    edit_record(path.with_name("record-00000000-00000003.json"))


def _other_methods(folder: Path) -> None:
    path = folder / "ensemble.parquet"
    pl.read_parquet(path).filter(pl.col("method") != "tc").write_parquet(path)
    edit_record(folder / "manifest.json")


def _stranger(folder: Path) -> None:
    path = folder / "runs.parquet"
    frame = pl.read_parquet(path)
    pl.concat([frame, frame.with_columns(trajectory=pl.lit("elsewhere"))]).write_parquet(path)
    edit_record(folder / "manifest.json")


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (shutil.rmtree, "no such directory"),
        (lambda folder: (folder / "manifest.json").unlink(), "holds no campaign"),
        (lambda folder: (folder / "manifest.json").write_text("{}"), "manifest.json: has no 'own_digest'"),
        (_damage("manifest.json"), "cannot be read as JSON"),
        (
            lambda folder: edit_manifest(folder, lambda m: m.update(version="0.0.1")),
            "of version 0.0.1 and this is",
        ),
        (lambda folder: edit_manifest(folder, lambda m: m.update(status="running")), "is not finished"),
        (lambda folder: (folder / "ensemble.parquet").unlink(), "ensemble.parquet: is missing"),
        (_damage("runs.parquet"), "runs.parquet: has changed since it was written"),
        (_damage("sweep.parquet"), "sweep.parquet: is not stated by the records of this campaign"),
        (
            lambda folder: write_recorded_table(
                folder / "sweep.parquet", pl.DataFrame(), {"configuration_hash": 1}
            ),
            "sweep.record.json: is of another campaign",
        ),
        (
            lambda folder: add_table(folder, "truth.parquet", pl.DataFrame({"north_m": [0.0]})),
            "truth.parquet: column 'trajectory' is missing",
        ),
        (_other_methods, "ensemble.parquet: trajectory 'straight' has the methods"),
        (_stranger, "runs.parquet: trajectory 'elsewhere' is not in the manifest"),
        (
            lambda folder: (folder / "chunks" / "straight" / "samples-00000004-00000007.parquet").unlink(),
            "samples-00000004-00000007.parquet: is missing",
        ),
        (
            lambda folder: shutil.rmtree(folder / "chunks"),
            "samples-00000000-00000003.parquet: its chunk has no",
        ),
        (_damage("chunks/straight/samples-00000000-00000003.parquet"), "has changed since it was written"),
        (_fewer_rows, "expected 4 runs × 3 methods × 51 times"),
    ],
)
def test_a_spoilt_directory_is_named(tmp_path: Path, spoil: Callable[[Path], object], message: str) -> None:
    """One line that names the file and what is wrong; nothing is written."""
    folder = write_campaign(tmp_path / "c", trajectories=["straight"], methods=["ins", "tc", "nsv"], runs=8)
    spoil(folder)
    with pytest.raises(DataError, match=re.escape(message)) as caught:
        make_report(folder)
    assert "\n" not in str(caught.value)
    assert str(folder) in str(caught.value)
    assert not (folder / "report.html").exists()
    assert not (folder / "figures").exists()


def _linear(colour: str) -> Array:
    channels = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
    return np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)


def _luminance(colour: str) -> float:
    return float(_linear(colour) @ [0.2126, 0.7152, 0.0722])


def test_no_two_methods_share_a_dash_or_a_marker() -> None:
    """Colour is never the only difference: on a grey printer every method is still told apart."""
    looks = [*palette.STROKES.values(), palette.stroke("a method of one's own")]
    assert len({str(look.dash) for look in looks}) == len(looks)
    assert len({look.marker for look in looks}) == len(looks)
    swatches = {palette.swatch_svg(method) for method in palette.STROKES}
    bare = {re.sub("#[0-9a-f]{6}", "", swatch) for swatch in swatches}
    assert len(bare) == len(palette.STROKES)


@pytest.mark.parametrize("recommended", [[], ["elc"], ["vhv", "tc"]])
def test_the_first_figures_show_five_methods(recommended: list[str]) -> None:
    """The recommended one and one's own are among them; a smaller campaign is shown whole."""
    shown = featured([*KERNEL_METHODS, "mine"], recommended)
    assert len(shown) == MOST == 5
    assert {"mine", *recommended[:1]} <= set(shown)
    assert featured(["ins", "plcf"], recommended) == ["ins", "plcf"]


@pytest.mark.parametrize("method", sorted(palette.STROKES))
def test_colours_read_on_white_and_on_black(method: str) -> None:
    """Contrast of 3 and more, what WCAG asks of graphics, on paper and on the dark page."""
    own = _luminance(palette.stroke(method).colour)
    assert 1.05 / (own + 0.05) >= 3.0
    assert (own + 0.05) / (_luminance("#12161b") + 0.05) >= 3.0


def test_every_method_has_its_colour_and_its_words() -> None:
    """No two the same; a method that the kernel gains has to get both."""
    looks = [look.colour for look in palette.STROKES.values()]
    assert len(set(looks)) == len(looks)
    assert {*KERNEL_METHODS, DEAD_RECKONING} == set(palette.STROKES)
    assert len({look.meaning for look in palette.STROKES.values()}) == len(palette.STROKES)
