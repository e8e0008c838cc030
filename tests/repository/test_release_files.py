"""Files of a release agree with one another."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def version() -> str:
    """The version of the workspace, which the wheel takes."""
    workspace = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))["workspace"]
    return str(workspace["package"]["version"])


def test_one_date() -> None:
    """The version's section in the CHANGELOG is the newest one, and dated as the citation is."""
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    sections = re.findall(r"^## \[(.+?)\](?: - (\d{4}-\d\d-\d\d))?$", changes, flags=re.MULTILINE)
    assert sections[0] == ("Unreleased", "")
    newest, date = sections[1]
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert newest == version()
    assert re.findall(r"^date-released: (.*)$", citation, flags=re.MULTILINE) == [date]
    assert date
