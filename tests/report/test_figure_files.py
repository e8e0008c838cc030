"""Below each figure of a campaign are its files, and it draws the campaign's tables."""

import re
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from bottomlock.figures.palette import figure_files
from bottomlock.files.campaign_tables import CampaignTables, read_campaign_tables
from bottomlock.files.columns import CHOICES, CURRENT, VIRTUAL_BEAM_FACTOR
from bottomlock.files.overwriting import Files
from bottomlock.report.page import make_report
from bottomlock.statistics.claims import ValueClaim, load_paper
from bottomlock.statistics.run_errors import read_run_errors
from tests.drawn_points import points
from tests.recorded import add_table
from tests.report.synthetic_campaign import METHODS, TIMES_S, write_whole
from tests.undrawn import figures_undrawn

SECOND_NS = 1_000_000_000
ENDS = ("png", "svg")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Figure]]:
    """A campaign with everything that has a figure, its report, and the figures as they were handed to be drawn."""
    rows = (
        (VIRTUAL_BEAM_FACTOR, "1", "straight", "vb", 14.0, 1.3, 3.9e6, 0.1),
        (CURRENT, "0", "straight", "tc", 0.3, 1.3, 20.1, None),
        (CURRENT, "0.3", "straight", "tc", 0.4, 1.3, 20.1, None),
    )
    folder = write_whole(tmp_path_factory.mktemp("files") / "c", [*METHODS, "elc"], _growing, *rows)
    add_table(folder, "choices.parquet", _choices())
    kept: dict[str, Figure] = {}

    def noted(figure: Figure, stem: str) -> Files:
        kept[stem.removeprefix("figures/")] = figure
        return figure_files(figure, stem)

    with figures_undrawn(), pytest.MonkeyPatch.context() as patch:
        patch.setattr("bottomlock.pages.page.figure_files", noted)
        make_report(folder)
    return folder, kept


def rows_of(table: pl.DataFrame, column: str) -> set[tuple[float, float]]:
    """Times, whole nanoseconds in s, and values."""
    return set(table.select(pl.col("time_s").round(9), column).rows())


def _growing(
    _: str, method: str, time_s: np.ndarray[tuple[int], np.dtype[np.float64]]
) -> tuple[object, object]:
    """Every method errs otherwise, so that no two curves coincide."""
    own = 1.0 + [*METHODS, "elc"].index(method)
    return 0.1 * own * (1.0 + time_s / 100.0), 0.3 * own + time_s / 1000.0


def _choices() -> pl.DataFrame:
    """Two sources, of which one is chosen in no run at first; and the reason, which no figure shows."""
    rows = [
        ("straight", "elc", SECOND_NS, "sway", "vb", 12),
        ("straight", "elc", 2 * SECOND_NS, "sway", "vb", 9),
        ("straight", "elc", 2 * SECOND_NS, "sway", "nsv", 3),
        ("straight", "elc", 3 * SECOND_NS, "sway", "nsv", 12),
        ("straight", "elc", SECOND_NS, "heave", "plcf", 12),
        ("straight", "elc", SECOND_NS, "reason", "least", 12),
    ]
    return pl.DataFrame(rows, schema=dict(CHOICES), orient="row")


@pytest.fixture(scope="module")
def folder(made: tuple[Path, dict[str, Figure]]) -> Path:
    return made[0]


@pytest.fixture(scope="module")
def drawn(made: tuple[Path, dict[str, Figure]]) -> dict[str, Figure]:
    return made[1]


@pytest.fixture(scope="module")
def campaign(folder: Path) -> CampaignTables:
    return read_campaign_tables(folder)


def test_every_figure_links_its_two_files(folder: Path, drawn: dict[str, Figure]) -> None:
    """Below the figure itself, and no file is without a link."""
    text = (folder / "report.html").read_text(encoding="utf-8")
    figures = re.findall("<figure.*?</figure>", text, re.DOTALL)
    assert len(figures) == len(drawn) == 22
    for one in figures:
        (name,) = set(re.findall(r'<a href="figures/(\w+)\.\w+">', one))
        assert re.findall(r'<a href="(.*?)">(\w+)</a>', one) == [
            (f"figures/{name}.{end}", end.upper()) for end in ENDS
        ]
    assert {path.name for path in (folder / "figures").iterdir()} == {
        f"{name}.{end}" for name in drawn for end in ENDS
    }


