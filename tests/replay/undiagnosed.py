"""Replays without the time that findings and smoothing take: most of it."""

from typing import Any

import pytest

from bottomlock.files.replay_tables import ReplayTables
from bottomlock.replay.case import Case
from bottomlock.replay.findings.diagnose import Diagnosis
from bottomlock.replay.findings.verdict import Answer
from bottomlock.replay.run import replay_case

NOTHING = Diagnosis([], Answer(verdict="no", sentence="", numbers=(), change="", method="", vehicle=""))


def replay_undiagnosed(case: Case) -> ReplayTables:
    """The tables of `replay_case`; the manifest has no findings, for tests that judge something else."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("bottomlock.replay.run.diagnose", lambda *_: NOTHING)
        return replay_case(case)


def unsmoothed(case: Case) -> Case:
    """For tests that judge the filter alone."""
    return case.model_copy(update={"replay": case.replay.model_copy(update={"smooth": False})})


def tc_row(case: Case) -> dict[str, Any]:
    """The run of `tc` without smoothing, in tests that judge where it ends and how its pings fit."""
    return replay_undiagnosed(unsmoothed(case.with_methods(["tc"]))).runs.row(0, named=True)
