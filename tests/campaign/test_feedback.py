"""Vehicles steered on their estimates: the same bits however they are grouped, and the cross-track error."""

from typing import Any

import numpy as np
import pytest

from bottomlock.campaign import chunk
from bottomlock.campaign.closed_loop import run_closed_loop
from bottomlock.campaign.run import run_campaign
from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.simulation.build import build_simulation
from tests.analytic import analytic_simulation


def scenario(name: str = "lawn_mower", *, seconds: float = 8.0, **campaign_keys: object) -> Scenario:
    """A short flight on the estimate."""
    packaged = load_scenario(name)
    short = packaged.with_trajectory(feedback="estimate", duration_s=seconds)
    return short.model_copy(update={"campaign": packaged.campaign.model_copy(update=campaign_keys)})


@pytest.mark.long
def test_bits_do_not_depend_on_company() -> None:
    """Run 3 of TC is the same among seven runs and two methods, alone, and as pilot of a crew."""
    simulation = build_simulation(scenario(seconds=4.0))
    key: Any = {"trajectory_key": 5, "threads": 2}
    crowd = run_closed_loop(simulation, ["ins", "tc"], pilot="own", first_run=0, runs=7, **key)
    alone = run_closed_loop(simulation, ["tc"], pilot="tc", first_run=3, runs=1, **key)
    crew = run_closed_loop(simulation, ["ins", "tc"], pilot="tc", first_run=3, runs=1, **key)
    for name in ("error", "sd", "nees", "cross_track_m"):
        assert np.array_equal(crowd[name][3, 1], alone[name][0, 0]), name
        assert np.array_equal(crew[name][0, 1], alone[name][0, 0]), name
    assert not np.array_equal(crowd["error"][3, 0], crew["error"][0, 0]), (
        "the passenger rides another vehicle"
    )


@pytest.mark.long
def test_cross_track_is_the_error_that_guidance_cannot_see() -> None:
    """On the straight, the vehicle steers its estimated cross-track to zero: the true one is the east error.

    Up to what the error drifts, at some 0.1 m/s, while the loop takes it up, in some 5 s.
    """
    simulation = build_simulation(scenario("straight", seconds=30.0))
    batch = run_closed_loop(simulation, ["lc"], pilot="own", trajectory_key=5, first_run=0, runs=6, threads=1)
    east_error = batch["error"][:, 0, -1, 1]
    assert batch["cross_track_m"].shape == (6, 1, 151)
    assert batch["cross_track_m"][:, 0, -1] == pytest.approx(east_error, abs=0.5)
    assert np.abs(east_error).max() > 2.0


@pytest.mark.long
def test_a_campaign_tells_what_going_astray_costs(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: ANN401
    """Per run and method in the table; cut into chunks, interrupted or not, the same tables."""
    flight = scenario(seconds=4.0, runs=3, methods=("ins", "tc"))
    whole = run_campaign([flight], tmp_path / "whole", threads=1).runs
    assert whole["cross_track_rms_over_time_m"].null_count() == 0
    assert whole["cross_track_rms_over_time_m"].n_unique() == 6
    monkeypatch.setattr(chunk, "CLOSED_LOOP_VEHICLES", 2)
    heard: list[float] = []
    cut = run_campaign(
        [flight], tmp_path / "cut", threads=2, progress=lambda state: heard.append(state.runs_done)
    ).runs
    assert cut.equals(whole)
    assert heard == sorted(heard)
    assert heard[-1] == 3.0
    assert len(heard) > 6, "progress comes inside a chunk, too"


def test_on_the_truth_every_method_has_the_same_track(tmp_path: Any) -> None:  # noqa: ANN401
    """One truth for all: one cross-track error; an analytic truth has no path to stray from."""
    on_truth = run_campaign(
        [
            load_scenario("lawn_mower")
            .with_trajectory(duration_s=12.0)
            .with_overrides(runs=2, methods=["ins", "tc"])
        ],
        tmp_path / "on_truth",
        threads=1,
    ).runs
    assert on_truth["cross_track_rms_over_time_m"].n_unique() == 1
    assert on_truth["cross_track_rms_over_time_m"][0] < 0.2
    exact = analytic_simulation("straight", duration_s=12.0).scenario.with_overrides(runs=1, methods=["tc"])
    assert run_campaign([exact], tmp_path / "exact", threads=1).runs[
        "cross_track_rms_over_time_m"
    ].to_list() == [None]
