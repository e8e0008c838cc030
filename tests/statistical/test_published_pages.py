"""One cell of each page of a study is flown again: a page that an older kernel made is seen."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from bottomlock.cli.parameters import load_scenarios
from bottomlock.studies import consistency, masks, sensor_law
from bottomlock.studies.cases import PAPER_TRAJECTORIES
from tools.make_pages import ROOT, STAMP, pages, stamped

pytestmark = pytest.mark.statistical

METHODS = "tc,sway_current"


def cells(page: str, corner: str, row: str) -> dict[str, str]:
    """A row of the first table whose first column has a heading: the other cells by theirs, without marks."""
    lines = iter(page.splitlines())
    heads = next(line for line in lines if line.startswith(f"| {corner} |"))
    found = next(line for line in lines if line.startswith(f"| {row} |"))
    names, values = ([part.strip() for part in line.strip("|").split("|")] for line in (heads, found))
    return {
        name.strip("`"): value.partition(" ")[0] for name, value in zip(names[1:], values[1:], strict=True)
    }


def page(name: str) -> str:
    return (ROOT / "docs" / name).read_text(encoding="utf-8")


@pytest.mark.long
@pytest.mark.parametrize(
    ("file", "scenario", "world", "runs"),
    [
        ("consistency.md", "straight", None, 100),
        ("consistency_survey.md", "straight", "survey_table2", 60),
        ("consistency_hovering.md", "hovering", None, 60),
    ],
)
def test_consistency(file: str, scenario: str, world: str | None, runs: int, tmp_path: Path) -> None:
    loaded = load_scenarios([scenario], runs=runs, seed=None, methods=METHODS, threads=0, world=world)
    consistency.run_consistency(loaded, consistency.parse_masks("123", 4), tmp_path)
    flown = cells((tmp_path / "consistency.md").read_text(encoding="utf-8"), scenario, "1,2,3")
    there = cells(page(file), scenario, "1,2,3")
    assert set(flown) == set(METHODS.split(","))
    assert {method: there[method] for method in flown} == flown


@pytest.mark.long
@pytest.mark.parametrize(("file", "world"), [("masks.md", None), ("masks_survey.md", "survey_table2")])
def test_masks(file: str, world: str | None, tmp_path: Path) -> None:
    loaded = load_scenarios(["straight"], runs=50, seed=None, methods=METHODS, threads=0, world=world)
    flown = masks.run_masks(loaded, tmp_path, wanted=["123"])
    there = cells(page(file), "straight", "1,2,3")
    for row in flown.iter_rows(named=True):
        value = float(there[row["method"]].partition("<")[0])
        assert value == pytest.approx(row["velocity_rms_over_runs_mps"], rel=6e-3, abs=6e-4), row["method"]


@pytest.mark.long
def test_sensor_law() -> None:
    """The nine sets of sensors with beams 1, 2 and 3 along a straight line in still water."""
    (scenario,) = load_scenarios(PAPER_TRAJECTORIES[:1], runs=40, seed=None, methods=None, threads=0)
    table = sensor_law.run_cell(scenario, (1, 2, 3), 0.0, tests=6480)
    text = page("sensor_law.md")
    for method in ("tc", "sway_current"):
        _, _, part = text.partition(f"## `{method}`: velocity RMS at the end, m/s")
        there = cells(part, f"{scenario.name}, still water", "1,2,3")
        rows = table.filter(method=method)
        flown = dict(zip(rows["sensors"], rows["velocity_rms_over_runs_mps"], strict=True))
        for sensors, value in there.items():
            assert float(value) == pytest.approx(flown[sensors], abs=6e-4), (method, sensors)


def test_the_readme_states_the_range_of_the_masks() -> None:
    """Of the recommended method, over all 51 cases of docs/masks.md; that page states it twice more."""
    found, column = [], 0
    for line in page("masks.md").partition("## When the beams come back")[0].splitlines():
        parts = [part.strip() for part in line.strip("|").split("|")]
        if "`sway_current`" in parts and "`tc`" in parts:
            column = parts.index("`sway_current`")
        elif column and re.fullmatch(r"\d(,\d)*|dropouts|slope", parts[0]):
            found.append(float(re.split("[ <]", parts[column])[0]))
    assert len(found) == 51
    words = f"{min(found):.2f}–{max(found):.2f} m/s"
    assert f"stays within {words} RMS in all 51" in (ROOT / "README.md").read_text(encoding="utf-8")
    assert page("masks.md").count(words) == 2


def test_every_page_says_its_commit() -> None:
    """And the command, whose commit is that of code: eight digits."""
    for one in pages():
        text = (ROOT / one.file).read_text(encoding="utf-8")
        assert STAMP.search(text), one.file
        (commit,) = {words.split(":")[0] for words in text.split("Numbers by the code of commit ")[1:]}
        assert len(commit) == 8, one.file
        assert int(commit, 16) >= 0, one.file
        assert stamped(text, one, commit) == text, one.file


def test_no_page_of_a_study_is_left_out() -> None:
    """A page that says that a command made it stands in tools/pages.toml."""
    named = {one.file for one in pages()}
    marks = (
        "\n- Made with bottomlock ",
        "<!-- table ",
        "written by tools/publish_studies.py",
        "<!-- table dives",
    )
    for path in sorted((ROOT / "docs").rglob("*.md")):
        text = path.read_text(encoding="utf-8")
        if any(mark in text for mark in marks):
            assert path.relative_to(ROOT).as_posix() in named, path
    assert np.all([one.minutes > 0 for one in pages()])
