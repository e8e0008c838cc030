"""Runs without the cause of a drift are the campaign's own runs in all other respects."""

from pathlib import Path

import numpy as np

from bottomlock.campaign.run import CampaignProgress, run_campaign
from bottomlock.config.scenario import load_scenario
from bottomlock.files.campaign_tables import read_campaign_tables
from bottomlock.statistics.run_errors import read_run_errors
from bottomlock.studies.reproduce import run_without_causes, variants


def test_the_same_runs_on_a_level_path(tmp_path: Path) -> None:
    """Before the dive begins the errors are those of the campaign; the path then stays level, and the errors differ."""
    scenario = load_scenario("lawn_mower").with_overrides(runs=2, methods=["vb", "tc"])
    scenario = scenario.with_trajectory(duration_s=30.0)
    run_campaign([scenario], tmp_path, threads=1)
    heard: list[CampaignProgress] = []
    run_without_causes([scenario], tmp_path, threads=1, progress=heard.append)
    assert {state.trajectory for state in heard} == {"lawn_mower without dive"}
    with_dive, level = (read_campaign_tables(place) for place in (tmp_path, tmp_path / "without_dive"))
    assert level.methods("lawn_mower") == ["vb"]
    assert level.paths is not None
    assert with_dive.paths is not None
    assert np.ptp(level.paths["depth_m"].to_numpy()) < 0.1
    assert np.ptp(with_dive.paths["depth_m"].to_numpy()) > 7.0
    ours, theirs = (read_run_errors(one, "lawn_mower").velocity_mps["vb"] for one in (with_dive, level))
    np.testing.assert_allclose(ours[:, 0], theirs[:, 0], rtol=1e-2)
    assert np.abs(ours[:, -1] / theirs[:, -1] - 1.0).max() > 0.01


def test_trajectories_and_methods_without_a_claim_have_no_variant() -> None:
    """Nothing is run for a study of other trajectories or methods."""
    straight, mower = load_scenario("straight"), load_scenario("lawn_mower")
    assert variants([straight]) == {}
    assert variants([mower.with_overrides(methods=["tc", "nsv"])]) == {}
