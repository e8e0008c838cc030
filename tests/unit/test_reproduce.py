"""The whole study in one call: campaign, sweep, report; resumed, the same bytes."""

from pathlib import Path

import polars as pl
import pytest

from bottomlock.campaign.run import CampaignProgress
from bottomlock.config.scenario import load_scenario
from bottomlock.studies import reproduce as whole
from bottomlock.studies import sweep
from bottomlock.studies.sweep import SETTINGS, Setting
from bottomlock.tables.check import check
from bottomlock.tables.studies import SWEEP

RARE = "inflate after rejections"


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """One trajectory, one value of each setting."""
    monkeypatch.setattr(whole, "PAPER_TRAJECTORIES", ("straight",))
    few = tuple(Setting(s.parameter, s.values[-1:], s.methods[:1], s.change) for s in SETTINGS)
    monkeypatch.setattr(sweep, "SETTINGS", few)


@pytest.mark.usefixtures("small")
@pytest.mark.slow
def test_an_interrupted_study_ends_as_an_uninterrupted_one(tmp_path: Path) -> None:
    """Stopped in the middle of the sweep and resumed: the same page, byte for byte, but for the clock's words."""
    total = whole.study_runs(12)
    heard: dict[str, float] = {}

    def hear(state: CampaignProgress) -> None:
        heard[state.trajectory] = state.runs_done

    whole.reproduce(tmp_path / "whole", runs=12, threads=1, progress=hear)
    assert sum(heard.values()) == total

    def stop(state: CampaignProgress) -> None:
        if state.trajectory.startswith("sweep 3"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        whole.reproduce(tmp_path / "broken", runs=12, threads=2, progress=stop)
    assert not (tmp_path / "broken" / "report.html").exists()
    whole.reproduce(tmp_path / "broken", runs=12, threads=2)
    for name in ("runs.parquet", "sweep.parquet", "tables/claims.parquet", "figures/velocity_straight.svg"):
        assert (tmp_path / "broken" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name


@pytest.mark.usefixtures("small")
@pytest.mark.slow
def test_every_setting_is_swept_and_moves_something(tmp_path: Path) -> None:
    """A row for each value, trajectory and method; each setting reaches the filter or the sea."""
    made = whole.reproduce(tmp_path / "o", runs=10, threads=1)
    table = check(pl.read_parquet(tmp_path / "o" / "sweep.parquet"), SWEEP, place="sweep")
    assert table["parameter"].to_list() == [setting.parameter for setting in SETTINGS]
    assert "n_f of VB" in made.page.read_text(encoding="utf-8")
    main = pl.read_parquet(tmp_path / "o" / "ensemble.parquet").group_by("method").last()
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
        setting.change(scenario, value).kernel_options()["inflate_after_rejections"]
        for value in setting.values
    ]
    assert fixes == [0, 5]
