"""Below each figure of a replay's page are its files, and it draws the replay's tables."""

from pathlib import Path

import polars as pl
import pytest

from bottomlock.replay.case import load_case
from bottomlock.replay.figures import Drawing, nis_panel
from bottomlock.replay.report import dive_of, drawings, read_replay
from bottomlock.replay.run import write_replay
from bottomlock.statistics.replay import error_norms
from bottomlock.tables.replay import ReplayTables
from tests.drawn_points import held, points
from tests.replay.undiagnosed import replay_undiagnosed

pytestmark = pytest.mark.long

CASE = Path(__file__).parents[2] / "data" / "logs" / "survey_dive" / "case.toml"
DAY_NS = 86_400e9


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """More methods than the first figures show, so that some are folded."""
    out = tmp_path_factory.mktemp("files") / "dive"
    methods = ["ins", "lc", "tc", "info", "weak_sway", "sway_current"]
    write_replay(replay_undiagnosed(load_case(CASE).with_methods(methods)), out)
    return out


@pytest.fixture(scope="module")
def tables(folder: Path) -> ReplayTables:
    return read_replay(folder)


@pytest.fixture(scope="module")
def drawn(tables: ReplayTables) -> dict[str, Drawing]:
    return {one.name: one for one in drawings(tables, dive_of(tables))}


def test_a_map_draws_positions_of_the_tables(drawn: dict[str, Drawing], tables: ReplayTables) -> None:
    """All but the start's dot, which is one of them too, and the scale bar's two ends."""
    assert tables.path is not None
    known = pl.concat([tables.samples.select("east_m", "north_m"), tables.path.select("east_m", "north_m")])
    for name in ("map_recorded", "map_lost_34", "map_recorded_all_methods"):
        shown = points(drawn[name].figure.axes[0])
        assert held(shown, known["east_m"], known["north_m"]) >= 1.0 - 2.0 / len(shown)


def test_curves_draw_points_of_the_panels(drawn: dict[str, Drawing], tables: ReplayTables) -> None:
    """Panel by panel, also those that the drawing thins."""
    plots = dive_of(tables)
    panels = plots.views[tuple(choice.first for choice in plots.choices)].panels
    for axes, panel in zip(drawn["timeline"].figure.axes, panels, strict=True):
        assert axes.get_title("left") == panel.title
        shown = points(axes)
        assert len(shown) > 10
        known = pl.concat(
            pl.DataFrame({"time": curve.time_ns / DAY_NS, "value": curve.value}) for curve in panel.curves
        )
        assert held(shown, known["time"], known["value"]) == 1.0


@pytest.mark.parametrize("end", ["", "_all_methods"])
def test_nis_and_errors_draw_points_of_the_tables(
    drawn: dict[str, Drawing], tables: ReplayTables, end: str
) -> None:
    methods = tables.manifest["methods"]
    nis = nis_panel(tables.innovations.filter(what_if="lost_34"), methods, 1.0)
    (axes,) = drawn[f"nis_lost_34{end}"].figure.axes
    known = pl.concat(pl.DataFrame({"time": one.time_ns / DAY_NS, "ratio": one.value}) for one in nis.curves)
    assert held(points(axes), known["time"], known["ratio"]) == 1.0
    assert nis.band is not None
    assert nis.band[0] < 1.0 < nis.band[1]
    errors = error_norms(tables.samples.filter(what_if="lost_34", **{"pass": "forward"}))
    time_d = pl.Series("time", errors["time_ns"].to_numpy() / DAY_NS)
    for axes, (quantity, unit) in zip(
        drawn[f"errors_forward_lost_34{end}"].figure.axes,
        (("position", "m"), ("velocity", "mps"), ("attitude", "deg")),
        strict=True,
    ):
        both = pl.concat(
            pl.DataFrame({"time": time_d, "value": errors[column]})
            for column in (f"{quantity}_{unit}", f"{quantity}_sd_{unit}")
        )
        assert held(points(axes), both["time"], both["value"]) == 1.0


def test_innovations_draw_points_of_the_table(drawn: dict[str, Drawing], tables: ReplayTables) -> None:
    start_ns = int(tables.samples["time_ns"].min())  # type: ignore[arg-type]
    table = tables.innovations.filter(what_if="recorded", method="tc")
    for k, axes in enumerate(drawn["innovations_recorded"].figure.axes):
        value = table[f"beam{k + 1}_innovation_mps"]
        assert held(points(axes), (table["time_ns"] - start_ns) * 1e-9, value) == 1.0
