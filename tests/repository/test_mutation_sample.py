"""Random wrong lines: they build and differ from the source."""

from dataclasses import replace
from pathlib import Path

import pytest

from tools.mutation_sample import head, judged_before, python_faults, write

SOURCE = '''
def gate(value, limit, *, strict: bool = True):
    """Whether a value passes."""
    if value < limit and not strict:
        return value * 2.0
    check(limit=limit)
    raise ValueError(f"{value + limit} is too large")
'''


def test_faults_build_and_differ(tmp_path: Path) -> None:
    (tmp_path / "gate.py").write_text(SOURCE)
    faults = python_faults("logs", tmp_path / "gate.py", tmp_path)
    wrong = {fault.applied(SOURCE) for fault in faults}
    assert SOURCE not in wrong
    for text in wrong:
        compile(text, "fault", "exec")
    changed = [fault.change for fault in faults]
    assert "value < limit -> (value <= limit)" in changed
    assert "check(limit=limit) -> pass" in changed
    # What is raised is not a fault's place.
    assert not any("value + limit" in change for change in changed)
    assert {fault.function for fault in faults} == {"gate"}


def test_a_run_goes_on_with_what_its_table_holds(tmp_path: Path) -> None:
    """The faults of this commit and of other groups stay; those of a group at another commit are judged anew."""
    (tmp_path / "gate.py").write_text(SOURCE)
    first, second, third, *_ = python_faults("logs", tmp_path / "gate.py", tmp_path)
    kept = [
        replace(first, outcome="killed", commit=head()),
        replace(second, group="kernel mathematics", outcome="survived", commit="0" * 40),
    ]
    table = tmp_path / "table.parquet"
    write([*kept, replace(third, outcome="killed", commit="0" * 40)], table)
    found = judged_before(table, ["logs"])
    assert [(one.key, one.outcome, one.commit) for one in found] == [
        (one.key, one.outcome, one.commit) for one in kept
    ]
    with pytest.raises(SystemExit, match="--goes-on needs --out"):
        judged_before(tmp_path / "none.parquet", ["logs"])
