"""Below each figure of a replay's page are its files; the CSV holds what the figure draws, and every point of it."""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from polars.testing import assert_frame_equal

from bottomlock.figures.drawn_table import panels_table
from bottomlock.figures.series import Curve, Panel
from bottomlock.replay.case import load_case
from bottomlock.replay.dive_plots import state_panels
from bottomlock.replay.report import PAGE, Drawing, ReplayTables, dive_of, drawings, read_replay
from bottomlock.replay.run_and_report import run_and_report
from tests.drawn_points import held, points

CASE = Path(__file__).parents[2] / "data" / "logs" / "survey_dive" / "case.toml"
DAY_NS = 86_400e9


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """More methods than the first figures show, so that some are folded."""
    out = tmp_path_factory.mktemp("files") / "dive"
    methods = ["ins", "lc", "tc", "info", "weak_sway", "sway_current"]
    run_and_report(load_case(CASE).with_overrides(methods=methods), out)
    return out


@pytest.fixture(scope="module")
def tables(folder: Path) -> ReplayTables:
    return read_replay(folder)


@pytest.fixture(scope="module")
def drawn(tables: ReplayTables) -> dict[str, Drawing]:
    return {one.name: one for one in drawings(tables, dive_of(tables))}


@pytest.fixture(scope="module")
def data(folder: Path, drawn: dict[str, Drawing]) -> dict[str, pl.DataFrame]:
    """The CSV files, read back."""
    return {
        name: pl.read_csv(folder / "figures" / f"{name}.csv", schema=one.data.schema)
        for name, one in drawn.items()
    }


def test_every_figure_has_four_files_and_every_link_leads_to_one(
    folder: Path, drawn: dict[str, Drawing]
) -> None:
    """And no file is without a link: what opens as which."""
    links = set(re.findall(r'<a href="(figures/[^"]+)">', (folder / PAGE).read_text(encoding="utf-8")))
    assert links == {f"figures/{name}.{end}" for name in drawn for end in ("png", "svg", "pdf", "csv")}
    assert links == {path.relative_to(folder).as_posix() for path in (folder / "figures").iterdir()}
    starts = {".png": b"\x89PNG\r\n\x1a\n", ".svg": b"<?xml", ".pdf": b"%PDF-1."}
    for link in links:
        path = folder / link
        assert path.read_bytes().startswith(starts.get(path.suffix, b""))
        assert path.stat().st_size > 100
    page = (folder / PAGE).read_text(encoding="utf-8")
    assert "lead to files beside it, and nowhere without these" in page


def test_the_data_come_back_to_the_last_digit(
    drawn: dict[str, Drawing], data: dict[str, pl.DataFrame]
) -> None:
    for name, one in drawn.items():
        assert one.data.height > 0, name
        assert_frame_equal(data[name], one.data, check_exact=True)


def test_a_map_draws_points_of_its_data(drawn: dict[str, Drawing], data: dict[str, pl.DataFrame]) -> None:
    """All but the start's dot, which is one of them too, and the scale bar's two ends."""
    for name in ("map_recorded", "map_lost_34", "map_recorded_all_methods"):
        shown = points(drawn[name].figure.axes[0])
        kept = held(shown, data[name]["east_m"], data[name]["north_m"])
        assert kept >= 1.0 - 2.0 / len(shown)


def test_a_map_has_every_point_of_the_table(tables: ReplayTables, data: dict[str, pl.DataFrame]) -> None:
    rows = tables.samples.filter(what_if="lost_34", method="tc", **{"pass": "smoothed"})
    kept = data["map_lost_34"].filter(track="tc, smoothed")
    for column in ("time_ns", "north_m", "east_m"):
        assert kept[column].to_list() == rows[column].to_list()
    assert data["map_lost_34"].filter(track="tc")["beams_lost"].min() == 2.0
    assert data["map_lost_34"].filter(track="reference").height > 1000


