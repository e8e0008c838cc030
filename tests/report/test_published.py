"""What README and package say of a method is what the published consistency studies say."""

from __future__ import annotations

import re
from pathlib import Path

import polars as pl
import pytest

from bottomlock.pages.page import markdown
from bottomlock.report.advice import REFERENCES
from bottomlock.report.published import load_published, never_overconfident, returning_beams, standing
from bottomlock.studies import consistency
from bottomlock.studies.consistency_page import page
from bottomlock.studies.consistency_table import consistent_cells
from bottomlock.tables.studies import CONSISTENCY_CELL, PUBLISHED, QUANTITIES
from tools import publish_studies as publish


def page_of(table: pl.DataFrame) -> str:
    """A page as the study writes it."""
    facts = {
        "trajectories": ["straight"], "methods": ["tc"], "beams": ["1,2"], "seed": "1", "times_s": ["50"],
        "degrees": 20, "tests": 5, "false_alarm": 0.01, "each_probability": 0.99, "versions": {},
        "configuration_hash": "f" * 64, "command": "bottomlock consistency", "settings": [], "limits": [],
    }  # fmt: skip
    return markdown(page(table, facts))


def study() -> pl.DataFrame:
    """Three methods on two trajectories under two masks, with every verdict; `ins` once and without NIS."""
    means = {"ins": (6.0, 900.0, None), "tc": (6.0, 2e6, 2.0), "sway_current": (3.0, 20.0, 2.0)}
    places = (("nees_velocity_attitude", 50.0, 6.0), ("nees", 50.0, 20.0), ("nis", None, 2.0))
    rows = [
        (
            trajectory,
            beams,
            method,
            quantity,
            time_s,
            degrees,
            100,
            100,
            20.0 if turns and mean > 30.0 else mean,
        )
        for trajectory, turns in (("straight", False), ("lawn_mower", True))
        for beams in ("1,2,3,4", "1,2")
        for method, found in means.items()
        if beams == "1,2,3,4" or method != "ins"
        for (quantity, time_s, degrees), mean in zip(places, found, strict=True)
        if mean is not None
    ]
    return consistency.judge(pl.DataFrame(rows, schema=dict(CONSISTENCY_CELL), orient="row"))


def test_a_page_reads_back_as_the_study_that_wrote_it() -> None:
    """Every cell with its verdicts, from the tables of the page alone."""
    table = study()
    read = publish.read_page(page_of(table), "survey", "page.md")
    assert read.schema == pl.Schema(PUBLISHED)
    keys = ["method", "trajectory", "beams"]
    long = read.unpivot(
        on=list(QUANTITIES), index=keys, variable_name="quantity", value_name="verdict"
    ).drop_nulls()
    assert long.sort(*keys, "quantity").equals(table.select(long.columns).sort(*keys, "quantity"))
    assert set(long["verdict"]) == {"consistent", "overconfident", "conservative"}
    for method in ("ins", "tc", "sway_current"):
        counted = consistent_cells(table.filter(pl.col("method") == method))["consistent"].sum()
        assert standing(read, method).consistent == counted


def test_a_page_of_something_else_is_refused() -> None:
    with pytest.raises(
        publish.PageError, match=r"page.md: expected a page .* found no section 'NEES of velocity"
    ):
        publish.read_page("# Masks", "paper", "page.md")


def test_package_readme_and_methods_say_what_the_pages_say(root: Path) -> None:
    """`python tools/publish_studies.py` writes all three; nobody edits them by hand."""
    published = publish.read_pages(root)
    assert load_published().equals(published)
    readme = (root / "README.md").read_text(encoding="utf-8")
    assert publish.with_advice(readme, published) == readme
    methods = (root / "docs" / "methods" / "index.md").read_text(encoding="utf-8")
    assert publish.with_table(methods, published) == methods


def test_the_readme_recommends_what_is_never_overconfident(root: Path) -> None:
    """In the sentence that is written by hand."""
    readme = (root / "README.md").read_text(encoding="utf-8")
    recommended = re.findall(r"\*\*Recommended: `(\w+)`", readme)
    assert recommended
    assert set(recommended) <= set(never_overconfident(load_published())) - set(REFERENCES)


def test_two_worlds_are_two_columns() -> None:
    """A second page adds its column and must bear the recommendation out, too."""
    survey = publish.read_page(page_of(study()), "survey", "page.md")
    both = pl.concat([survey.with_columns(pl.lit("paper").alias("world")), survey])
    first, last = publish._marks(publish.TABLE)
    start, end = publish._marks(publish.ADVICE)
    page = f"b\n{first}\n| `tc` | one row | old |\n| `sway_current` | x |\n{last}\nc\n"
    written = publish.with_table(page, both)
    (row,) = [line for line in written.splitlines() if line.startswith("| `tc`")]
    words = "overconfident in 2 of 4 (velocity and attitude: 0)"
    assert row == f"| `tc` | one row | {words} | {words} |"
    assert publish.with_table(written, both) == written
    readme = f"a\n{start}{end}\nb\n"
    assert "(docs/consistency_survey.md): `sway_current`." in publish.with_advice(readme, both)
    there = (pl.col("method") == "sway_current") & (pl.col("world") == "survey")
    worse = pl.when(there).then(pl.lit("overconfident")).otherwise("nis").alias("nis")
    assert "): no method." in publish.with_advice(readme, both.with_columns(worse))


def test_the_tables_of_a_masks_study_go_between_their_marks(root: Path) -> None:
    """The page has the marks; what stands around them stays; a study without recovery is refused."""
    page = (root / "docs" / "masks.md").read_text(encoding="utf-8")
    study = "## Velocity under every mask\n\nlegend\n\n| a |\n\n## When the beams come back\n\n| b |\n"
    written = publish.with_masks(page, study, "masks.md")
    assert written.count("| a |") == written.count("| b |") == 1
    assert "Conclusions:" in written
    assert len(written) < 0.7 * len(page)
    assert publish.with_masks(written, study, "masks.md") == written
    with pytest.raises(
        publish.PageError, match="with all cases, found no section 'When the beams come back'"
    ):
        publish.with_masks(page, study.split("## When", maxsplit=1)[0], "masks.md")


@pytest.mark.parametrize(
    ("change", "beams"),
    [
        ({}, "1,2"),
        ({"beams_lost": []}, "1,2,3,4"),
        ({"tilt_deg": 30.0}, None),
        ({"configuration": "+"}, None),
        ({"outages": [{"beams": [1]}]}, None),
        ({"replay_validity": "log.parquet"}, None),
    ],
)
def test_beams_are_those_of_the_studies_or_none(change: dict[str, object], beams: str | None) -> None:
    """Another instrument and beams that come and go have no cells of their own."""
    dvl = {"configuration": "x", "tilt_deg": 20.0, "beams_lost": [3, 4], "outages": [], "dropouts": []}
    assert returning_beams({"dvl": dvl | change}) == beams
