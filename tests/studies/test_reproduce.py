"""The whole study in one call: campaign, sweep, report; resumed, the same tables."""

from collections.abc import Iterator
from pathlib import Path

import polars as pl
import pytest

from bottomlock.campaign.run import CampaignProgress
from bottomlock.config.scenario import load_scenario
from bottomlock.files.columns import SWEEP, check
from bottomlock.studies import reproduce as study_of_2017
from bottomlock.studies import reproduce as whole
from bottomlock.studies.reproduce import SETTINGS, Setting
from tests.undrawn import figures_undrawn

RUNS = 4
RARE = "inflate after rejections"


@pytest.fixture(scope="module")
def small() -> Iterator[None]:
    """One trajectory, one value of each setting; tests/report/test_report.py judges the bytes of figures."""
    few = tuple(Setting(s.parameter, s.values[-1:], s.methods[:1], s.change) for s in SETTINGS)
    with figures_undrawn(), pytest.MonkeyPatch.context() as patch:
        patch.setattr(whole, "PAPER_TRAJECTORIES", ("straight",))
        patch.setattr(study_of_2017, "SETTINGS", few)
        yield


@pytest.fixture(scope="module")
def study(small: None, tmp_path_factory: pytest.TempPathFactory) -> Path:  # noqa: ARG001
    """The whole study, of four runs, in one go."""
    out = tmp_path_factory.mktemp("study") / "whole"
    heard: dict[str, float] = {}

    def hear(state: CampaignProgress) -> None:
        heard[state.trajectory] = state.runs_done

    made = whole.reproduce(out, runs=RUNS, threads=1, progress=hear)
    assert sum(heard.values()) == whole.study_runs(RUNS)
    assert made.page == out / "report.html"
    return out


@pytest.mark.usefixtures("small")
@pytest.mark.slow
def test_an_interrupted_study_ends_as_an_uninterrupted_one(study: Path, tmp_path: Path) -> None:
    """Stopped in the middle of the sweep and resumed: the same tables, byte for byte."""

    def stop(state: CampaignProgress) -> None:
        if state.trajectory.startswith("sweep 3"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        whole.reproduce(tmp_path / "broken", runs=RUNS, threads=2, progress=stop)
    assert not (tmp_path / "broken" / "report.html").exists()
    assert whole.reproduce(tmp_path / "broken", runs=RUNS, threads=2).page.is_file()
    for name in ("runs.parquet", "sweep.parquet", "tables/claims.parquet"):
        assert (tmp_path / "broken" / name).read_bytes() == (study / name).read_bytes(), name


@pytest.mark.slow
def test_every_setting_is_swept_and_moves_something(study: Path) -> None:
    """A row for each value, trajectory and method; each setting reaches the filter or the sea."""
    table = check(pl.read_parquet(study / "sweep.parquet"), SWEEP, place="sweep")
    assert table["parameter"].to_list() == [setting.parameter for setting in SETTINGS]
    assert "n_f of VB" in (study / "report.html").read_text(encoding="utf-8")
    main = pl.read_parquet(study / "ensemble.parquet").group_by("method").last()
    for row in table.iter_rows(named=True):
        if row["parameter"] == RARE:
            continue
        here = main.filter(pl.col("method") == row["method"])["velocity_rms_over_runs_mps"][0]
        assert row["velocity_rms_over_runs_mps"] != pytest.approx(here, rel=1e-6), row["parameter"]


def test_a_gate_that_reopens_reaches_the_filter() -> None:
    """It moves nothing in runs without a lock-out, so the options are looked at instead."""
    setting = next(setting for setting in SETTINGS if setting.parameter == RARE)
    scenario = load_scenario("straight")
    fixes = [
        setting.change(scenario, value).kernel_options().inflate_after_rejections for value in setting.values
    ]
    assert fixes == [0, 5]
