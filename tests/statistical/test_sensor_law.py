"""Whether a further sensor makes it worse: the decisive cells of `bottomlock sensor-law`.

The straight leg is where depth once misled every method with one beam or a diagonal pair. Seeds are those of the
packaged scenarios. With 40 runs the band of a mean NEES of velocity and attitude finds, in 90 % of campaigns, variances
that are claimed 1.6 times too small; what it guards against were factors of a thousand. `make test-long` has 500
runs of the limits.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.special import ndtri

import bottomlock
from bottomlock.errors import ScenarioError
from bottomlock.pages.page import markdown
from bottomlock.studies import sensor_law, sensor_law_page
from bottomlock.tables.studies import SENSOR_LAW

pytestmark = [pytest.mark.statistical, pytest.mark.slow]

RUNS = pytest.mark.parametrize("runs", [40, pytest.param(500, marks=pytest.mark.deep)])


def scenario(runs: int) -> bottomlock.Scenario:
    """The straight leg."""
    packaged = bottomlock.load_scenario("straight")
    return packaged.model_copy(update={"campaign": packaged.campaign.model_copy(update={"runs": runs})})


@lru_cache(maxsize=8)
def cell(mask: tuple[int, ...], runs: int, current_mps: float = 0.0) -> pl.DataFrame:
    """One mask with every set of sensors."""
    return sensor_law.run_cell(scenario(runs), mask, current_mps, tests=48, threads=1)


@pytest.mark.long
@RUNS
@pytest.mark.parametrize(
    ("mask", "limit_mps"),
    [
        ((1,), 0.15),
        pytest.param((1, 3), 0.15, marks=pytest.mark.long),
        pytest.param((2, 4), 0.15, marks=pytest.mark.long),
        pytest.param((1, 2), 0.07, marks=pytest.mark.long),
    ],
)
def test_depth_keeps_the_velocity(mask: tuple[int, ...], limit_mps: float, runs: int) -> None:
    """With depth on, RMS velocity error at the end of the straight leg; no run above 1 m/s, NEES in its band."""
    rows = cell(mask, runs).filter(
        pl.col("method").is_in(["sway_current", "consistent"]) & (pl.col("sensors") == "depth")
    )
    assert rows.height == 2
    assert rows["velocity_rms_over_runs_mps"].max() <= limit_mps  # type: ignore[operator]
    assert rows["velocity_greatest_mps"].max() < 1.0  # type: ignore[operator]
    assert "overconfident" not in rows["verdict_velocity_attitude"].to_list()


@RUNS
@pytest.mark.long
@pytest.mark.parametrize("mask", [(1, 3), (1,), (1, 2)])
def test_no_sensor_makes_it_worse(mask: tuple[int, ...], runs: int) -> None:
    """No median velocity error rises, nor that of a run, and no NEES of velocity and attitude leaves its band."""
    found = sensor_law.summary(cell(mask, runs))
    assert found["cells"].to_list() == [1] * len(found)
    assert found["worse"].sum() == 0
    assert found["runaways"].sum() == 0
    assert found["left_band"].sum() == 0


@pytest.mark.long
def test_depth_does_not_touch_what_it_cannot_judge() -> None:
    """With one beam, tightly coupled: the errors of velocity with depth are those without, whatever the run."""
    rows = cell((1,), 40).filter((pl.col("method") == "tc") & pl.col("sensors").is_in(["none", "depth"]))
    without, with_depth = rows["velocity_rms_over_runs_mps"]
    assert with_depth == pytest.approx(without, rel=1e-3)
    assert without > 10.0


def test_medians_that_rise() -> None:
    """Beyond chance only: the same runs with a tenth more error, and the same runs in another order."""
    rng = np.random.default_rng(1)
    error = rng.rayleigh(1.0, 60)
    assert sensor_law._median_rises(error, 1.1 * error)
    assert not sensor_law._median_rises(error, 0.9 * error)
    assert not sensor_law._median_rises(error, rng.permutation(error))


def test_a_run_that_rises() -> None:
    """By hand: of one test at 1 %, three components, σ = 0.5: the upper half of a band of 0.01/3, in either sign.

    Runs that differ by what a sensor corrects stay within it: σ = 2, of which a measurement of σ = 1 leaves 0.894.
    """

    def rises(less: np.ndarray, more: np.ndarray, sd_mps: float, tests: int) -> bool:
        return sensor_law._a_run_rises(
            sensor_law._Runs(less[:, None], np.full_like(less[:, None], sd_mps)),
            sensor_law._Runs(more[:, None], np.full_like(more[:, None], 1e-3)),
            0,
            tests=tests,
        )

    none = np.zeros((1, 1, 3))
    limit = 0.5 * float(-ndtri(0.0025 / 3))
    for size, expected in ((limit - 1e-6, False), (limit + 1e-6, True)):
        assert rises(none, np.array([[[0.0, -size, 0.0]]]), 0.5, 1) is expected
        assert not rises(none + 9.0, none + size, 0.5, 1)
    rng = np.random.default_rng(5)
    error = rng.normal(0.0, 2.0, (4000, 5, 3))
    corrected = error - 0.8 * (error + rng.normal(0.0, 1.0, error.shape))
    assert not rises(error, corrected, 2.0, 100)


@pytest.mark.long
def test_no_run_runs_away_with_depth_beside_acoustics() -> None:
    """The run of seed 90210 that a depth once drove to 16 m/s beside acoustic fixes, and its neighbours."""
    few = scenario(85)
    few = few.model_copy(update={"campaign": few.campaign.model_copy(update={"seed": 90210})})
    rows = sensor_law.run_cell(few, (2, 4), 0.0, tests=48, threads=1).filter(pl.col("method") == "tc")
    both = rows.row(by_predicate=pl.col("sensors") == "depth+acoustic", named=True)
    assert both["velocity_greatest_mps"] < 1.0
    assert (both["median_rises_above"], both["run_rises_above"]) == ("", "")
    assert both["verdict_whole_state"] == "consistent"


def test_what_is_no_variant() -> None:
    """A sensor that is not known, and a current around an analytic truth."""
    packaged = scenario(1)
    with pytest.raises(
        ScenarioError, match="unknown sensor 'sonar' \\(known: depth, heading, attitude, gps, acoustic\\)"
    ):
        sensor_law.variant(packaged, (1,), ("sonar",), 0.0)
    analytic = packaged.model_copy(
        update={"trajectory": packaged.trajectory.model_copy(update={"source": "analytic"})}
    )
    with pytest.raises(ScenarioError, match="a current needs a vehicle"):
        sensor_law.variant(analytic, (1,), (), 0.3)


@pytest.mark.long
def test_a_study_to_its_table(tmp_path: Path) -> None:
    """Two cells, the second time from their files."""
    few = scenario(2)
    first = sensor_law.run_sensor_law([few], [(1, 2)], tmp_path, threads=1)
    assert first.schema == dict(SENSOR_LAW)
    assert first.height == 2 * len(sensor_law.SENSOR_SETS) * len(sensor_law.METHODS)
    done: list[str] = []
    again = sensor_law.run_sensor_law(
        [few], [(1, 2)], tmp_path, threads=1, progress=lambda name, *_: done.append(name)
    )
    assert again.equals(first)
    assert done == ["straight-12-still", "straight-12-current"]
    assert pl.read_parquet(tmp_path / "sensor_law.parquet").equals(first)


@pytest.mark.long
def test_the_page_says_what_the_table_says(tmp_path: Path) -> None:
    """Answer, summary and cells are the table's; a cell that becomes overconfident or worse is marked."""
    out = tmp_path / "law"
    out.mkdir()
    table = sensor_law.run_sensor_law([scenario(2)], [(1, 2)], out, command="bottomlock sensor-law straight")
    assert (out / "sensor_law.html").is_file()
    page = (out / "sensor_law.md").read_text(encoding="utf-8")
    assert "Command: `bottomlock sensor-law straight`" in page
    assert page.count("\n| 1,2 | ") == 4
    changed = table.with_columns(
        pl.when(pl.col("sensors") == "depth")
        .then(pl.lit("overconfident"))
        .otherwise("verdict_velocity_attitude")
        .alias("verdict_velocity_attitude"),
        pl.when(pl.col("sensors") == "acoustic")
        .then(pl.lit("none"))
        .otherwise(pl.lit(""))
        .alias("median_rises_above"),
        pl.when(pl.col("sensors") == "gps")
        .then(pl.lit("none"))
        .otherwise(pl.lit(""))
        .alias("run_rises_above"),
    )
    facts = {"runs": 2, "seed": 1, "false_alarm": 0.01, "made_with": "", "command": ""}
    marked = markdown(sensor_law_page.page(changed, sensor_law.summary(changed), facts))
    assert (marked.count(" ▲ |"), marked.count(" rises |"), marked.count(" runaway |")) == (4, 4, 4)
    assert "median velocity error rises in 2, the error of a run in 2, and 2 become" in marked
