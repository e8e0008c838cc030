"""A replay in Python: its plots are the figures of its page, its tables are the files, its comparison is by hand."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import polars as pl
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import bottomlock
from bottomlock.errors import DataError
from bottomlock.replay.case import Case, load_case
from bottomlock.replay.page import Drawing
from bottomlock.replay.report import dive_of, drawings
from bottomlock.replay.shown_replay import Replay, run_replay

pytestmark = pytest.mark.long

CASE = Path(__file__).parents[2] / "data" / "logs" / "survey_dive" / "case.toml"


def dive(methods: list[str]) -> Case:
    return load_case(CASE).with_methods(methods)


@pytest.fixture(scope="module")
def replay(tmp_path_factory: pytest.TempPathFactory) -> Replay:
    """Two of the methods, each what-if case."""
    return run_replay(dive(["tc", "sway_current"]), tmp_path_factory.mktemp("r") / "dive")


@pytest.fixture(scope="module")
def figures(replay: Replay) -> dict[str, Figure]:
    """Those of the page."""
    drawn: list[Drawing] = drawings(replay.tables, dive_of(replay.tables))
    return {one.name: one.figure for one in drawn}


@pytest.fixture(autouse=True)
def _closed() -> Iterator[None]:
    plt.switch_backend("agg")
    yield
    plt.close("all")


def curves(axes: Axes) -> list[Any]:
    """The points of every line, and the patches and shades."""
    lines = [np.asarray(line.get_xydata()) for line in axes.lines]
    shades = [path.vertices for one in axes.collections for path in one.get_paths()]
    patches = [patch.get_path().vertices for patch in axes.patches]
    return [*lines, *shades, *patches]


def same(one: Axes, other: Axes) -> None:
    ours, theirs = curves(one), curves(other)
    assert len(ours) == len(theirs) > 0
    assert [text.get_text() for text in one.texts] == [text.get_text() for text in other.texts]
    for mine, yours in zip(ours, theirs, strict=True):
        np.testing.assert_array_equal(mine, yours)


def test_plots_are_the_figures_of_the_page(replay: Replay, figures: dict[str, Figure]) -> None:
    """Point by point, on axes of their own."""
    same(replay.plot_map(), figures["map_recorded"].axes[0])
    same(replay.plot_map("lost_34"), figures["map_lost_34"].axes[0])
    same(replay.plot_nis("lost_34"), figures["nis_lost_34"].axes[0])
    for case, drawn in zip(replay.what_ifs, figures["validity"].axes, strict=True):
        same(replay.plot_beams(case), drawn)
    page = figures["timeline"].axes
    surge, sway, heave, sd, depth, levels, heading = page[:7]
    parts = {
        "velocity": (surge, sway, heave),
        "position_sd": [sd],
        "depth": [depth],
        "attitude": (levels, heading),
    }
    for quantity, axes in parts.items():
        for mine, yours in zip(replay.plot_state(quantity), axes, strict=True):
            same(mine, yours)


def test_plots_take_axes_methods_and_passes(replay: Replay) -> None:
    _, (left, right) = plt.subplots(1, 2)
    assert replay.plot_map(axes=left) is left
    assert replay.plot_state("position_sd", "sway_current", axes=[right]) == [right]
    _, three = plt.subplots(3)
    assert replay.plot_state("velocity", "tc", "lost_34", which="smoothed", axes=list(three)) == list(three)
    rows = replay.samples.filter(
        (pl.col("what_if") == "lost_34") & (pl.col("method") == "tc") & (pl.col("pass") == "smoothed")
    )
    drawn = [line.get_ydata() for line in three[0].lines if line.get_label() == "tc"]
    assert set(np.asarray(drawn[0]).tolist()) <= set(rows["surge_mps"].to_list())
    with pytest.raises(DataError, match="axes are 2, expected 3"):
        replay.plot_state("velocity", axes=[left, right])


def test_its_tables_are_its_files(replay: Replay) -> None:
    for name in ("runs", "samples", "innovations", "pings", "reference"):
        assert getattr(replay, name).equals(pl.read_parquet(replay.folder / f"{name}.parquet"))
    assert bottomlock.Replay(str(replay.folder)).runs.equals(replay.runs)
    assert replay.currents is None
