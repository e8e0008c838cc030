"""The list of deliberate faults is well formed, and a fault whose line is not there is an error, not a success."""

from __future__ import annotations

from pathlib import Path

import pytest

from tools.mutants import Mutant, listed


def test_the_list_names_what_there_is(root: Path) -> None:
    """Files and tests exist; names tell mutants apart."""
    mutants = listed()
    assert len(mutants) >= 30
    assert len({mutant.name for mutant in mutants}) == len(mutants)
    for mutant in mutants:
        assert (root / "python" / mutant.file).is_file(), mutant.name
        assert all((root / test).exists() for test in mutant.tests), mutant.name


@pytest.mark.parametrize("mutant", listed(), ids=lambda mutant: mutant.name)
def test_the_line_of_each_fault_is_there(root: Path, mutant: Mutant) -> None:
    """A line that has changed since would be found only by the next night's run."""
    source = (root / "python" / mutant.file).read_text(encoding="utf-8")
    assert mutant.applied(source) != source


def test_a_line_that_is_not_there_once_is_an_error() -> None:
    """Else a fault that was never put in would count as killed or survived."""
    mutant = Mutant("name", "file.py", "x > 1", "x >= 1", ("tests/kernel",))
    assert mutant.applied("if x > 1:") == "if x >= 1:"
    for source in ("if x > 2:", "x > 1 or x > 1"):
        with pytest.raises(ValueError, match=r"file\.py"):
            mutant.applied(source)