def corners(axes: Axes, place: int) -> set[tuple[float, float]]:
    """Of a filled area."""
    area = axes.collections[place]
    assert isinstance(area, PolyCollection)
    return set(map(tuple, np.concatenate([one.vertices for one in area.get_paths()]).tolist()))


def test_errors_draw_the_ensemble_with_its_interval(
    drawn: dict[str, Figure], campaign: CampaignTables
) -> None:
    """Points, rings of the paper, shaded intervals."""
    printed = {(one.time_s, one.printed) for one in load_paper().claim if isinstance(one, ValueClaim)}
    for quantity, unit in (("velocity", "mps"), ("attitude", "deg")):
        table, (axes,) = (
            campaign.ensemble.filter(trajectory="straight"),
            drawn[f"{quantity}_straight"].axes,
        )
        value, low, high = (f"{quantity}_rms_over_runs_{end}{unit}" for end in ("", "lo_", "hi_"))
        shown = set(map(tuple, points(axes).tolist()))
        known = rows_of(table, value)
        assert shown - known
        assert shown - known <= printed
        assert len(shown & known) >= 3 * len(TIMES_S)
        ends = rows_of(table, low) | rows_of(table, high)
        assert len(axes.collections) > 1
        for place in range(len(axes.collections)):
            assert corners(axes, place) <= ends


def test_nees_draws_the_ensemble_with_the_band(drawn: dict[str, Figure], campaign: CampaignTables) -> None:
    (axes,) = drawn["nees_straight"].axes
    known = rows_of(campaign.ensemble.drop_nulls("nees_mean_over_runs"), "nees_mean_over_runs")
    assert set(map(tuple, points(axes).tolist())) <= known
    (band,) = axes.patches
    box = band.get_extents().transformed(axes.transData.inverted())
    stated = campaign.consistency.filter(quantity="nees").select("band_lo", "band_hi").unique().rows()
    assert stated == [pytest.approx((box.y0, box.y1))]


def test_every_method_is_drawn_once_more(drawn: dict[str, Figure], campaign: CampaignTables) -> None:
    """All methods in one figure, and error over σ of each in its nine components."""
    table = campaign.ensemble.filter(trajectory="straight")
    (axes,) = drawn["methods_straight"].axes
    known = rows_of(table, "velocity_rms_over_runs_mps")
    assert set(map(tuple, points(axes).tolist())) == known
    (axes,) = drawn["normalised_straight"].axes
    errors = read_run_errors(campaign, "straight").normalised_rms
    rows = [np.asarray(line.get_ydata(), dtype=float) for line in axes.lines]
    shown = np.concatenate([row for row in rows if len(row) == 9])
    assert sorted(shown.tolist()) == sorted(
        np.concatenate([errors[method] for method in [*METHODS, "elc"]]).tolist()
    )


def test_selections_are_stacked_shares_of_the_choices(drawn: dict[str, Figure]) -> None:
    """A source that no run chooses at a ping has zero there."""
    axes = next(one for one in drawn["choices_straight"].axes if one.get_title("left") == "elc: sway")
    assert corners(axes, 0) == {
        (t, y) for t, top in ((1.0, 1.0), (2.0, 0.75), (3.0, 0.0)) for y in (0.0, top)
    }
    assert corners(axes, 1) == {
        (t, y) for t, low in ((1.0, 1.0), (2.0, 0.75), (3.0, 0.0)) for y in (low, 1.0)
    }


def test_a_sweep_draws_its_rows_and_the_level_of_tc(drawn: dict[str, Figure]) -> None:
    (axes,) = drawn["sweep_1_straight"].axes
    assert any(set(np.asarray(line.get_ydata()).tolist()) == {0.3} for line in axes.lines)
    assert set(map(tuple, points(axes).tolist())) == {(0.0, 14.0), (1.0, 0.2), (0.0, 0.3), (1.0, 0.3)}
    assert [one.get_text() for one in axes.get_xticklabels()] == ["1", "10"]


def test_trajectories_draw_the_truth(drawn: dict[str, Figure], campaign: CampaignTables) -> None:
    """And two ends of a scale bar."""
    table, (plan, depth) = campaign.paths, drawn["trajectory_straight"].axes
    assert table is not None
    shown, known = set(map(tuple, points(plan).tolist())), set(table.select("east_m", "north_m").rows())
    assert known < shown
    assert len(shown - known) == 2
    assert set(map(tuple, points(depth).tolist())) == set(
        zip(table["time_ns"].to_numpy() / 1e9, table["depth_m"], strict=True)
    )