def test_curves_draw_points_of_their_data(
    tables: ReplayTables, drawn: dict[str, Drawing], data: dict[str, pl.DataFrame]
) -> None:
    """Panel by panel, also those that the drawing thins."""
    table, panels = data["timeline"], state_panels(tables.samples.filter(what_if="recorded"), "tc")
    time_d = pl.Series(table["time_ns"].to_numpy() / DAY_NS)
    for axes in drawn["timeline"].figure.axes:
        own = [name for name in table.columns if name.startswith(f"{axes.get_title('left')}: ")]
        shown = points(axes)
        assert len(shown) > 10
        known = pl.concat(pl.DataFrame({"time": time_d, "value": table[name]}) for name in own)
        assert held(shown, known["time"], known["value"]) == 1.0
    assert {panel.title for panel in panels} < {name.rsplit(": ", 1)[0] for name in table.columns}
    rows = tables.samples.filter(what_if="recorded", method="tc", **{"pass": "forward"})
    kept = table.filter(pl.col("time_ns").is_in(rows["time_ns"].to_list()))
    assert kept["surge, m/s: tc"].to_list() == rows["surge_mps"].to_list()
    assert kept["surge, m/s: tc, σ"].to_list() == rows["sd_velocity_surge_mps"].to_list()


def test_two_readings_of_one_time_are_both_kept() -> None:
    """And curves with other times leave gaps."""
    time_ns = np.array([10, 20, 20, 30])
    twice = Curve("a", "red", time_ns, np.array([1.0, 2.0, 3.0, np.nan]), sd=np.array([0.1, 0.2, 0.3, 0.4]))
    other = Curve("b", "red", np.array([20, 40]), np.array([5.0, 6.0]))
    table = panels_table([Panel("x, m", [twice, other])])
    assert table.rows() == [
        (10, 1.0, 0.1, None), (20, 2.0, 0.2, 5.0), (20, 3.0, 0.3, None), (30, None, 0.4, None), (40, None, None, 6.0)
    ]  # fmt: skip
    assert table.columns == ["time_ns", "x, m: a", "x, m: a, σ", "x, m: b"]


@pytest.mark.parametrize("end", ["", "_all_methods"])
def test_nis_and_errors_draw_points_of_their_data(
    drawn: dict[str, Drawing], data: dict[str, pl.DataFrame], tables: ReplayTables, end: str
) -> None:
    start_ns = int(tables.samples["time_ns"].min())  # type: ignore[arg-type]
    nis = data[f"nis_lost_34{end}"]
    (axes,) = drawn[f"nis_lost_34{end}"].figure.axes
    assert held(points(axes), (nis["time_ns"] - start_ns) * 1e-9, nis["nis_ratio"]) == 1.0
    (low,), (high,) = (nis[name].unique().round(12).to_list()[-1:] for name in ("band_lo", "band_hi"))
    assert low < 1.0 < high
    errors = data[f"errors_forward_lost_34{end}"]
    for axes, (quantity, unit) in zip(
        drawn[f"errors_forward_lost_34{end}"].figure.axes,
        (("position", "m"), ("velocity", "mps"), ("attitude", "deg")),
        strict=True,
    ):
        both = pl.concat(
            errors.select("time_s", value=f"{quantity}_{kind}_over_runs_{unit}") for kind in ("rms", "sd_rms")
        )
        assert held(points(axes), both["time_s"], both["value"]) == 1.0


def test_innovations_draw_points_of_their_data(
    drawn: dict[str, Drawing], data: dict[str, pl.DataFrame], tables: ReplayTables
) -> None:
    start_ns = int(tables.samples["time_ns"].min())  # type: ignore[arg-type]
    table = data["innovations_recorded"]
    for k, axes in enumerate(drawn["innovations_recorded"].figure.axes):
        value = table[f"beam{k + 1}_innovation_mps"]
        assert held(points(axes), (table["time_ns"] - start_ns) * 1e-9, value) == 1.0
    assert table.height == tables.innovations.filter(what_if="recorded", method="tc").height


def test_valid_beams_are_those_of_the_pings(tables: ReplayTables, data: dict[str, pl.DataFrame]) -> None:
    flags = [f"beam{k}_valid" for k in (1, 2, 3, 4)]
    assert_frame_equal(data["validity"], tables.pings.select("what_if", "time_ns", *flags))
    assert not data["validity"].select(flags).to_numpy().all()


def test_the_same_tables_give_the_same_bytes(folder: Path, tables: ReplayTables) -> None:
    """A PDF holds no time of its making."""
    from bottomlock.figures.palette import pdf_bytes

    again = next(one for one in drawings(tables, dive_of(tables)) if one.name == "nis_recorded")
    assert (folder / "figures" / "nis_recorded.pdf").read_bytes() == pdf_bytes(again.figure)
    text = (folder / "figures" / "nis_recorded.csv").read_bytes()
    assert pl.read_csv(io.BytesIO(text)).write_csv().encode() == text
