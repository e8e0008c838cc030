"""Below each figure of a campaign are its files; the CSV holds what the figure draws, and every point of it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from polars.testing import assert_frame_equal

from bottomlock.files.records import write_recorded_table
from bottomlock.report.compare import compare
from bottomlock.report.drawings import Drawing, drawings
from bottomlock.report.page import make_report
from bottomlock.tables.campaign import CHOICES, COMPONENTS, PATHS
from bottomlock.tables.results import CampaignTables, read_campaign_tables
from bottomlock.tables.studies import CURRENT, SWEEP, VIRTUAL_BEAM_FACTOR
from bottomlock.tables.variants import COMPARISON
from tests.drawn_points import held, points
from tests.recorded import add_table
from tests.report.synthetic_campaign import METHODS, TIMES_S, write_campaign
from tests.undrawn import figures_undrawn

SECOND_NS = 1_000_000_000
ENDS = ("png", "svg", "pdf", "csv")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Drawing]]:
    """A campaign with everything that has a figure, its report, and the figures as they were handed to be drawn."""
    folder = write_campaign(
        tmp_path_factory.mktemp("files") / "c", _growing, runs=12, methods=[*METHODS, "elc"]
    )
    time_s = np.arange(0.0, 251.0)
    path = {"trajectory": ["straight"] * time_s.size, "time_ns": (time_s * 1e9).astype(np.int64)}
    place = {"north_m": 2.0 * time_s, "east_m": np.sin(time_s), "depth_m": 20.0 + time_s / 7.0}
    add_table(folder, "truth.parquet", pl.DataFrame(path | place, schema=dict(PATHS)))
    add_table(folder, "choices.parquet", _choices())
    rows = [
        (VIRTUAL_BEAM_FACTOR, "1", "straight", "vb", 14.0, 1.3, 3.9e6, 0.1),
        (VIRTUAL_BEAM_FACTOR, "10", "straight", "vb", 0.2, 1.3, 19.9, None),
        (CURRENT, "0", "straight", "tc", 0.3, 1.3, 20.1, None),
        (CURRENT, "0.3", "straight", "tc", 0.4, 1.3, 20.1, None),
    ]
    sweep = pl.DataFrame(rows, schema=dict(SWEEP), orient="row")
    write_recorded_table(folder / "sweep.parquet", sweep, {"configuration_hash": "0" * 64})
    kept: list[Drawing] = []

    def noted(*arguments: object) -> Iterator[Drawing]:
        for one in drawings(*arguments):  # type: ignore[arg-type]
            kept.append(one)
            yield one

    with figures_undrawn(), pytest.MonkeyPatch.context() as patch:
        patch.setattr("bottomlock.report.page.drawings", noted)
        make_report(folder)
    return folder, {one.name: one for one in kept}


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
def folder(made: tuple[Path, dict[str, Drawing]]) -> Path:
    return made[0]


@pytest.fixture(scope="module")
def drawn(made: tuple[Path, dict[str, Drawing]]) -> dict[str, Drawing]:
    return made[1]


@pytest.fixture(scope="module")
def campaign(folder: Path) -> CampaignTables:
    return read_campaign_tables(folder)


@pytest.fixture(scope="module")
def data(folder: Path, drawn: dict[str, Drawing]) -> dict[str, pl.DataFrame]:
    """The CSV files, read back."""
    return {
        name: pl.read_csv(folder / "figures" / f"{name}.csv", schema=one.data.schema)
        for name, one in drawn.items()
    }


def test_every_figure_links_its_four_files(folder: Path, drawn: dict[str, Drawing]) -> None:
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
    assert "lead to files beside it, and nowhere without these" in text


def test_the_data_come_back_to_the_last_digit(
    drawn: dict[str, Drawing], data: dict[str, pl.DataFrame]
) -> None:
    for name, one in drawn.items():
        assert one.data.height > 0, name
        assert_frame_equal(data[name], one.data, check_exact=True)


def corners(axes: Axes, place: int) -> set[tuple[float, float]]:
    """Of a filled area."""
    area = axes.collections[place]
    assert isinstance(area, PolyCollection)
    return set(map(tuple, np.concatenate([one.vertices for one in area.get_paths()]).tolist()))


def test_errors_draw_their_data_with_its_interval(
    drawn: dict[str, Drawing], data: dict[str, pl.DataFrame]
) -> None:
    """Points, diamonds of the paper, shaded intervals; each row with a value is a point."""
    for quantity, unit in (("velocity", "mps"), ("attitude", "deg")):
        name = f"{quantity}_straight"
        table, (axes,) = data[name], drawn[name].figure.axes
        value, low, high = (f"{quantity}_rms_over_runs_{end}{unit}" for end in ("", "lo_", "hi_"))
        paper = table.drop_nulls(f"printed_in_paper_{unit}")
        assert paper.height > 0
        assert table.height == len(TIMES_S) * table["method"].n_unique()
        # The paper's times are whole seconds.
        x = pl.concat([table["time_s"], paper["time_s"].round()])
        y = pl.concat([table[value], paper[f"printed_in_paper_{unit}"]])
        shown = points(axes)
        assert held(shown, x, y) == 1.0
        assert set(zip(x, y, strict=True)) == set(map(tuple, shown.tolist()))
        ends = {*table.select("time_s", low).rows(), *table.select("time_s", high).rows()}
        assert len(axes.collections) > 1
        for place in range(len(axes.collections)):
            assert corners(axes, place) <= ends


def test_nees_draws_its_data_with_the_band(drawn: dict[str, Drawing], data: dict[str, pl.DataFrame]) -> None:
    table, (axes,) = data["nees_straight"], drawn["nees_straight"].figure.axes
    assert set(map(tuple, points(axes).tolist())) == set(table.select("time_s", "nees_mean_over_runs").rows())
    (band,) = axes.patches
    box = band.get_extents().transformed(axes.transData.inverted())
    assert table.select("band_lo", "band_hi").unique().rows() == [pytest.approx((box.y0, box.y1))]


def test_calibration_draws_its_data_and_the_diagonal(
    drawn: dict[str, Drawing], data: dict[str, pl.DataFrame]
) -> None:
    table, (axes,) = data["calibration_straight"], drawn["calibration_straight"].figure.axes
    known = set(table.select("velocity_sd_rms_over_runs_mps", "velocity_rms_over_runs_mps").rows())
    shown = set(map(tuple, points(axes).tolist()))
    assert known < shown
    assert all(x == y for x, y in shown - known)
    assert len(shown - known) == 2
    assert table["time_s"].unique().sort().to_list() == pytest.approx(TIMES_S.tolist())


def test_panels_draw_their_method_and_the_others(
    drawn: dict[str, Drawing], data: dict[str, pl.DataFrame]
) -> None:
    """The file has every second of every method."""
    table, axes = data["methods_straight"], drawn["methods_straight"].figure.axes
    assert table.height == len(TIMES_S) * (len(METHODS) + 1)
    for panel in filter(lambda one: one.get_title("left"), axes):
        own = table.filter(method=panel.get_title("left"))
        line = panel.lines[-1]
        shown = np.column_stack([line.get_xdata(), line.get_ydata()])
        assert set(map(tuple, shown.tolist())) == set(
            own.select("time_s", "velocity_rms_over_runs_mps").rows()
        )
        assert held(points(panel), table["time_s"], table["velocity_rms_over_runs_mps"]) == 1.0


def test_normalised_errors_draw_their_data(drawn: dict[str, Drawing], data: dict[str, pl.DataFrame]) -> None:
    """A row of marks for each method, nine in each."""
    table, (axes,) = data["normalised_straight"], drawn["normalised_straight"].figure.axes
    for row, (method, own) in enumerate(table.group_by("method", maintain_order=True)):
        assert axes.get_yticklabels()[row].get_text() == method[0]
        assert own["component"].to_list() == list(COMPONENTS)
        shown = points(axes)
        assert set(shown[shown[:, 1] == row, 0].tolist()) == set(own["error_over_sd_rms"])


def test_selections_are_stacked_shares_of_the_data(
    drawn: dict[str, Drawing], data: dict[str, pl.DataFrame]
) -> None:
    """A source that no run chooses at a ping has zero there, as the figure draws it."""
    table = data["choices_straight"]
    assert table.filter(component="sway").rows() == [
        ("elc", "sway", "vb", SECOND_NS, 12, 1.0),
        ("elc", "sway", "vb", 2 * SECOND_NS, 9, 0.75),
        ("elc", "sway", "vb", 3 * SECOND_NS, 0, 0.0),
        ("elc", "sway", "nsv", SECOND_NS, 0, 0.0),
        ("elc", "sway", "nsv", 2 * SECOND_NS, 3, 0.25),
        ("elc", "sway", "nsv", 3 * SECOND_NS, 12, 1.0),
    ]
    assert table.filter(component="heave")["chosen_fraction"].to_list() == [1.0, 0.0, 0.0]
    axes = next(one for one in drawn["choices_straight"].figure.axes if one.get_title("left") == "elc: sway")
    assert corners(axes, 0) == {
        (t, y) for t, top in ((1.0, 1.0), (2.0, 0.75), (3.0, 0.0)) for y in (0.0, top)
    }
    assert corners(axes, 1) == {
        (t, y) for t, low in ((1.0, 1.0), (2.0, 0.75), (3.0, 0.0)) for y in (low, 1.0)
    }


def test_a_sweep_draws_its_data_and_its_level(
    drawn: dict[str, Drawing], data: dict[str, pl.DataFrame]
) -> None:
    """The level is the row without a value."""
    table, (axes,) = data["sweep_1_straight"], drawn["sweep_1_straight"].figure.axes
    assert table.filter(pl.col("value").is_null()).select("method", "velocity_rms_over_runs_mps").rows() == [
        ("tc", 0.3)
    ]
    assert any(set(np.asarray(line.get_ydata()).tolist()) == {0.3} for line in axes.lines)
    curve = table.drop_nulls("value")
    assert set(map(tuple, points(axes).tolist())) == {
        (float(place), y) for place, y in enumerate(curve["velocity_rms_over_runs_mps"])
    }
    assert [one.get_text() for one in axes.get_xticklabels()] == curve["value"].to_list() == ["1", "10"]
    assert data["sweep_2_straight"]["velocity_rms_over_runs_mps"].to_list() == [0.3, 0.4]


def test_trajectories_draw_their_data(
    drawn: dict[str, Drawing], data: dict[str, pl.DataFrame], campaign: CampaignTables
) -> None:
    table, (plan, depth) = data["trajectories"], drawn["trajectories"].figure.axes
    assert set(map(tuple, points(plan).tolist())) == set(table.select("east_m", "north_m").rows())
    assert set(map(tuple, points(depth).tolist())) == set(
        zip(table["time_ns"] * 1e-9, table["depth_m"], strict=True)
    )
    assert campaign.paths is not None
    assert_frame_equal(table, campaign.paths)


def test_campaigns_side_by_side_have_the_files_too(tmp_path: Path) -> None:
    """Drawn, not set up alone; the values are those of the comparison, and no file is linked twice."""
    for name in ("a", "b"):
        write_campaign(tmp_path / name, trajectories=["straight"], methods=["tc", "vb"], runs=4)
    made = compare([tmp_path / "a", tmp_path / "b"], tmp_path / "both")
    links = re.findall(r'<a href="(figures/[^"]+)">', made.page.read_text(encoding="utf-8"))
    paths = list((tmp_path / "both" / "figures").iterdir())
    assert sorted(links) == sorted(path.relative_to(tmp_path / "both").as_posix() for path in paths)
    starts = {".png": b"\x89PNG\r\n\x1a\n", ".svg": b"<?xml", ".pdf": b"%PDF-1.", ".csv": b"campaign,"}
    assert {path.suffix for path in paths} == set(starts)
    assert all(path.read_bytes().startswith(starts[path.suffix]) for path in paths)
    columns = ["campaign", "trajectory", "method", "quantity", "unit", "value", "lo", "hi"]
    schema = {name: COMPARISON[name] for name in columns}
    written = pl.concat(pl.read_csv(path, schema=schema) for path in paths if path.suffix == ".csv")
    expected = made.table.select(columns)
    assert_frame_equal(written.sort(columns[:4]), expected.sort(columns[:4]), check_exact=True)
