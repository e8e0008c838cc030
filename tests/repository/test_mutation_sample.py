"""Random wrong lines: they build and differ from the source."""

import os
import subprocess
from pathlib import Path

from tools.mutation_sample import python_faults
from tools.switched_faults import SOURCE as SWITCH_SOURCE
from tools.switched_faults import SWITCH, Fault, blamed, switched

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


RUST = b"""fn brace(text: &str) -> char { if text == "}" { '{' } else { 'x' } } // }
fn main() { println!("{} {}", brace("}"), 2 + 3); }
"""


def rust_fault(old: bytes, new: str, function: bytes) -> Fault:
    """A fault of `RUST`, in the function of that line."""
    at, first = RUST.index(old), RUST.index(function)
    owner = first, RUST.index(b"}\n" if function == b"fn main" else b"} // }", first) + 1
    return Fault("", "a.rs", "", "", "", span=(at, at + len(old)), new=new, owner=owner)


def test_one_build_has_every_rust_fault(tmp_path: Path) -> None:
    """The run takes one of them; an error is of the fault in whose body it is."""
    faults = {1: rust_fault(b"==", "!=", b"fn brace"), 2: rust_fault(b"+", "*", b"fn main")}
    faults[3] = rust_fault(b"'x'", "'y'", b"fn brace")
    written = switched(RUST, faults)
    (tmp_path / "a.rs").write_bytes(written.text + SWITCH_SOURCE.encode())
    subprocess.run(["rustc", "a.rs"], cwd=tmp_path, check=True)
    for number, expected in enumerate(("{ 5", "x 5", "{ 6", "{ 5")):
        environment = os.environ | {SWITCH: str(number)}
        assert subprocess.check_output([tmp_path / "a"], env=environment, text=True).strip() == expected
    for at, found in ((written.text.index(b"!="), {1}), (written.text.index(b"if crate"), {1, 3})):
        span = {"file_name": "a.rs", "byte_start": at, "is_primary": True}
        assert blamed([{"message": {"level": "error", "spans": [span]}}], {"a.rs": written}) == found
