"""The report is made from the tables alone, is one page, and says what is wrong with a directory."""

from __future__ import annotations

import hashlib
import itertools
import re
import shutil
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import matplotlib as mpl
import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bottomlock.errors import DataError, OutputError
from bottomlock.figures import palette
from bottomlock.figures.labels import Line, draw_lines, spread
from bottomlock.files.records import write_recorded_table
from bottomlock.kernel import METHODS as KERNEL_METHODS
from bottomlock.own_method import DEAD_RECKONING
from bottomlock.pages.featured import MOST, featured
from bottomlock.report.page import make_report
from bottomlock.statistics.rms import Array
from bottomlock.statistics.run_errors import read_run_errors
from bottomlock.tables.results import read_campaign_tables
from bottomlock.tables.studies import SWEEP
from tests.recorded import add_table, edit_record
from tests.report.synthetic_campaign import METHODS, edit_manifest, write_campaign


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with everything that a campaign may have, and its report."""
    folder = write_campaign(
        tmp_path_factory.mktemp("campaign") / "c", methods=[*METHODS, "quite_new"], runs=12
    )
    time_s = np.arange(0.0, 251.0)
    paths = pl.DataFrame(
        {
            "trajectory": ["straight"] * time_s.size,
            "time_ns": (time_s * 1e9).astype(np.int64),
            "north_m": 2.0 * time_s,
            "east_m": 0.0 * time_s,
            "depth_m": 0.0 * time_s,
        }
    )
    add_table(folder, "truth.parquet", paths)
    sweep = pl.DataFrame(
        [("virtual_beam_factor", "10", "straight", "vb", 0.1, 1.3, 19.9, None)],
        schema=dict(SWEEP),
        orient="row",
    )
    write_recorded_table(folder / "sweep.parquet", sweep, {"configuration_hash": "0" * 64})
    make_report(folder)
    return folder


STARTS = {"png": b"\x89PNG\r\n\x1a\n", "svg": b"<?xml"}
"""Endings of a figure's files, and how these begin."""


def files(folder: Path) -> dict[str, str]:
    """Hash of everything that a report writes."""
    names = [folder / "report.html", *folder.glob("figures/*"), *folder.glob("tables/*")]
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in names}


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


def test_writes_figures_and_claims(made: Path) -> None:
    for path in (made / "figures").iterdir():
        assert path.read_bytes().startswith(STARTS[path.suffix[1:]])
    assert pl.read_parquet(made / "tables" / "claims.parquet").height > 30


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


@pytest.mark.long
def test_same_tables_same_bytes(made: Path, tmp_path: Path) -> None:
    """In another directory and at another time."""
    copy = tmp_path / "elsewhere"
    shutil.copytree(made, copy, ignore=shutil.ignore_patterns("report.html", "figures", "tables"))
    make_report(copy)
    assert files(copy) == files(made)


@pytest.mark.usefixtures("undrawn")
def test_without_truth_and_sweep(tmp_path: Path) -> None:
    """They are a campaign's to have or not; one trajectory and two methods make a report as well."""
    folder = write_campaign(tmp_path / "c", trajectories=["lawn_mower"], methods=["ins", "tc"], runs=2)
    report = make_report(folder)
    text = report.page.read_text(encoding="utf-8")
    assert "no truth.parquet" in text
    assert 'id="sweep"' not in text
    assert report.figures == 6


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


def _without_column(folder: Path) -> None:
    path = folder / "chunks" / "straight" / "samples-00000000-00000003.parquet"
    pl.read_parquet(path).drop("nees").write_parquet(path)
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
        (
            lambda folder: edit_manifest(folder, lambda m: m["scenarios"]["straight"].pop("runs")),
            "scenario 'straight' lacks 'runs'",
        ),
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
        (_damage("chunks/straight/record-00000000-00000003.json"), "cannot be read as JSON"),
        (_fewer_rows, "expected 4 runs × 3 methods × 51 times"),
        (_without_column, "nees"),
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


@pytest.mark.usefixtures("undrawn")
def test_a_place_that_cannot_be_written(tmp_path: Path) -> None:
    folder = write_campaign(tmp_path / "c", trajectories=["straight"], methods=["ins", "tc"], runs=2)
    (folder / "figures").write_text("in the way")
    with pytest.raises(OutputError, match="figures"):
        make_report(folder)


