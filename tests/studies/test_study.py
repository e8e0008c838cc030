"""The study: cells, pairs, verdicts of one family, resumption, sums."""

from pathlib import Path

import polars as pl
import pytest

from bottomlock.campaign.run import CampaignProgress
from bottomlock.cli.study import summary_table
from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.errors import ScenarioError
from bottomlock.files.columns import STUDY, check
from bottomlock.statistics.chi_squared import family_band, verdict
from bottomlock.studies.study import Cell, cells, study

METHODS = ("ins", "lc", "tc")
SETS = [(1, 2, 3, 4), (1, 2), (2, 4)]


def short(**change: object) -> Scenario:
    scenario = load_scenario("straight").with_overrides(runs=3, methods=METHODS)
    return scenario.with_trajectory(duration_s=10.0, **change)


@pytest.fixture(scope="module")
def table() -> pl.DataFrame:
    return study(cells([short()], masks=SETS), threads=1)


def test_every_combination_is_a_cell_and_what_no_mask_changes_is_flown_once() -> None:
    whole = cells([short()], sensors=[(), ("depth",)])
    assert len(whole) == 2 * (15 + 2)
    assert {cell.mask for cell in whole if cell.method == "lc"} == {(1, 2, 3, 4)}
    assert [cell.mask for cell in cells([short()], masks=[None])] == [None] * 3


def test_a_row_a_cell_with_its_errors_and_verdict(table: pl.DataFrame) -> None:
    """NEES of 6 and 20 for errors as claimed; the band is that of all its means as one family."""
    check(table, STUDY, place="study")
    assert table["beams"].to_list() == ["1,2,3,4"] * 3 + ["1,2", "2,4"]
    assert (table["velocity_rms_over_runs_lo_mps"] <= table["velocity_rms_over_runs_mps"]).all()
    assert (table["velocity_rms_over_runs_mps"] <= table["velocity_greatest_mps"]).all()
    assert table.filter(method="ins").select("nis", "rejected_fraction").row(0) == (None, None)
    family = table.height * 2 * 5
    for quantity, degrees, words in (
        ("nees_velocity_attitude", 6, "velocity_attitude"),
        ("nees", 20, "whole_state"),
    ):
        for row in table.iter_rows(named=True):
            assert (row[f"{quantity}_lo"], row[f"{quantity}_hi"]) == pytest.approx(
                family_band(degrees, 3, family)
            )
            judged = [row[f"{quantity}_least"], row[f"{quantity}_greatest"]]
            assert row[f"verdict_{words}"] == verdict(judged, 3, degrees, family)


def test_cells_are_pairs_whatever_is_flown_beside_them(table: pl.DataFrame) -> None:
    """A cell alone has the errors of the same cell among others."""
    alone = study([Cell(short(), (2, 4), None, "tc")], threads=1)
    names = [name for name in STUDY if "rms" in name]
    assert alone.select(names).row(0) == table.select(names).row(-1)


def test_sensors_are_those_of_the_cell() -> None:
    """Depth holds the vertical position; `None` is what the scenario has."""
    aided = study(cells([short()], masks=[(1, 2)], sensors=[(), ("depth",), None]), threads=1).filter(
        method="tc"
    )
    assert aided["sensors"].to_list() == ["none", "depth", "as configured"]
    none, depth, own = aided["position_rms_over_runs_m"]
    assert depth < none == own
    with pytest.raises(ScenarioError, match="unknown sensor 'dept', did you mean 'depth'"):
        study([Cell(short(), None, ("dept",), "tc")])
    with pytest.raises(ScenarioError, match="expected one or more of 1 to 4"):
        study([Cell(short(), (5,), None, "tc")])


def test_a_study_resumes(tmp_path: Path, table: pl.DataFrame) -> None:
    """Broken off after a combination it keeps that, and ends in the same table."""
    wanted = cells([short()], masks=SETS)

    def stop(state: CampaignProgress) -> None:
        if not state.trajectory.startswith("straight 1,2,3,4"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        study(wanted, folder=tmp_path, threads=1, progress=stop)
    (first,) = (tmp_path / "straight-1,2,3,4-as_configured").rglob("samples-*")
    stamp = first.stat().st_mtime_ns
    done: dict[str, float] = {}
    totals = set()

    def hear(state: CampaignProgress) -> None:
        done[state.trajectory] = state.runs_done
        totals.add(state.campaign_runs)

    again = study(wanted, folder=tmp_path, threads=1, progress=hear)
    assert again.equals(table, null_equal=True)
    assert first.stat().st_mtime_ns == stamp
    assert totals == {sum(done.values())} == {9}


def by_hand(**change: object) -> pl.DataFrame:
    """Two methods under two sets of beams on one trajectory, one of them overconfident."""
    rows = [
        dict.fromkeys(STUDY, 1.0)
        | {"trajectory": "straight", "beams": beams, "sensors": "none", "method": method, "runs": 50}
        | {"velocity_rms_over_runs_mps": velocity, "verdict": verdict, "verdict_velocity_attitude": verdict}
        | change
        for beams, method, velocity, verdict in (
            ("1,2,3,4", "tc", 0.05, "consistent"), ("1,2,3,4", "vb", 0.05, "conservative"),
            ("1,2", "tc", 4.25, "consistent"), ("1,2", "vb", 9.75, "overconfident"),
        )
    ]  # fmt: skip
    return pl.DataFrame(rows, schema=dict(STUDY), orient="row", strict=False)


def test_sums_by_method() -> None:
    """Cells, those by verdict, least and greatest error."""
    assert [list(row) for row in summary_table(by_hand()).rows] == [
        ["`tc`", "2", "2", "0", "0", "0.050", "4.25"],
        ["`vb`", "2", "0", "1", "1", "0.050", "9.75"],
    ]
