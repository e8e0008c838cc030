"""What terminals and notebooks show: short lines, HTML that is escaped, and plots on matplotlib axes."""

from collections.abc import Iterator
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import polars as pl
import pytest
from matplotlib.axes import Axes
from polars.testing import assert_frame_equal

import bottomlock
from bottomlock.campaign.run import Results, read_results, run_campaign
from bottomlock.errors import DataError
from bottomlock.report.compare import compare
from tests.campaign.small_campaign import short


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """Three runs of ten seconds."""
    return run_campaign([short(runs=3)], tmp_path_factory.mktemp("c") / "c")


@pytest.fixture(autouse=True)
def _closed() -> Iterator[None]:
    plt.switch_backend("agg")
    yield
    plt.close("all")


def cells(html: str) -> list[str]:
    """The text of every cell; a tag that is not closed fails."""
    found, opened = [], []

    class Reader(HTMLParser):
        def handle_starttag(self, tag: str, _: object) -> None:
            opened.append(tag)

        def handle_endtag(self, tag: str) -> None:
            assert opened.pop() == tag

        def handle_data(self, data: str) -> None:
            found.append(data)

    Reader().feed(html)
    assert not opened
    return found


def test_results_are_a_line_and_a_table(results: Results) -> None:
    """Not the data frames."""
    assert "\n" not in repr(results)
    shown = cells(results._repr_html_())
    assert [cell for cell in shown if cell in {"ins", "lc", "tc"}] == ["ins", "lc", "tc"]
    final = results.runs.filter(pl.col("method") == "tc")["velocity_final_mps"].to_numpy()
    value = shown[shown.index("tc") + 1].split()[0]
    assert float(value) == pytest.approx(np.sqrt(np.mean(final**2)), rel=5e-3)


def test_results_are_compared_as_the_command_does(results: Results, tmp_path: Path) -> None:
    """The table of `bottomlock report A B`; the pairs are those of equal runs."""
    assert results.folder is not None
    other = run_campaign([short(runs=3).replace({"dvl.beams_lost": [2]})], tmp_path / "other")
    table = other.compare(results, labels=("other", results.folder.name))
    written = compare([results.folder, tmp_path / "other"], tmp_path / "out").table
    keys = ["campaign", "trajectory", "method", "quantity"]
    assert_frame_equal(table.sort(keys), written.sort(keys))
    differences = table.filter(pl.col("campaign") == "other")
    assert differences["paired"].all()
    assert (differences.filter(pl.col("method") == "tc")["difference"].abs() > 0.0).any()
    assert (
        read_results(tmp_path / "other")
        .compare(results)
        .drop("campaign", "reference")
        .equals(table.drop("campaign", "reference"))
    )


def test_results_without_a_common_trajectory_are_not_compared(results: Results) -> None:
    renamed = replace(results, ensemble=results.ensemble.with_columns(trajectory=pl.lit("curved")))
    with pytest.raises(DataError, match="no trajectory in common: straight and curved"):
        results.compare(renamed)
    with pytest.raises(DataError, match="labels are twice 'a'"):
        results.compare(results, labels=("a", "a"))
    with pytest.raises(
        DataError, match="compare is given a PosixPath, expected Results, such as read_results"
    ):
        results.compare(results.folder)  # type: ignore[arg-type]
    assert results.folder is not None
    with pytest.raises(DataError, match=r"manifest\.json: is a file, expected a directory"):
        read_results(results.folder / "manifest.json")


def test_plots_return_axes(results: Results) -> None:
    """New ones, or those that are given; the curves are the columns of the table."""
    for plot in (results.plot_velocity_error, results.plot_attitude_error, results.plot_nees):
        axes = plot()
        assert isinstance(axes, Axes)
        assert len(axes.lines) >= 3
        _, own = plt.subplots()
        assert plot("straight", axes=own) is own
    rows = results.ensemble.filter(results.ensemble["method"] == "lc")
    drawn = [line.get_ydata() for line in results.plot_velocity_error().lines]
    assert any(np.array_equal(line, rows["velocity_rms_over_runs_mps"].to_numpy()) for line in drawn)
    with pytest.raises(DataError, match="trajectory is 'curved', expected one of straight"):
        results.plot_nees("curved")


def test_a_scenario_is_a_line_and_what_its_file_states() -> None:
    """Every section; what a description holds is escaped."""
    scenario = bottomlock.load_scenario("survey")
    assert "\n" not in repr(scenario)
    shown = cells(scenario.replace({"description": "<b>"})._repr_html_())
    assert {"[imu]", "[dvl]", "[filter]", "<b>"} <= set(shown)
