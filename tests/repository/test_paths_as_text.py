"""Paths may be given as text, wherever Python takes one; and what is no list of scenarios is named."""

import importlib
import inspect
from pathlib import Path
from typing import Any

import pytest

import bottomlock
from bottomlock.errors import ScenarioError
from tests.campaign.small_campaign import same_bits, short

ENTRY_POINTS = {
    "bottomlock.campaign.until": ["run_until"],
    "bottomlock.studies.consistency": ["run_consistency"],
    "bottomlock.studies.masks": ["run_masks"],
    "bottomlock.studies.recovery": ["run_recovery"],
    "bottomlock.studies.reproduce": ["reproduce"],
    "bottomlock.studies.sensor_law": ["run_sensor_law"],
    "bottomlock.studies.sweep": ["run_sweep"],
    "bottomlock.studies.variants": ["run_variants"],
    "bottomlock.studies.without_cause": ["run_without_causes"],
    "bottomlock.studies.expected_verdicts": ["read_expectations"],
    "bottomlock.report.compare": ["compare"],
    "bottomlock.report.page": ["make_report"],
    "bottomlock.replay.case": ["load_case"],
    "bottomlock.replay.run": ["replay_case", "write_replay"],
    "bottomlock.replay.report": ["read_replay", "make_replay_report"],
    "bottomlock.replay.tune.run": ["tune_case"],
    "partialdvl_bench.leaderboard": ["score_submissions", "read_submissions"],
    "partialdvl_bench.make": ["make_missions"],
    "partialdvl_bench.run": ["run_missions"],
    "partialdvl_bench.page": ["write_page"],
    "bottomlock.observability.report": ["observe_scenario", "observe_paper"],
    "bottomlock.live.config": ["load_config"],
    "bottomlock.config.scenario": ["copy_scenario"],
}
PUBLIC = [getattr(bottomlock, name) for name in bottomlock.__all__] + [
    getattr(importlib.import_module(module), name) for module, names in ENTRY_POINTS.items() for name in names
]


@pytest.mark.parametrize(
    "call", [one for one in PUBLIC if inspect.isfunction(one)], ids=lambda one: one.__name__
)
def test_no_entry_point_asks_for_a_path_object(call: Any) -> None:  # noqa: ANN401 - any function
    """A signature that names Path names str, too."""
    for name, parameter in inspect.signature(call).parameters.items():
        words = str(parameter.annotation)
        assert "Path" not in words or "str" in words, name


def test_a_campaign_by_text(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whole and by shards, in folders named by text: the same files as by paths."""
    monkeypatch.chdir(tmp_path)
    bottomlock.run_campaign([short(2)], "whole", threads=1)
    bottomlock.run_shard([short(2)], "one", bottomlock.Shard(1, 1), threads=1)
    bottomlock.merge_shards("merged", ["one"])
    bottomlock.run_campaign([short(2)], Path("by_path"), threads=1)
    same_bits(Path("whole"), Path("by_path"))
    same_bits(Path("whole"), Path("merged"))


@pytest.mark.parametrize("given", [short(2), "straight", ["straight"]])
def test_what_is_no_list_of_scenarios(given: Any, tmp_path: Path) -> None:  # noqa: ANN401 - a wrong one
    """The likely mistakes: one scenario, its name, a list of names."""
    with pytest.raises(
        ScenarioError, match=r"expected a list of Scenario, such as \[load_scenario\('straight'\)\]"
    ):
        bottomlock.run_campaign(given, tmp_path / "o")
