"""Random wrong lines: they build, differ from the source, and are the same ones each time."""

from pathlib import Path

import polars as pl

from tools.mutation_sample import python_faults, sampled, shares, table

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


def test_sample_is_the_same_each_time(root: Path) -> None:
    path = root / "python" / "bottomlock" / "statistics" / "rms.py"
    faults = python_faults("logs", path, root)
    first, again = sampled(faults, 5, "logs"), sampled(faults, 5, "logs")
    assert first == again
    assert len({fault.number for fault in first}) == 5


def test_shares_count_what_was_seen(root: Path) -> None:
    path = root / "python" / "bottomlock" / "statistics" / "rms.py"
    faults = sampled(python_faults("logs", path, root), 4, "logs")
    outcomes = ("killed", "survived", "timeout", "killed")
    rows = table(faults).with_columns(pl.Series("outcome", outcomes))
    (row,) = shares(rows).iter_rows(named=True)
    assert (row["faults"], row["killed"], row["share"]) == (4, 3, 0.75)
    assert row["from"] < 0.75 < row["to"]
