"""The page of the Python API: every public name is on it, and its signatures have the types of the sources."""

import re
from pathlib import Path

import bottomlock


def test_every_public_name_is_on_the_page(root: Path) -> None:
    page = (root / "docs" / "reference" / "python.md").read_text(encoding="utf-8")
    shown = set(re.findall(r"^\.\. \S+:: bottomlock\.(\w+)$", page, re.MULTILINE))
    assert shown == set(bottomlock.__all__)
