"""docs/evidence.md is what its tables say, README and methods' page state their numbers, and studies fly again."""

import re
import shlex
from pathlib import Path

import polars as pl
import pytest

from bottomlock.config.scenario import load_scenario
from bottomlock.files.columns import STUDY
from bottomlock.kernel import RECOMMENDED_METHOD
from bottomlock.report.advice import REFERENCES, load_published, standing
from bottomlock.studies.cases import in_world
from bottomlock.studies.study import AS_CONFIGURED, Cell, study
from tools import evidence

TABLES = {path.stem: evidence.read(path) for path in sorted(evidence.DATA.glob("*.parquet"))}
STUDIES = sorted(
    (name for name, (table, _) in TABLES.items() if set(STUDY) <= set(table.columns)),
    key=lambda name: int(TABLES[name][0]["runs"][0]),
)
"""The one of the fewest runs first."""
METHODS = ("tc", "sway_current")


def test_the_page_is_what_the_command_writes() -> None:
    assert evidence.PAGE.read_text(encoding="utf-8") == evidence.page()


@pytest.mark.parametrize("name", TABLES)
def test_every_table_says_where_it_is_from(name: str) -> None:
    """A command, and a commit as Git abbreviates it."""
    _, about = TABLES[name]
    assert about["command"]
    assert re.fullmatch(r"[0-9a-f]{7,40}", about["commit"])


def test_the_page_is_short() -> None:
    assert len(evidence.page().split()) <= 6000


def flown(name: str, row: dict[str, object]) -> Cell:
    """The cell of a row, in the world of the table's command."""
    words = shlex.split(TABLES[name][1]["command"])
    scenario = load_scenario(str(row["trajectory"]))
    if "--world" in words:
        scenario = in_world(scenario, load_scenario(words[words.index("--world") + 1]))
    beams, sensors = str(row["beams"]), str(row["sensors"])
    mask = None if beams == AS_CONFIGURED else tuple(map(int, beams.split(",")))
    aiding = None if sensors == AS_CONFIGURED else tuple(sensors.split("+")) if sensors != "none" else ()
    return Cell(scenario, mask, aiding, str(row["method"]))


@pytest.mark.first_cases(1)
@pytest.mark.parametrize("name", STUDIES)
def test_a_row_of_each_study_flies_again(name: str) -> None:
    """The cells of two methods in the middle of the table: a table that an older kernel made is seen."""
    table = TABLES[name][0].filter(pl.col("method").is_in(METHODS))
    middle = table.row(table.height // 2, named=True)
    place = ["trajectory", "beams", "sensors"]
    rows = table.join(pl.DataFrame([middle]).select(place), on=place)
    again = study([flown(name, row) for row in rows.to_dicts()], runs=int(middle["runs"]), threads=1)
    for column in ("velocity_rms_over_runs_mps", "nees_velocity_attitude_greatest", "nees_greatest", "nis"):
        assert again[column].to_list() == pytest.approx(rows[column].to_list(), rel=1e-3), column


def test_the_package_has_the_verdicts_of_the_tables() -> None:
    """`python -m tools.evidence --publish` writes them."""
    assert load_published().equals(evidence.published_table())


def test_the_page_of_methods_counts_what_the_tables_have(root: Path) -> None:
    """Cells in which a method is overconfident, in each world."""
    page = (root / "docs" / "methods" / "index.md").read_text(encoding="utf-8")
    worlds = load_published().partition_by("world")
    rows = re.findall(r"^\| `(\w+)` \|.*?((?:\| \d+ of \d+ )+)\|$", page, re.MULTILINE)
    assert {method for method, _ in rows} == set(load_published()["method"])
    for method, cells in rows:
        counts = [standing(world, method) for world in worlds]
        assert [cell.strip() for cell in cells.split("|")[1:]] == [
            f"{one.overconfident} of {one.cells}" for one in counts
        ]


def test_the_page_of_the_hovering_vehicle_states_the_table(root: Path) -> None:
    page = (root / "docs" / "hovering.md").read_text(encoding="utf-8")
    found = TABLES["study_hovering"][0]
    for beams in ("1,2", "1,3", "1"):
        cells = [
            f"{row['velocity_rms_over_runs_mps']:.3f}, {row['nees_velocity_attitude']:.1f} "
            f"[{row['nees_velocity_attitude_greatest']:.1f}]"
            for method in ("tc", "sway_current", "weak_sway")
            for row in found.filter(beams=beams, method=method).to_dicts()
        ]
        assert f"| {' | '.join([beams, *cells])} |" in page


def test_the_readme_states_the_numbers_of_the_tables(root: Path) -> None:
    """The recommended method's errors and verdicts, and what its prior costs."""
    readme = (root / "README.md").read_text(encoding="utf-8")
    (recommended,) = re.findall(r"\*\*Recommended: \[`(\w+)`\]", readme)
    paper = TABLES["study_paper"][0]
    velocity = paper.filter(method=recommended)["velocity_rms_over_runs_mps"].to_numpy()
    assert (
        f"within {velocity.min():.2f}–{velocity.max():.2f} m/s RMS in all {len(velocity)} simulated cases"
        in " ".join(readme.split())
    )
    assert (
        f"tight coupling reaches {paper.filter(method='tc')['velocity_rms_over_runs_mps'].to_numpy().max():.0f} m/s"
        in readme
    )
    methods = [one for one in load_published()["method"].unique(maintain_order=True) if one not in REFERENCES]
    never = [f"`{one}`" for one in methods if not standing(load_published(), one).overconfident]
    cells = standing(load_published(), recommended).cells
    assert never == [f"`{recommended}`"] == [f"`{RECOMMENDED_METHOD}`"]
    assert f"{never[0]} was overconfident in none of {cells} cells" in " ".join(readme.split())
    assert (
        f"costs up to {TABLES['sway_current_prior'][0]['error_more_percent'].to_numpy().max():.0f} %"
        in readme
    )
