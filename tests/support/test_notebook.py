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
    assert repr(results) == "<Results: 3 runs of straight; ins, lc, tc>"
    shown = cells(results._repr_html_())
    assert shown[0] == "straight: RMS over 3 runs, mean NEES, with 95 % intervals"
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
    assert repr(scenario) == str(scenario)
    assert "survey: lawn_mower at " in repr(scenario)
    assert "4 beams, depth, magnetometer" in repr(scenario)
    assert "\n" not in repr(scenario)
    shown = cells(scenario.replace({"description": "<b>"})._repr_html_())
    assert {"[imu]", "[dvl]", "[filter]", "<b>"} <= set(shown)
    assert repr(scenario.replace({"dvl.beams_lost": [2]})).count("4 beams without 2") == 1


def test_a_geometry_is_its_angles() -> None:
    """By hand: a Janus of 20 degrees with the azimuths of an x."""
    janus = bottomlock.BeamGeometry.janus(np.deg2rad(20.0))
    assert repr(janus) == "<BeamGeometry: 4 beams, tilt 20 deg, azimuths 45, 135, -135, -45 deg>"
    shown = cells(janus._repr_html_())  # type: ignore[attr-defined]
    assert shown.count("20") == 4
    assert "-135" in shown


def test_a_navigator_is_its_estimate() -> None:
    """Time, position and velocity with their 1 sigma, as at the start."""
    scenario = bottomlock.load_scenario("straight")
    initial = bottomlock.InitialState(
        time_ns=5_000_000_000, position_t_m=[1, 2, 20], attitude_t_p=[1, 0, 0, 0], velocity_p_mps=[2, 0, 0]
    )
    geometry = bottomlock.BeamGeometry.janus(np.deg2rad(20.0))
    navigator = bottomlock.Navigator(
        geometry, scenario.kernel_model(9.8), scenario.kernel_options(), initial, method="tc"
    )
    assert repr(navigator) == (
        "<Navigator at 5.000 s: position (1 ± 2, 2 ± 2, 20 ± 2) m, "
        "velocity (2 ± 0.05, 0 ± 0.05, 0 ± 0.05) m/s>"
    )
    shown = cells(navigator._repr_html_())  # type: ignore[attr-defined]
    assert shown[shown.index("velocity surge, m/s") + 1 :][:2] == ["2", "0.05"]


def test_variants_of_a_scenario_are_checked() -> None:
    """As a file is: an unknown key names the nearest, and the scenario itself stays as it is."""
    scenario = bottomlock.load_scenario("straight")
    assert scenario.replace({"dvl.tilt_deg": 30.0}).dvl.tilt_deg == 30.0
    assert scenario.dvl.tilt_deg == 20.0
    with pytest.raises(bottomlock.ScenarioError, match="did you mean 'tilt_deg'"):
        scenario.replace({"dvl.tilt": 30.0})
