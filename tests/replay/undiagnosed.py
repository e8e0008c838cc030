"""Replays without the time that findings take: more than half of it."""

import pytest

from bottomlock.replay.case import Case
from bottomlock.replay.findings.diagnose import Diagnosis
from bottomlock.replay.findings.trust import Answer
from bottomlock.replay.run import replay_case
from bottomlock.tables.replay import ReplayTables

NOTHING = Diagnosis([], Answer(verdict="no", sentence="", numbers=(), change="", method="", vehicle=""))


def replay_undiagnosed(case: Case) -> ReplayTables:
    """The tables of `replay_case`; the manifest has no findings, for tests that judge something else."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("bottomlock.replay.run.diagnose", lambda *_: NOTHING)
        return replay_case(case)
