"""docs/ports.md says what the ports do: its example runs, every port has its row."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from bottomlock.ports.registry import PORTS


@pytest.fixture(scope="module")
def page(root: Path) -> str:
    return (root / "docs" / "ports.md").read_text(encoding="utf-8")


def test_every_port_has_its_row(page: str) -> None:
    section = page.split("\n## The ports\n", 1)[1].split("\n### ", 1)[0]
    assert re.findall(r"^\| `(\w+)` \|", section, re.MULTILINE) == list(PORTS)


def test_the_example_runs(page: str, capsys: pytest.CaptureFixture[str]) -> None:
    """It prints the reason that its comment states."""
    (example,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    names: dict[str, Any] = {}
    exec(compile(example, "docs/ports.md", "exec"), names)
    assert len(names["packet"]) == 45
    (said,) = re.findall(r"print\(.*\)\s+# (.*)", example)
    assert capsys.readouterr().out.strip() == said
