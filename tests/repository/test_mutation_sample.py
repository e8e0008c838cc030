"""Random wrong lines: they build and differ from the source."""

from dataclasses import replace
from pathlib import Path

import polars as pl
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
    """The faults of this commit, with their outcomes; a table of another commit is refused."""
    (tmp_path / "gate.py").write_text(SOURCE)
    judged = [replace(one, outcome="killed") for one in python_faults("logs", tmp_path / "gate.py", tmp_path)]
    table = tmp_path / "table.parquet"
    write(judged, table)
    assert [(one.key, one.outcome) for one in judged_before(table)] == [(one.key, "killed") for one in judged]
    pl.read_parquet(table).write_parquet(table, metadata={"commit": "0" * 40})
    with pytest.raises(SystemExit, match=head()):
        judged_before(table)
