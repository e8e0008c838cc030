"""Single bits of files that are read back are flipped."""

from __future__ import annotations

from pathlib import Path

import pytest

from bottomlock.files import records
from tests.attack import bit_flips


@pytest.mark.parametrize(
    "count", [4, pytest.param(40, marks=pytest.mark.long), pytest.param(200, marks=pytest.mark.deep)]
)
@pytest.mark.parametrize("kind", bit_flips.KINDS)
def test_no_bit_changes_a_table_in_silence(kind: str, count: int) -> None:
    assert bit_flips.attack(16, count, {kind: bit_flips.KINDS[kind]}) == []


def test_the_flips_find_a_reader_that_checks_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """The attack fails where it should."""

    def unchecked(path: Path, record: object, *, remedy: str) -> bytes:  # noqa: ARG001
        return path.read_bytes()

    monkeypatch.setattr(records, "read_recorded", unchecked)
    faults = bit_flips.attack(16, 10, {"replay": bit_flips.KINDS["replay"]})
    assert any("other tables, without an error" in fault for fault in faults)
