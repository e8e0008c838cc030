"""The figures of a replay's page draw the replay's tables."""

import polars as pl
import pytest

from bottomlock.files.replay_tables import ReplayTables
from bottomlock.replay.page import Drawing
from bottomlock.replay.panels import nis_panel
from bottomlock.replay.report import dive_of, drawings
from tests.drawn_points import held, points
from tests.replay.dive_tables import dive_tables

DAY_NS = 86_400e9


@pytest.fixture(scope="module")
def tables() -> ReplayTables:
    return dive_tables()


@pytest.fixture(scope="module")
def drawn(tables: ReplayTables) -> dict[str, Drawing]:
    return {one.name: one for one in drawings(tables, dive_of(tables))}


def test_a_map_draws_positions_of_the_tables(drawn: dict[str, Drawing], tables: ReplayTables) -> None:
    """All but the start's dot, which is one of them too, and the scale bar's two ends."""
    shown = points(drawn["map_recorded"].figure.axes[0])
    assert held(shown, tables.samples["east_m"], tables.samples["north_m"]) >= 1.0 - 2.0 / len(shown)


def test_curves_draw_points_of_the_panels(drawn: dict[str, Drawing], tables: ReplayTables) -> None:
    """Panel by panel, also those that the drawing thins."""
    plots = dive_of(tables)
    panels = plots.views[tuple(choice.first for choice in plots.choices)].panels
    for axes, panel in zip(drawn["timeline"].figure.axes, panels, strict=True):
        assert axes.get_title("left") == panel.title
        shown = points(axes)
        assert len(shown) >= 2
        known = pl.concat(
            pl.DataFrame({"time": curve.x / DAY_NS, "value": curve.value}) for curve in panel.curves
        )
        assert held(shown, known["time"], known["value"]) == 1.0


def test_nis_and_innovations_draw_points_of_the_table(
    drawn: dict[str, Drawing], tables: ReplayTables
) -> None:
    nis = nis_panel(tables.innovations, tables.manifest["methods"], 1.0)
    (axes,) = drawn["nis_recorded"].figure.axes
    known = pl.concat(pl.DataFrame({"time": one.x / DAY_NS, "ratio": one.value}) for one in nis.curves)
    assert held(points(axes), known["time"], known["ratio"]) == 1.0
    assert nis.band is not None
    assert nis.band[0] < 1.0 < nis.band[1]
    table = tables.innovations.filter(method="tc")
    days = pl.Series(table["time_ns"].to_numpy() / DAY_NS)
    for k, axes in enumerate(drawn["innovations_recorded"].figure.axes):
        shown, value = points(axes), table[f"beam{k + 1}_innovation_mps"]
        # Of the line at zero, about which ±2 sigma is shaded, no value is an innovation.
        assert held(shown[shown[:, 1] != 0.0], days, value) == 1.0