@given(st.lists(st.tuples(st.floats(0.0, 1.0), st.sampled_from([0.04, 0.08])), min_size=1, max_size=13))
def test_labels_never_overlap(wanted: list[tuple[float, float]]) -> None:
    """Wherever the lines end, names stand apart, in the lines' order, and inside the margin."""
    heights = [height for _, height in wanted]
    places = spread([place for place, _ in wanted], heights, -0.05, 1.05)
    order = sorted(range(len(wanted)), key=lambda k: places[k])
    room = min(1.0, 1.1 / sum(heights))
    for below, above in itertools.pairwise(order):
        assert places[above] - places[below] >= room * 0.5 * (heights[above] + heights[below]) - 1e-9
        assert wanted[below][0] <= wanted[above][0]
    assert min(places) >= -0.05
    assert max(places) <= 1.05


def _linear(colour: str) -> Array:
    channels = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
    return np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)


def _luminance(colour: str) -> float:
    return float(_linear(colour) @ [0.2126, 0.7152, 0.0722])


# How much of linear red, green and blue an eye sees: Machado, Oliveira and Fernandes 2009, severity 1.
EYES = {
    "all three cones": np.eye(3),
    "no green cones": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "no red cones": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
}


def _lab(linear: Array) -> Array:
    """CIE 1976 L*a*b* under D65; a difference of 1 can just be told side by side."""
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    part = to_xyz @ np.clip(linear, 0.0, 1.0) / np.array([0.9505, 1.0, 1.089])
    root = np.where(part > 0.008856, np.cbrt(part), 7.787 * part + 16.0 / 116.0)
    return np.array([116.0 * root[1] - 16.0, 500.0 * (root[0] - root[1]), 200.0 * (root[1] - root[2])])


@pytest.mark.parametrize("eye", EYES)
def test_methods_stay_apart_for_every_eye(eye: str) -> None:
    """Those that the first figures show together by 19 and more, any two by 14, also without red or green cones."""
    seen = {method: _lab(EYES[eye] @ _linear(look.colour)) for method, look in palette.STROKES.items()}
    together = {
        pair
        for best in ("tc", "sway_current", "consistent")
        for pair in itertools.combinations(featured(list(KERNEL_METHODS), [best]), 2)
    }
    assert len(together) > 10
    for one, other in itertools.combinations(seen, 2):
        least = 19.0 if (one, other) in together or (other, one) in together else 14.0
        assert np.linalg.norm(seen[one] - seen[other]) >= least, (one, other)


def test_no_two_methods_share_a_dash_or_a_marker() -> None:
    """Colour is never the only difference: on a grey printer every method is still told apart."""
    looks = [*palette.STROKES.values(), palette.stroke("a method of one's own")]
    assert len({str(look.dash) for look in looks}) == len(looks)
    assert len({look.marker for look in looks}) == len(looks)
    swatches = {palette.swatch_svg(method) for method in palette.STROKES}
    bare = {re.sub("#[0-9a-f]{6}", "", swatch) for swatch in swatches}
    assert len(bare) == len(palette.STROKES)


def test_curves_wear_the_look_of_their_method() -> None:
    """Dash and marker of the table reach the figure, with few marks, and not at one place for all."""
    time_s = np.arange(250.0)
    with mpl.rc_context(palette.STYLE):
        axes = palette.new_figure().add_subplot()
        draw_lines(axes, [Line((method,), time_s, time_s) for method in palette.STROKES])
    starts = set()
    for line, (_, look) in zip(axes.lines, palette.STROKES.items(), strict=True):
        assert line.get_marker() == look.marker
        assert (line.get_linestyle() == "-") == (look.dash == "-")
        places = line.get_markevery()
        assert isinstance(places, tuple)
        start, step = places
        assert 4 <= 250 // step <= 6
        starts.add(start)
    assert len(starts) == len(palette.STROKES)


@pytest.mark.parametrize("recommended", [[], ["consistent"], ["vhv", "tc"]])
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
    assert len({look.words for look in palette.STROKES.values()}) == len(palette.STROKES)
