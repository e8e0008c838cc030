"""Random wrong lines: they build and differ from the source."""

from pathlib import Path

from tools.mutation_sample import python_faults

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
