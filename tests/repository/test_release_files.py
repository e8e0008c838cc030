"""Files of a release agree with one another: version, dependencies, licence."""

import json
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]


def project() -> dict[str, Any]:
    """The table [project] of pyproject.toml."""
    table: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return table


def version() -> str:
    """The version of the workspace, which the wheel takes."""
    workspace = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))["workspace"]
    return str(workspace["package"]["version"])


@pytest.mark.parametrize("file", ["CITATION.cff", "tools/conda/recipe.yaml"])
def test_one_version(file: str) -> None:
    text = (ROOT / file).read_text(encoding="utf-8")
    stated = re.findall(r'^\s*version: "?(\d+\.\d+\.\d+)"?$', text, flags=re.MULTILINE)
    assert stated == [version()]


def test_one_date() -> None:
    """The version's section in the CHANGELOG is the newest one, and dated as the citations are."""
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    sections = re.findall(r"^## \[(.+?)\](?: - (\d{4}-\d\d-\d\d))?$", changes, flags=re.MULTILINE)
    assert sections[0] == ("Unreleased", "")
    newest, date = sections[1]
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    archive = json.loads((ROOT / ".zenodo.json").read_text(encoding="utf-8"))
    assert newest == archive["version"] == version()
    assert re.findall(r"^date-released: (.*)$", citation, flags=re.MULTILINE) == [date]
    assert archive["publication_date"] == date != ""


def test_the_conda_recipe_has_the_dependencies_of_the_wheel() -> None:
    text = (ROOT / "tools/conda/recipe.yaml").read_text(encoding="utf-8")
    run = text.split("\n  run:\n")[1].split("\n\n")[0]
    # matplotlib is split there: its base has no window toolkit.
    found = {
        line.strip(" -").replace(" ", "").replace("matplotlib-base", "matplotlib")
        for line in run.splitlines()
    }
    assert found == {*project()["dependencies"], f"python{project()['requires-python']}"}


def test_every_citation_of_the_software_paper_is_in_its_bibliography() -> None:
    paper = (ROOT / "docs/joss/paper.md").read_text(encoding="utf-8")
    entries = set(
        re.findall(
            r"^@\w+\{(\w+),", (ROOT / "docs/joss/paper.bib").read_text(encoding="utf-8"), flags=re.MULTILINE
        )
    )
    assert set(re.findall(r"@(\w+)", paper.split("---\n")[2])) == entries
    # JOSS asks for 250 to 1000 words and a statement of need.
    assert 250 <= len(paper.split("---\n")[2].split()) <= 1000
    assert "# Statement of need" in paper
